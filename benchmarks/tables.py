"""Writes the tables of docs/results from benchmarks/results, each with its machine, commit and command.

    python benchmarks/tables.py

A table stands between `<!-- table NAME -->` and `<!-- end -->`, NAME being a function of tables_renderer.py or
tables_sketches.py; all else on the pages is written by hand.
"""

import re
from pathlib import Path

import tables_renderer
import tables_sketches

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "docs/results"
TABLES = tables_renderer.TABLES + tables_sketches.TABLES


def page(path: Path) -> str:
    """A page with its tables made anew."""
    made = {table.__name__: table for table in TABLES}
    pattern = re.compile(r"(<!-- table (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
    return pattern.sub(lambda found: f"{found[1]}\n{made[found[2]]()}\n{found[3]}", path.read_text(encoding="utf-8"))


if __name__ == "__main__":
    for file in sorted(PAGES.glob("*.md")):
        text = page(file)
        file.write_text(text, encoding="utf-8")
        print(file.relative_to(ROOT))
