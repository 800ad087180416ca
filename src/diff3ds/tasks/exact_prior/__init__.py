"""The built-in prior: the members of a library, known exactly."""
