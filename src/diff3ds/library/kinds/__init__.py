"""How things of each kind are drawn: a file a kind, named in `diff3ds.library.categories`."""
