"""Curves dropped that are weak, doubled, spurious or outlines; ends joined."""
