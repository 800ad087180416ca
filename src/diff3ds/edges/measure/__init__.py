"""Curves fitted to the ridges, and what several of them share: planes, radii, vertices, tangents."""
