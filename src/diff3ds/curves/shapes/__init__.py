"""Lines, arcs, ellipses and cubics: fits to points, and sets of curves that stay what they are."""
