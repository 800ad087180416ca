"""What `diff3ds study` does: a user study on one page, and what its answers say."""
