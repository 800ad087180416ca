"""Coloured pictures to coloured strokes, and to black ones by the losses of 3Doodle."""
