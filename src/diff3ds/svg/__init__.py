"""SVG as text: elements, styles, transforms, path data and colours, read with bounds and not trusted."""
