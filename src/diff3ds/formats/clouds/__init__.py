"""Clouds of points from files."""
