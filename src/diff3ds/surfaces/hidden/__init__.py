"""What a surface hides from a camera: where strokes cross its outlines, and which of their parts are seen."""
