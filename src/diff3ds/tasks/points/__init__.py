"""A cloud of points to a sketch: `diff3ds points`."""
