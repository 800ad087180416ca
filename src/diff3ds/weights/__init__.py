"""Weights of networks: where published, found, fetched, read, renamed."""
