"""What `diff3ds view` does."""
