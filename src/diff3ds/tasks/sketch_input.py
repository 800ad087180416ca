"""The sketch that a command is given: a file, or the folder of a run."""

from pathlib import Path

from diff3ds._detail import kept
from diff3ds.curves.importance import Ranked
from diff3ds.formats import load
from diff3ds.sketch import Sketch
from diff3ds.surfaces.seen_around import ranked_around
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
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


def at_level(sketch: Sketch, level: DetailOptions, surface: TriangleMesh | None = None) -> Ranked:
    """The strokes that are asked for, and their numbers; where none is known to be important, these are found.

    Args:
        surface: what hides strokes then.
    """
    known = Ranked(sketch, list(range(len(sketch))))
    if level == WHOLE:
        return known
    if sketch.importance is None:
        known = ranked_around(sketch, surface)
    worth = known.sketch.importance
    assert worth is not None
    rows = kept(worth, level.detail, level.strokes).nonzero().flatten().tolist()
    return Ranked(known.sketch[rows], [known.strokes[row] for row in rows])
