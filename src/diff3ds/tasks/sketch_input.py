"""The sketch that a command is given: a file, or the folder of a run."""

from pathlib import Path

from diff3ds.formats import load
from diff3ds.sketch import Sketch
from diff3ds.surfaces.seen_around import by_importance
from diff3ds.tasks.detail_options import WHOLE, DetailOptions


def name_of(source: Path) -> str:
    """What a sketch is called: by its file, or by the folder of its run."""
    return source.resolve().name if source.is_dir() else source.stem


def load_sketch(source: Path) -> Sketch:
    """The sketch that `load` reads, which has strokes.

    Raises:
        ValueError: a sketch without strokes; as `load`.
        OSError, ImportError: as `load`.
    """
    sketch = load(source)
    if len(sketch) == 0:
        raise ValueError(f"{source}: the sketch has no strokes")
    return sketch


def at_level(sketch: Sketch, level: DetailOptions) -> Sketch:
    """The strokes that are asked for; of a sketch that does not say which are important, these are found."""
    if level == WHOLE:
        return sketch
    known = sketch if sketch.importance is not None else by_importance(sketch)
    return known.at_detail(level.detail, strokes=level.strokes)
