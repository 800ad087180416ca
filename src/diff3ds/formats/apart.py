"""Strokes of files that libraries read, in a process of its own: no file crashes the caller, or stops it for long."""

import json
import math
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import torch

from diff3ds._files import check_there
from diff3ds._shapes import Tensor
from diff3ds.bezier import MAX_DEGREE, from_nurbs, subcurve
from diff3ds.formats.assembly import ReadStroke, Segment, sketch_of
from diff3ds.sketch import DEFAULT_WIDTH, Sketch

# A sketch of 100,000 strokes takes 100 MB; more is taken for a mistake or an attack.
MAX_BYTES = 1 << 28
# Some broken files make libraries hang. They read about 2 MB a second; this leaves room for a slow machine.
SECONDS = 30
SECONDS_PER_MEGABYTE = 10
# Of the sizes of two segments: how far apart what follows on each other may be. [empirical: programs write 7 digits]
JOINT = 1e-6


def check_size(path: Path) -> None:
    """Raises what `check_there` does, for a file that is not there or is too large."""
    check_there(path, "a file that is", MAX_BYTES)


def strokes_apart(path: Path, reader: str, program: str, kind: str) -> list[dict[str, Any]]:
    """The strokes that a reader finds, as it has them.

    Args:
        reader: the module with it, such as diff3ds.formats.cad.step_reader (`reader_process.py`).
        program: what it reads with, for messages.
        kind: of the file, for messages.

    Raises:
        ValueError: a file that is too large or broken, or that has no curves.
        OSError: the file cannot be read.
    """
    strokes, said = found_apart(path, reader, program, kind)
    if not strokes:
        raise ValueError("; ".join([f"{path}: no curves in this {kind} file", *said]))
    say_of(path, said)
    return cast(list[dict[str, Any]], strokes)


def say_of(path: Path, said: list[str]) -> None:
    """Warns of what is left out of a file or assumed."""
    for line in said:
        warnings.warn(f"{path}: {line}", stacklevel=5)


def found_apart(
    path: Path, reader: str, program: str, kind: str, told: Callable[[int, int], None] = lambda done, of: None
) -> tuple[Any, list[str]]:
    """What a reader finds in a file, and what is to be said of it.

    Args:
        told: how much is done, and of how much.

    Raises:
        ValueError: a file that is too large or broken.
        OSError: the file cannot be read.
    """
    check_size(path)
    answer = _answer(path, reader, program, kind, told)
    if "error" in answer:
        raise ValueError(f"{path}: {answer['error']}")
    return answer["found"], answer["said"]


def _answer(path: Path, reader: str, program: str, kind: str, told: Callable[[int, int], None]) -> dict[str, Any]:
    """What a reader says of a file (`reader_process.py`)."""
    script = Path(__file__).with_name("reader_process.py")
    command = [sys.executable, "-P", str(script), reader, str(path.resolve())]
    patience = SECONDS + SECONDS_PER_MEGABYTE * path.stat().st_size / 1e6
    late = threading.Event()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, encoding="utf-8") as process:

        def end() -> None:
            late.set()
            process.kill()

        timer = threading.Timer(patience, end)
        timer.start()
        try:
            answer: dict[str, Any] = {}
            for line in process.stdout or ():
                answer = json.loads(line)
                if "done" in answer:
                    told(answer["done"], answer["of"])
        except ValueError:
            answer = {}
        finally:
            timer.cancel()
            process.kill()
    if late.is_set():
        raise ValueError(f"{path}: {program} has not read this {kind} file in {patience:.0f} s")
    if not {"found", "error"} & answer.keys():
        raise ValueError(f"{path}: {program} failed on this {kind} file (exit code {process.returncode})")
    return answer


def nurbs_sketch(path: Path, reader: str, program: str, kind: str) -> Sketch:
    """The strokes of a file whose reader gives NURBS curves: a stroke is one of these, or several that meet.

    Raises:
        ValueError, OSError: as `strokes_apart`; a degree above 3, or what is no curve.
    """
    strokes = []
    read = strokes_apart(path, reader, program, kind)
    spaces = {found.get("width", {}).get("space") for found in read}
    # Widths are read where a file says of all of its curves what they are.
    space = spaces.pop() if len(spaces) == 1 else None
    for i, found in enumerate(read):
        try:
            for segments in _joined(found["curves"], found["scale"]):
                # One segment that ends where it begins stays open.
                closed = len(segments) > 1 and meet(segments[-1], segments[0]) and found.get("closed") is not False
                width = _width(found["width"]["values"], segments) if space else DEFAULT_WIDTH
                strokes.append(ReadStroke(segments, closed, found["color"], width, found.get("opacity", 1.0)))
        except (TypeError, ValueError) as error:
            raise ValueError(f"{path}: curve {i}: {error}") from error
    try:
        return sketch_of(strokes, space or "image")
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _width(values: list[float], segments: list[Segment]) -> float | list[list[float]]:
    """One width, or for each segment those of its control points; the last one is the first of the next segment."""
    if len(values) == 1:
        return values[0]
    degree = len(segments[0][1]) - 1
    if len(values) != degree * len(segments) + 1:
        raise ValueError(f"{len(values)} widths for {len(segments)} segments of degree {degree}")
    return [values[i * degree : (i + 1) * degree + 1] for i in range(len(segments))]


def _joined(curves: list[dict[str, Any]], scale: float) -> list[list[Segment]]:
    """Segments of NURBS curves, in a list for each run that goes on without a gap."""
    runs: list[list[Segment]] = []
    for curve in curves:
        points, weights, knots = (
            torch.tensor(curve[key], dtype=torch.float64) for key in ("points", "weights", "knots")
        )
        degree = len(knots) - len(points) - 1
        if degree > MAX_DEGREE:
            raise ValueError(f"of degree {degree}, and only up to {MAX_DEGREE} is read: rebuild it as a cubic")
        bezier = _within(
            *from_nurbs(points * scale, weights, knots), knots[degree : len(points) + 1], curve.get("range")
        )
        segments: list[Segment] = list(zip(*(part.tolist() for part in bezier), strict=True))
        # Programs give some curves the other way round, such as arcs that they draw counter-clockwise.
        if runs and not meet(runs[-1][-1], segments[0]):
            back = _reversed(segments)
            if curve is curves[1] and not meet(runs[-1][-1], back[0]):
                first = _reversed(runs[-1])
                runs[-1] = first if meet(first[-1], segments[0]) or meet(first[-1], back[0]) else runs[-1]
            segments = back if meet(runs[-1][-1], back[0]) else segments
        if runs and meet(runs[-1][-1], segments[0]):
            runs[-1] += segments
        else:
            runs.append(segments)
    return runs


def _within(points: Tensor, weights: Tensor, knots: Tensor, reach: list[float] | None) -> tuple[Tensor, Tensor]:
    """The parts of segments between two parameters; by default all of them.

    Raises:
        ValueError: there is nothing between.
    """
    start, stop = knots[:-1][knots[1:] > knots[:-1]], knots[1:][knots[1:] > knots[:-1]]
    if reach is None or (reach[0] <= knots[0] and reach[1] >= knots[-1]):
        return points, weights
    some = (start < reach[1]) & (stop > reach[0])
    if not bool(some.any()):
        raise ValueError(f"nothing of it lies in its range {reach[0]:g} to {reach[1]:g}")
    start, stop = start[some], stop[some]
    ends = ((t.clamp(*reach) - start) / (stop - start) for t in (start, stop))
    return subcurve(points[some], weights[some], *ends)


def _reversed(segments: list[Segment]) -> list[Segment]:
    """The same curve from its end to its start."""
    return [(points[::-1], weights[::-1]) for points, weights in reversed(segments)]


def meet(before: Segment, after: Segment) -> bool:
    """Whether a segment begins where another ends."""
    a, b = before[0], after[0]
    size = max(math.dist(a[0], p) for p in a[1:]) + max(math.dist(b[0], p) for p in b[1:])
    return math.dist(a[-1], b[0]) <= JOINT * size
