"""A server on this machine for the browser of this machine: who is let in, and how it listens."""
