"""Notebooks as pages: each NAME.ipynb below docs/ is shown as NAME.md, with what its cells put out when it was kept.

Its pictures and the cells that drew them make a page of the gallery, gallery/NAME.md.
"""

import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from nbconvert import MarkdownExporter

# A heading, a cell, or a picture that a cell put out, in the text that the exporter writes.
_PIECE = re.compile(
    r"^## (?P<heading>[^\n]+)$|^```python\n(?P<code>.*?)^```$|^!\[png\]\((?P<picture>\S+)\)$", re.M | re.S
)
_LINK = re.compile(r"(\]\([\w./-]+)\.ipynb(?=\))")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds a page for each notebook, with its pictures in a folder beside it, and a link to the notebook itself."""
    for file in [file for file in files if file.src_uri.endswith(".ipynb")]:
        folder, name = posixpath.split(file.src_uri)
        stem = Path(name).stem
        given = {"unique_key": stem, "output_files_dir": f"{stem}_files"}
        text, made = MarkdownExporter().from_filename(str(file.abs_src_path), given)
        note = f"*This page is [a notebook]({name}): take it to Jupyter, VS Code or Colab.*"
        title, _, rest = text.partition("\n\n")
        shown = _gallery(title.removeprefix("# "), text, posixpath.relpath(folder, "gallery"), stem)
        files.append(File.generated(config, f"gallery/{stem}.md", content=shown))
        page = posixpath.join(folder, f"{stem}.md")
        files.append(File.generated(config, page, content=f"{title}\n\n{note}\n\n{rest}"))
        for picture, content in made["outputs"].items():
            files.append(File.generated(config, posixpath.join(folder, picture), content=content))
    return files


def _gallery(title: str, text: str, folder: str, stem: str) -> str:
    """The page of a notebook's pictures: each below the heading of its section, with the cell that drew it."""
    page, heading, code = (
        [f"# {title}: its pictures\n\nAll of [the notebook]({folder}/{stem}.md)'s pictures, each with what drew it."],
        "",
        "",
    )
    for piece in _PIECE.finditer(text):
        heading = piece["heading"] or heading
        code = piece["code"] or code
        if piece["picture"]:
            page.append(f"## {heading}\n\n![{heading}]({folder}/{piece['picture']})\n\n```python\n{code}```")
    return "\n\n".join(page) + "\n"


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Points links to notebooks to their pages, but for those of the pages themselves."""
    own = files.get_file_from_path(str(Path(page.file.src_uri).with_suffix(".ipynb").as_posix()))
    return markdown if own else _LINK.sub(r"\1.md", markdown)
