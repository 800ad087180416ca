"""`diff3ds eval`: scores of runs."""
