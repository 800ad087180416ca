"""Tone by lines on a surface: hatching."""
