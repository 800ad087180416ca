"""What is seen to before a file of another program's format is begun."""

import importlib.util
from pathlib import Path

from diff3ds._units import Unit, check_unit
from diff3ds.sketch import Sketch


def check_sketch(path: Path, sketch: Sketch, kind: str) -> None:
    """Sees that there is something to be written: the formats that need it say one sentence.

    Args:
        path: of the file, for messages.
        sketch: what is to be written.
        kind: of the file, such as "a DXF".

    Raises:
        ValueError: no strokes, or values that have become invalid since the sketch was made.
    """
    sketch.check_values()
    if len(sketch) == 0:
        raise ValueError(f"{path}: {kind} file needs at least one stroke, got none")


def check_writable(path: Path, sketch: Sketch, unit: Unit, kind: str, module: str, package: str, extra: str) -> None:
    """Sees that a sketch can be written by a library that comes with an extra.

    Args:
        path: of the file, for messages.
        sketch: what is to be written.
        unit: what a world unit is.
        kind: of the file, such as "DXF".
        module: that the library is imported as.
        package: that it is installed as.
        extra: that it comes with.

    Raises:
        ImportError: the library is not installed.
        ValueError: no strokes, a unit that is not known, or values that have become invalid since the sketch was made.
    """
    check_unit(unit)
    check_sketch(path, sketch, f"a {kind}")
    if importlib.util.find_spec(module) is None:
        raise ImportError(f"{path}: writing {kind} takes {package}: install it with pip install 'diff3ds[{extra}]'")
