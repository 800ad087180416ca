"""A sketch that a run goes on from, instead of strokes of its own: `--from`."""

import hashlib
from pathlib import Path

import torch

from diff3ds.constraints import Constraint, fixed
from diff3ds.optimize.config import Rates
from diff3ds.sketch import Sketch
from diff3ds.tasks.sketch_input import load_sketch


def load_start(source: Path, out: Path) -> Sketch:
    """The sketch in a file or in the folder of a run, of which something may move.

    Args:
        source: the file or folder.
        out: the folder of the new run.

    Raises:
        ValueError: all strokes are fixed, or the new run would write over it; as `load_sketch`.
        OSError, ImportError: as `load_sketch`.
    """
    if source.resolve().is_relative_to(out.resolve()):
        raise ValueError(f"{source}: the results in {out} would take its place: give another folder (-o)")
    # Other curves are worth other shares.
    sketch = load_sketch(source).detach().replace(importance=None)
    if sketch.fixed is not None and bool(sketch.fixed.all()):
        raise ValueError(f"{source}: all strokes are fixed, so that nothing would move: free some of them")
    return sketch


def digest_of(source: Path) -> str:
    """Tells the sketch in a file, or of a run, from others."""
    path = source / "sketch.json" if source.is_dir() else source
    return hashlib.sha256(path.read_bytes()).hexdigest()


def held(sketch: Sketch) -> list[Constraint]:
    """What keeps the fixed strokes of a sketch where they are."""
    return [] if sketch.fixed is None else [fixed(sketch, sketch.fixed.nonzero()[:, 0])]


def finished(found: Sketch, start: Sketch, rates: Rates) -> Sketch:
    """What was found, with all of the start that was not to change, bit for bit.

    Args:
        found: the strokes of the start in the same order, moved.
        start: from where the run went on.
        rates: of the fields that it optimised.
    """
    dtype = torch.promote_types(found.points.dtype, start.points.dtype)
    found, start = found.to(dtype), start.to(dtype)
    values = found.tensors()
    for name, before in start.tensors().items():
        if not getattr(rates, name):
            values[name] = before
        elif start.fixed is not None:
            of_segments = name in start.segment_fields and start.chains is not None
            kept = start.fixed[start.chains.stroke] if of_segments and start.chains is not None else start.fixed
            values[name] = torch.where(kept.reshape(-1, *[1] * (before.ndim - 1)), before, values[name])
    return start.replace(**values)
