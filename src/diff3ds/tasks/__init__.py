"""What a command does, as a function: one folder a command."""
