"""The sketch that a command is given: a file, or the folder of a run."""

from pathlib import Path

from diff3ds.formats import load
from diff3ds.sketch import Sketch


def name_of(source: Path) -> str:
    """What a sketch is called: by its file, or by the folder of its run."""
    return source.resolve().name if source.is_dir() else source.stem


def load_sketch(source: Path) -> Sketch:
    """The sketch in a file that `load` reads, or in the sketch.json of a folder that a run wrote.

    Raises:
        ValueError: a folder without sketch.json, a sketch without strokes; as `load`.
        OSError, ImportError: as `load`.
    """
    path = source
    if not source.exists():
        raise FileNotFoundError(f"{source} is not there: give the folder of a run, or a file with a sketch")
    if source.is_dir():
        path = source / "sketch.json"
        if not path.is_file():
            raise ValueError(f"{source} has no sketch.json: give the folder of a run, or a file with a sketch")
    sketch = load(path)
    if len(sketch) == 0:
        raise ValueError(f"{path}: the sketch has no strokes")
    return sketch
