"""Jobs side by side: in threads, or in copies of the process."""
