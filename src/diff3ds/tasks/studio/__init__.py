"""The studio: the commands in a browser of this machine, with what was made, in a folder."""
