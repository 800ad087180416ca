"""Unions of ellipsoids, cylinders and cones, whose contours are conics."""
