"""The reference of the command line: tables of what each command's --help says."""

import contextlib
import io
import os
import re
from unittest.mock import patch

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import Files
from mkdocs.structure.pages import Page

from diff3ds.cli import main

_PAGE = "reference/command-line.md"
# It has options of its own.
_RECIPE = ["views", "--recipe", "3doodle"]


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Adds a section a command to the page."""
    if page.file.src_uri != _PAGE:
        return markdown
    names = re.search(r"\{([\w,]+)\}", _help([]))
    assert names is not None
    called = [[name] for name in names[1].split(",")]
    called.insert(called.index(["views"]) + 1, _RECIPE)
    return "\n".join([markdown, *(_section(" ".join(words), _help(words)) for words in called)])


def _help(words: list[str]) -> str:
    """What --help says, without colours, in lines so long that none is broken."""
    said = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")  # by which tyro knows that it may draw boxes
    plain = patch.dict(os.environ, {"COLUMNS": "4000", "NO_COLOR": "1"})
    with plain, contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
        main([*words, "--help"])
    said.seek(0)
    return said.read()


def _section(title: str, text: str) -> str:
    usage, about = text[: text.index("╭")].split("\n\n", 1)
    lines = [f"## diff3ds {title}\n", f"```\n{usage.removeprefix('usage: ')}\n```\n", _escaped(about.strip()) + "\n"]
    for box in re.findall(r"╭─ (.*?) ─*╮\n(.*?)╰", text, re.DOTALL):
        lines += _table(*box)
    return "\n".join(lines) + "\n"


def _table(title: str, body: str) -> list[str]:
    """The rows of one box: a name begins each, and its text stands behind it or on the next line."""
    about, rows = [], []
    for line in (line.strip("│").rstrip() for line in body.splitlines()):
        name, _, text = line.strip().partition("  ")
        if re.match(r" (-|[A-Z])", line) and (text or re.match(r"-|[A-Z{}|]+$", name)):
            rows.append([name, text.strip()])
        elif rows:
            rows[-1][1] = f"{rows[-1][1]} {line.strip()}".strip()
        elif not re.fullmatch(r"[\s─]*", line):
            about.append(line.strip())
    cells = [f"| {_names(name)} | {_escaped(text)} |" for name, text in rows if name != "-h, --help"]
    if not cells:
        return []
    return [
        f"**{title[0].upper()}{title[1:]}.** {_escaped(' '.join(about))}\n",
        "| option | what it says |\n|---|---|",
        *cells,
        "",
    ]


def _names(name: str) -> str:
    """What is typed; that a value may be missing shows in its default."""
    return f"<code>{_escaped(name.replace('{None}|', ''))}</code>"


def _escaped(text: str) -> str:
    """Text of a terminal in Markdown: nothing in it is a mark, but for `code`."""
    parts = re.split(r"(`[^`]*`)", text)
    plain = [part.replace("&", "&amp;").replace("<", "&lt;") for part in parts[::2]]
    parts[::2] = [re.sub(r"([|*_`\[\]{}])", r"\\\1", part) for part in plain]
    return "".join(parts)
