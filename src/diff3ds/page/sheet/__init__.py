"""The sheet of paper that views lie on, and where."""
