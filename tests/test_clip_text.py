"""Phrases as CLIP's tokenizers clean them."""

import importlib.util
import sys

import pytest

from diff3ds.weights.clip_text import cleaned

needs_ftfy = pytest.mark.skipif(importlib.util.find_spec("ftfy") is None, reason="the extra diffusion is not installed")


@needs_ftfy
@pytest.mark.parametrize(
    ("phrase", "expected"),
    [
        ("A Chair", "a chair"),
        ("a “curly” cat’s chair", 'a "curly" cat\'s chair'),
        ("fish &amp; chips", "fish & chips"),
        ("&amp;quot;x&amp;quot;", '"x"'),
        ("&lt;b&gt; &#39;s", "<b> 's"),
        ("ﬁsh of ﬂour", "fish of flour"),
        ("ＦＵＬＬ", "full"),
        ("naÃ¯ve cafÃ©", "naïve café"),
        (" a \t\u00a0b\n", "a b"),
        ("&nbsp;", ""),
        ("½ cup", "½ cup"),
        ("日本語の椅子", "日本語の椅子"),
    ],
)
def test_as_clip_cleans(phrase, expected):
    """What the two cleaning functions of OpenAI's CLIP give, one after the other."""
    assert cleaned(phrase) == expected
    assert cleaned(expected) == expected


def test_what_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "ftfy", None)
    with pytest.raises(ImportError, match=r'phrases for CLIP need ftfy: pip install "diff3ds\[diffusion\]"'):
        cleaned("a chair")
