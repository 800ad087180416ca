"""Posed pictures and single ones as data: read, brought onto one canvas, their background and ink found."""
