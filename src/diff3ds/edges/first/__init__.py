"""First curves: space carved, points triangulated, chained and cut into primitives."""
