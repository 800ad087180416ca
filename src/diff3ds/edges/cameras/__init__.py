"""Cameras moved, together with the curves, until the views agree."""
