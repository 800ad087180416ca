"""The table of the constants of edges: made from the sources and their comments (`benchmarks/constants.py`)."""

import sys
from itertools import groupby
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import Files
from mkdocs.structure.pages import Page

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from constants import Constant, constants

_PAGE = "reference/constants.md"


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Adds a table a module to the page."""
    if page.file.src_uri != _PAGE:
        return markdown
    modules = groupby(constants(), key=lambda constant: constant.module)
    return "\n".join([markdown, *(_section(module, list(members)) for module, members in modules)])


def _section(module: str, members: list[Constant]) -> str:
    head = [f"\n## {module}\n", "| name | value | unit | chosen | what it is |", "| --- | ---: | --- | --- | --- |"]
    rows = []
    for number, constant in enumerate(members):
        # Names of one line share their comment.
        said = number and members[number - 1].about == constant.about
        cells = [f"`{constant.name}`", f"`{constant.value}`", constant.unit, constant.chosen]
        rows.append("| " + " | ".join([*cells, "" if said else constant.about.replace("|", "\\|")]) + " |")
    return "\n".join([*head, *rows])
