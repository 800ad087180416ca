"""sketch.json: the lossless, versioned file of a sketch.

An object with these keys, for N strokes of M segments with K control points each:

* `version`: 1; 2 where a stroke has several segments or is closed, or widths change along strokes.
* `dtype`: of the numbers, "float32" (the default) or "float64", "float16", "bfloat16".
* `width_space`: "image" or "world".
* `points` (M, K, 3), `weights` (M, K), `width` (N) or (M, K), `color` (N, 3), `opacity` (N): nested lists, as in
  `Sketch`.
* `segments`: how many each stroke has, in order, and `closed`: whether each ends where it begins (N); both are left out
  where all strokes are one open segment.
* `fixed`: whether each stroke is marked to stay as it is (N); left out where none is.
* `names`: what each stroke is called, such as the edge of a solid that it draws (N); left out where none has a name.
* `kinds`: what each stroke is, such as "crease" or "contour" (N); left out where it is not known.
* `importance`: how much of what the sketch draws each stroke adds to more important ones, a share of it all (N); left
  out where it is not known. The strokes of runs are sorted by it.

Numbers are written with as many digits as it takes to read the same bits again. Other keys are ignored.
"""

import json
import reprlib
import sys
from pathlib import Path
from typing import Any, get_args

import torch

from diff3ds._files import parse_json, read_json, write_text
from diff3ds._shapes import Tensor
from diff3ds.chains import Chains
from diff3ds.sketch import BESIDE, Sketch, WidthSpace

VERSION, VERSION_OF_CHAINS = 1, 2
TOLD = {bool: "true or false", str: "texts"}
_DTYPES = {"float16": torch.float16, "bfloat16": torch.bfloat16, "float32": torch.float32, "float64": torch.float64}


def save_json(path: str | Path, sketch: Sketch) -> None:
    """Writes a sketch.json, whole or not at all.

    Raises:
        ValueError: values that have become invalid since the sketch was made.
        OSError: the file cannot be written.
    """
    write_text(Path(path), json_text(sketch))


def json_text(sketch: Sketch) -> str:
    """The text of a sketch.json.

    Raises:
        ValueError: values that have become invalid since the sketch was made.
    """
    sketch.check_values()
    values: dict[str, Any] = {
        "version": VERSION if sketch.chains is None and sketch.width.ndim == 1 else VERSION_OF_CHAINS,
        "dtype": str(sketch.points.dtype).removeprefix("torch."),
        "width_space": sketch.width_space,
    }
    if sketch.chains is not None:
        values |= {"segments": sketch.chains.counts.tolist(), "closed": sketch.chains.closed.tolist()}
    values |= {name: value.detach().double().tolist() for name, value in sketch.tensors().items()}
    for key in BESIDE:
        value = getattr(sketch, key)
        if value is not None and any(value):
            values[key] = value.tolist() if isinstance(value, Tensor) else value
    lines = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in values.items()]
    return "{\n" + ",\n".join(lines) + "\n}\n"


def load_json(path: str | Path) -> Sketch:
    """Reads a sketch.json; the sketch is on the CPU. A sketch without strokes comes back as one of cubics.

    Raises:
        ValueError: larger than 256 MiB, not JSON, an unknown version, a missing key, a wrong shape or value; the
            message names the key and the stroke.
        OSError: the file cannot be read.
    """
    path = Path(path)
    return _sketch_of(read_json(path), path)


def sketch_of_text(text: str, path: Path) -> Sketch:
    """The sketch in the text of a sketch.json.

    Args:
        text: of the file.
        path: of it, for messages.

    Raises:
        ValueError: as `load_json`.
    """
    return _sketch_of(parse_json(text, path), path)


def _sketch_of(data: Any, path: Path) -> Sketch:
    if not isinstance(data, dict) or "version" not in data:
        raise ValueError(f"{path}: not a sketch.json: expected an object with the key 'version'")
    if data["version"] not in (VERSION, VERSION_OF_CHAINS):
        known = f"{VERSION} or {VERSION_OF_CHAINS}"
        raise ValueError(f"{path}: version must be {known}, got {data['version']!r}: a newer diff3ds may read it")
    name = data.get("dtype", "float32")
    if not isinstance(name, str) or name not in _DTYPES:
        raise ValueError(f"{path}: dtype must be one of {', '.join(_DTYPES)}, got {name!r}")
    space: Any = data.get("width_space")
    if space not in get_args(WidthSpace):
        raise ValueError(f'{path}: width_space must be "image" or "world", got {space!r}')
    controls = _control_points(path, data)
    segments = len(data["points"])
    chains = _chains(path, data, segments) if "segments" in data else None
    strokes = segments if chains is None else len(chains)
    width = data.get("width")
    along = isinstance(width, list) and len(width) > 0 and isinstance(width[0], list)
    shapes: dict[str, tuple[int, tuple[int, ...]]] = {
        "points": (segments, (controls, 3)),
        "weights": (segments, (controls,)),
        "width": (segments, (controls,)) if along else (strokes, ()),
        "color": (strokes, (3,)),
        "opacity": (strokes, ()),
    }
    given: dict[str, Any] = {key: _numbers(path, data, key, *shape).to(_DTYPES[name]) for key, shape in shapes.items()}
    for key, kind in BESIDE.items():
        if key in data:
            given[key] = _beside(path, data, key, strokes, kind, _DTYPES[name])
    try:
        return Sketch(**given, width_space=space, chains=chains)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path}: {error}") from error


def _chains(path: Path, data: dict[str, Any], segments: int) -> Chains:
    """Which segments make which stroke."""
    counts = data["segments"]
    if not isinstance(counts, list) or not all(type(count) is int and count > 0 for count in counts):
        raise ValueError(f"{path}: segments must be a list of whole numbers, at least 1, got {reprlib.repr(counts)}")
    if sum(counts) != segments:
        raise ValueError(f"{path}: segments must add up to the {segments} items of points, got {sum(counts)}")
    return Chains.of(counts, _each(path, data, "closed", len(counts), bool))


def _beside(path: Path, data: dict[str, Any], key: str, count: int, kind: type, dtype: torch.dtype) -> Any:
    """The value of a key that has one thing of a kind for each stroke, as a sketch is given it."""
    if kind is float:
        return _numbers(path, data, key, count, ()).to(dtype)
    values = _each(path, data, key, count, kind)
    return torch.tensor(values, dtype=torch.bool) if kind is bool else values


def _each(path: Path, data: dict[str, Any], key: str, count: int, kind: type) -> list[Any]:
    """The value of a key that has one thing of a kind, a bool or a string, for each stroke."""
    values = data.get(key)
    if not isinstance(values, list) or len(values) != count or not all(type(value) is kind for value in values):
        raise ValueError(f"{path}: {key} must be a list of {TOLD[kind]}, {count}, got {reprlib.repr(values)}")
    return values


def _control_points(path: Path, data: dict[str, Any]) -> int:
    """K, from the first segment."""
    points = data.get("points")
    if not isinstance(points, list):
        raise ValueError(f"{path}: points must be a list with one item a stroke, got {reprlib.repr(points)}")
    if not points:
        return 4
    if not isinstance(points[0], list) or len(points[0]) not in (2, 3, 4):
        raise ValueError(f"{path}: points of stroke 0 must be 2, 3 or 4 points, got {reprlib.repr(points[0])}")
    return len(points[0])


def _numbers(path: Path, data: dict[str, Any], key: str, count: int, shape: tuple[int, ...]) -> Tensor:
    """The value of a key as a float64 tensor (count, *shape)."""
    rows = data.get(key)
    if not isinstance(rows, list) or len(rows) != count:
        got = f"{len(rows)} items" if isinstance(rows, list) else reprlib.repr(rows)
        raise ValueError(f"{path}: {key} must be a list with one item a stroke, {count}, got {got}")
    for stroke, row in enumerate(rows):
        if not _fits(row, shape):
            expected = f"{' x '.join(map(str, shape))} finite numbers" if shape else "a finite number"
            raise ValueError(f"{path}: {key} of stroke {stroke} must be {expected}, got {reprlib.repr(row)}")
    return torch.tensor(rows, dtype=torch.float64).reshape(count, *shape)


def _fits(value: object, shape: tuple[int, ...]) -> bool:
    """Whether a value is a nested list of finite numbers of this shape."""
    if shape:
        return isinstance(value, list) and len(value) == shape[0] and all(_fits(v, shape[1:]) for v in value)
    return type(value) in (int, float) and abs(value) <= sys.float_info.max  # type: ignore[arg-type]
