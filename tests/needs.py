"""Skips what needs packages that are not installed, without importing them: collection stays quick."""

from importlib.util import find_spec

import pytest


def needs(*packages: str) -> pytest.MarkDecorator:
    """The mark of a test, or as `pytestmark` of a module, that is skipped where one of these packages is missing."""
    missing = [name for name in packages if find_spec(name) is None]
    return pytest.mark.skipif(bool(missing), reason=f"not installed: {', '.join(missing)}")
