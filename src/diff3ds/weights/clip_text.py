"""Phrases as the tokenizers of CLIP and OpenCLIP read them; those of transformers leave the cleaning to others."""

import html
from typing import Any


def cleaned(phrase: str) -> str:
    """A phrase as both tokenizers clean it before they look at its letters.

    Broken encodings, curly quotes, ligatures and full-width letters become plain ones (ftfy), names of HTML characters
    the characters, any white space one space, capitals small letters.

    Raises:
        ImportError: ftfy is not installed.
    """
    try:
        import ftfy
    except ImportError as error:
        raise ImportError('phrases for CLIP need ftfy: pip install "diff3ds[diffusion]"') from error
    # Twice: "&amp;quot;" is found in captions, on which CLIP was trained.
    return " ".join(html.unescape(html.unescape(ftfy.fix_text(phrase))).split()).lower()


def clip_tokens(tokenizer: Any, phrase: str, **options: Any) -> Any:
    """What a transformers.CLIPTokenizer makes of a phrase, cleaned, with the start and the end.

    A token that the tokenizer calls special is not looked for in the phrase: Stable Diffusion 2 pads with "!", and
    every exclamation mark would be padding instead of a word of its own, or part of one such as "!!!".

    Args:
        options: of the tokenizer, such as `truncation`.

    Raises:
        ImportError: as `cleaned`.
    """
    return tokenizer(cleaned(phrase), split_special_tokens=True, **options)
