"""What `diff3ds apply` does."""
