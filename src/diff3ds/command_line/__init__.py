"""What the command line needs before anything large is imported: options in the words of their user, Ctrl-C."""
