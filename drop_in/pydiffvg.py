"""The name `pydiffvg` for `diff3ds.pydiffvg`: scripts that import it run as they are."""

from diff3ds.pydiffvg import install

# From here on the name leads there, for this import too.
install()
