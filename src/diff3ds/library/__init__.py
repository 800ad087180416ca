"""Procedural 3D sketches: scenes with known answers."""
