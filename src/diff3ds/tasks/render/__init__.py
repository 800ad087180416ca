"""What `diff3ds render` does."""
