"""Formulas in LaTeX become MathML when the site is built: browsers show it without a script."""

import html
import re

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import Files
from mkdocs.structure.pages import Page

# As pymdownx.arithmatex marks them.
_INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
_BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)
_NUMBER = re.compile(r"\\tag\{(\w+)\}")


def on_page_content(content: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Replaces the formulas of a page."""
    return _BLOCK.sub(_block, _INLINE.sub(lambda found: convert(html.unescape(found[1])), content))


def _block(found: re.Match[str]) -> str:
    latex = html.unescape(found[1])
    number = _NUMBER.search(latex)
    shown = f'<span id="eq-{number[1]}">({number[1]})</span>' if number else ""
    return f'<div class="formula">{convert(_NUMBER.sub("", latex).strip(), display="block")}{shown}</div>'
