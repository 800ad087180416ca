"""What a command does, as a function: one module a command."""
