"""`diff3ds views`: posed pictures to a sketch."""
