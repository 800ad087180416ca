"""Readers of mesh files, one a format, and what they share: polygons, numbers in texts, materials, files beside."""
