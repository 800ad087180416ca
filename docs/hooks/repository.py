"""Links of the pages to files of the repository beside docs/: the site takes these files along, under repository/."""

import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

_ROOT = Path(__file__).parents[2]
_PLACE = "repository/"
_LINK = re.compile(r"(?<=\]\()(?![a-z]+:|#)([^()\s#]+)")
_CODE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the files that pages, and pages among these files, link to, and those that the navigation names."""
    named = re.findall(rf"{_PLACE}([\w./-]+)", str(config.nav))
    waiting = [path for page in files.documentation_pages() for path in _targets(page.src_uri, page.content_string)]
    waiting += [path for path in named if path not in waiting]
    while waiting:
        path = waiting.pop()
        uri = _PLACE + path
        if path.startswith("docs/") or files.get_file_from_path(uri) is not None or not (_ROOT / path).is_file():
            continue
        files.append(File.generated(config, uri, abs_src_path=str(_ROOT / path)))
        if path.endswith(".md"):
            waiting += _targets(uri, (_ROOT / path).read_text(encoding="utf-8"))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Points links to files of the repository to where the site has them."""
    uri = page.file.src_uri
    return _LINK.sub(lambda found: posixpath.relpath(_uri(_path(uri, found[1])), posixpath.dirname(uri)), markdown)


def _targets(uri: str, markdown: str) -> list[str]:
    return [_path(uri, link) for link in _LINK.findall(_CODE.sub("", markdown))]


def _path(uri: str, link: str) -> str:
    """Path in the repository of what the page `uri` links to."""
    page = uri.removeprefix(_PLACE) if uri.startswith(_PLACE) else f"docs/{uri}"
    return posixpath.normpath(posixpath.join(posixpath.dirname(page), link))


def _uri(path: str) -> str:
    return path.removeprefix("docs/") if path.startswith("docs/") else _PLACE + path
