"""What works on this machine, and whether a prior's weights do: `diff3ds doctor`."""
