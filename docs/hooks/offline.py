"""Nothing is fetched from elsewhere when a page is read: fonts, scripts, styles and pictures are those of the site."""

import logging
import re

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.pages import Page

# A warning is an error of a strict build.
_LOG = logging.getLogger("mkdocs.hooks.offline")
_FETCHED = re.compile(
    r"<(?:script|link|img|iframe|source|video)\b[^>]*\b(?:src|srcset|href)=[\"']?((?:https?:)?//[^\"'\s>]+)"
)


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Warns of what a browser would fetch."""
    for address in _FETCHED.findall(output):
        _LOG.warning("%s would fetch %s", page.file.src_uri, address)
    return output
