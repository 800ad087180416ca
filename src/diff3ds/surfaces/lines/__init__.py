"""Lines of surfaces: creases, borders and seams, which all views share, and contours, which each has its own of."""
