"""What is on paper: strokes as a camera sees them, in pieces, parts and lines, in their order, with their outlines."""
