"""Priors that need no weights from elsewhere: one whose score is exact, and a small network of this project."""
