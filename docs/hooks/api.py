"""The reference of the Python interface: one page a package, made from the docstrings of its modules."""

import inspect
from pathlib import Path
from types import ModuleType

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import diff3ds

_SOURCES = Path(__file__).parents[2] / "src"
_PACKAGE = "diff3ds"
_PAGE = "reference/python.md"


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Puts the pages of the packages into the navigation, behind the page that is there."""
    reference = next(entry["Reference"] for entry in config.nav if "Reference" in entry)
    pages = next(entry["Python"] for entry in reference if "Python" in entry)
    pages.extend({name: _uri(name)} for name in _packages() if name != _PACKAGE)
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pages."""
    for name, modules in _packages().items():
        if name != _PACKAGE:
            head = f"::: {name}\n    options: {{heading_level: 1}}\n"
            files.append(File.generated(config, _uri(name), content="\n".join([head, _documented(modules)])))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Adds the public names and the modules that lie in no package to the first page."""
    if page.file.src_uri != _PAGE:
        return markdown
    return "\n".join([markdown, _public_names(), _documented(_packages()[_PACKAGE])])


def _documented(modules: list[str]) -> str:
    return "\n".join(f"::: {module}\n" for module in modules)


def _uri(package: str) -> str:
    return f"reference/api/{package}.md"


def _packages() -> dict[str, list[str]]:
    """Modules of each package, by their names with dots."""
    found: dict[str, list[str]] = {}
    for file in sorted(_SOURCES.glob(f"{_PACKAGE}/**/*.py")):
        parts = file.relative_to(_SOURCES).with_suffix("").parts
        if any(part.startswith("_") for part in parts[:-1]):
            continue
        modules = found.setdefault(".".join(parts[:-1]), [])
        if not parts[-1].startswith("_"):
            modules.append(".".join(parts))
    return found


def _public_names() -> str:
    """A table of what `import diff3ds` gives."""
    rows = ["| name | what it is |", "|---|---|"]
    for name in diff3ds.__all__:
        if name.startswith("_"):
            continue
        thing = getattr(diff3ds, name)
        path = thing.__name__ if isinstance(thing, ModuleType) else f"{thing.__module__}.{name}"
        about = inspect.getdoc(thing) or ""
        rows.append(f"| [`{name}`][{path}] | {about.splitlines()[0]} |")
    return "\n".join(rows) + "\n"
