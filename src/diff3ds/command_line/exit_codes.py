"""Exit codes: 0 done, 1 the input is at fault, 130 ended by Ctrl-C; 2, the command line is, comes from tyro."""

FAULT = 1
# As shells say that a program ended by Ctrl-C.
STOPPED = 128 + 2
