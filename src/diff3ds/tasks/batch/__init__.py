"""What `diff3ds batch` does: many runs, by several processes and machines."""
