"""The small network as a prior, and its training."""
