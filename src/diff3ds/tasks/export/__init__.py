"""What `diff3ds export` does."""
