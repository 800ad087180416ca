"""What `diff3ds mesh` does."""
