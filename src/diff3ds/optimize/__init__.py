"""The optimisation loop, and which strokes a running fit drops, adds and splits."""
