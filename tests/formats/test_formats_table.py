"""The tables of docs/reference/formats-read.md say what is so: each row is tried on a file that has the feature.

A section of the page is a kind of file, which is a module here: `read(path)` reads such a file, and `EXAMPLES` has, by
the heading of the format and the row's first column, an `Example` for each row.
"""

import re
import warnings
from pathlib import Path

import examples_of_cameras
import examples_of_curves
import examples_of_meshes
import pytest

PAGE = Path(__file__).parents[2] / "docs/reference/formats-read.md"
KINDS = {"Cameras": examples_of_cameras, "Meshes": examples_of_meshes, "CAD drawings and scenes": examples_of_curves}
WORDS = ("read", "left out", "said", "refused")


def rows() -> list[tuple[str, str, str, str]]:
    """Kind, format, feature and what becomes of it, of all rows of the tables."""
    found, kind, format_ = [], "", ""
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if line.startswith("## "):
            kind, format_ = line[3:], ""
        elif line.startswith("### "):
            format_ = line[4:]
        elif format_ and line.startswith("|") and not line.startswith(("|---", "| feature |")):
            feature, becomes, _ = (cell.strip() for cell in line[1:-1].split("|"))
            found.append((kind, format_, feature, becomes))
    return found


ROWS = rows()


def test_every_row_has_an_example_and_every_example_a_row():
    examples = [(k, f, row) for k, module in KINDS.items() for f, of in module.EXAMPLES.items() for row in of]
    assert sorted(examples) == sorted((kind, format_, feature) for kind, format_, feature, _ in ROWS)
    assert {becomes for *_, becomes in ROWS} <= set(WORDS)


@pytest.mark.parametrize(("kind", "format_", "feature", "becomes"), ROWS, ids=[f"{r[1]}: {r[2]}" for r in ROWS])
def test_what_a_row_says_is_so(kind, format_, feature, becomes, tmp_path):
    module = KINDS[kind]
    example = module.EXAMPLES[format_][feature]
    path = example.make(tmp_path)
    assert bool(example.words) == (becomes in ("said", "refused"))
    if becomes == "refused":
        with pytest.raises(ValueError, match=re.escape(path.name)) as caught:
            module.read(path)
        assert example.words in str(caught.value)
        return
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        found = module.read(path)
    assert example.right(found)
    lines = [str(line.message) for line in said]
    assert len(lines) == (becomes == "said"), lines
    assert all(path.name in line and example.words in line and "\n" not in line for line in lines)
