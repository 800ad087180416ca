"""The numeric constants of edges, those of `diff3ds.edges` and `diff3ds.curves.shapes`, read from their sources.

The table and the sensitivity run go by them. A constant is a name in capitals with one number in its value. The comment
above it begins with its units and with what it was chosen on: `# [px, fraction; empirical] A curve doubles longer ones
if ...`; one unit for all names of the line, or one each. What is chosen on: "measured" says on what, "empirical" by the
scores of `views.py`, "derived" follows from something else, "numerical" is small or large enough for the arithmetic,
"speed" bounds the work.
"""

import ast
import re
from dataclasses import dataclass
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "src/diff3ds"
ROOMS = ("edges", "curves/shapes")
CHOSEN = ("measured", "empirical", "derived", "numerical", "speed")


@dataclass(frozen=True)
class Constant:
    """A constant.

    Attributes:
        module: below `diff3ds`, with dots.
        name: of a number among several, with its place: `CLOSED[2]`.
        value: as it is written.
        unit, chosen, about: from the comment.
        line, start, stop: where the number is written, for who changes it.
    """

    module: str
    name: str
    value: str
    unit: str
    chosen: str
    about: str
    line: int
    start: int
    stop: int


def constants() -> list[Constant]:
    """All constants, module by module.

    Raises:
        ValueError: one has no comment of the form above.
    """
    files = [path for room in ROOMS for path in sorted((PACKAGE / room).rglob("*.py"))]
    return [constant for path in files for constant in _of_module(path)]


def module_of(path: Path) -> str:
    """The name of a source file's module below `diff3ds`."""
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts)


def _of_module(path: Path) -> list[Constant]:
    source = path.read_text()
    found = []
    for node in ast.parse(source).body:
        if not (isinstance(node, ast.Assign) and len(node.targets) == 1):
            continue
        target = node.targets[0]
        names = target.elts if isinstance(target, ast.Tuple) else [target]
        values = (
            node.value.elts if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple) else [node.value]
        )
        if len(names) == len(values) and all(isinstance(name, ast.Name) and name.id.isupper() for name in names):
            numbers = [_numbers(name.id, value) for name, value in zip(names, values, strict=True)]
            found += _constants(path, source, node.lineno, numbers) if any(numbers) else []
    return found


def _numbers(name: str, value: ast.expr) -> list[tuple[str, str, ast.Constant]]:
    """Name, text and number of a constant; several if it is a tuple, none if it is derived from others or no number."""
    if isinstance(value, ast.Tuple):
        return [part for i, each in enumerate(value.elts) for part in _numbers(f"{name}[{i}]", each)]
    used = {node.id for node in ast.walk(value) if isinstance(node, ast.Name)}
    numbers = [n for n in ast.walk(value) if isinstance(n, ast.Constant) and isinstance(n.value, int | float)]
    return [(name, ast.unparse(value), numbers[0])] if len(numbers) == 1 and used <= {"np", "math"} else []


def _constants(
    path: Path, source: str, line: int, numbers: list[list[tuple[str, str, ast.Constant]]]
) -> list[Constant]:
    above = line - 1
    lines = source.splitlines()
    while above and lines[above - 1].startswith("#"):
        above -= 1
    comment = " ".join(text.removeprefix("#").strip() for text in lines[above : line - 1])
    match = re.fullmatch(r"\[([^;\]]+); (\w+)\] (.+)", comment)
    units = match[1].split(", ") if match else []
    if match is None or match[2] not in CHOSEN or len(units) not in (1, len(numbers)):
        raise ValueError(
            f"{path}:{line}: the comment above a constant has to begin with its units and with what it was chosen on, "
            f'"# [px; empirical] ...", one unit or {len(numbers)}, and one of {", ".join(CHOSEN)}'
        )
    units = units * len(numbers) if len(units) == 1 else units
    module = module_of(path)
    return [
        Constant(
            module, name, text, unit, match[2], match[3], number.lineno, number.col_offset, number.end_col_offset or 0
        )
        for unit, parts in zip(units, numbers, strict=True)
        for name, text, number in parts
    ]
