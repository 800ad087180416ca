"""Edge maps and drawings to strokes: what `diff3ds views` does with `--target edges`."""
