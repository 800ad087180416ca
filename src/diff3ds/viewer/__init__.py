"""A page on which a sketch is turned, looked at and its strokes are found: our own script and WebGL2, offline."""
