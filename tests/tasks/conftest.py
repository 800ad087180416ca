"""Settings shared by the tests of commands."""

import pytest

from diff3ds.tasks.exact_prior import exemplars
from diff3ds.tasks.text_image import image


@pytest.fixture
def few_members(monkeypatch):
    """Of the library the built-in prior has seen little: for what does not depend on how well it knows things."""
    for module in (exemplars, image):
        monkeypatch.setattr(module, "FITTING", 2)
    monkeypatch.setattr(exemplars, "OTHER_KINDS", ("car", "tree"))
