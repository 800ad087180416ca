"""Curves placed where the ridges are, and what several of them share: planes, radii, vertices, tangents."""
