"""Formats of viewers, scenes and renderers: tubes, lines and curves."""
