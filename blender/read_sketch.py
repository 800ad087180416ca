# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads sketch.json files: JSON with lists of numbers, every one of which is looked at."""

import json
import math
from pathlib import Path

from .strokes import MOST_BYTES, MOST_STROKES, Stroke, Strokes, raised


def read_sketch(path: str) -> Strokes:
    """Reads a file.

    Raises:
        ValueError: it is larger than 256 MiB, no sketch.json, or has a wrong value; says which.
        OSError: it cannot be read.
    """
    file = Path(path)
    if file.stat().st_size > MOST_BYTES:
        raise ValueError(f"{file.name} is larger than {MOST_BYTES >> 20} MiB")
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{file.name} is not JSON: {error}") from error
    if not isinstance(data, dict) or data.get("version") not in (1, 2):
        raise ValueError(f"{file.name} is no sketch.json of version 1 or 2")
    if data.get("width_space") not in ("image", "world"):
        raise ValueError("width_space must be image or world")
    points = data.get("points")
    if not isinstance(points, list) or len(points) > MOST_STROKES:
        raise ValueError(f"points must be a list of at most {MOST_STROKES} segments")
    controls = len(points[0]) if points and isinstance(points[0], list) else 4
    if controls not in (2, 3, 4):
        raise ValueError(f"a segment must have 2, 3 or 4 points, got {controls}")
    counts = _counts(data, len(points))
    return Strokes(_strokes(data, counts, controls), data["width_space"] == "image")


def _counts(data: dict, segments: int) -> list:
    """How many segments each stroke has."""
    counts = data.get("segments", [1] * segments)
    whole = isinstance(counts, list) and all(type(count) is int and count > 0 for count in counts)
    if not whole or sum(counts) != segments:
        raise ValueError(f"segments must be whole numbers that add up to {segments}")
    return counts


def _strokes(data: dict, counts: list, controls: int) -> list:
    points = _numbers(data, "points", sum(counts), (controls, 3))
    weights = _numbers(data, "weights", sum(counts), (controls,))
    if any(weight <= 0 for row in weights for weight in row):
        raise ValueError("weights must be positive")
    widths = data.get("width")
    along = isinstance(widths, list) and bool(widths) and isinstance(widths[0], list)
    widths = _numbers(data, "width", sum(counts) if along else len(counts), (controls,) if along else ())
    colors = _numbers(data, "color", len(counts), (3,))
    opacities = _numbers(data, "opacity", len(counts), ())
    names, kinds = (_each(data, key, len(counts), str, "") for key in ("names", "kinds"))
    closed = _each(data, "closed", len(counts), bool, False)
    strokes, first = [], 0
    for n, count in enumerate(counts):
        rows = range(first, first + count)
        first += count
        cubics = [raised([(*p, w) for p, w in zip(points[row], weights[row], strict=True)]) for row in rows]
        wide = [_raised_widths(widths[row] if along else [widths[n]] * controls) for row in rows]
        color = tuple(min(max(value, 0.0), 1.0) for value in colors[n])
        opacity = min(max(opacities[n], 0.0), 1.0)
        strokes.append(Stroke(names[n], kinds[n], cubics, wide, color, opacity, closed[n]))
    return strokes


def _raised_widths(widths: list) -> list:
    return [point[0] for point in raised([(max(width, 0.0), 0.0, 0.0, 1.0) for width in widths])]


def _numbers(data: dict, key: str, count: int, shape: tuple) -> list:
    """Nested lists of finite numbers of a shape."""
    rows = data.get(key)
    if not isinstance(rows, list) or len(rows) != count or not all(_fits(row, shape) for row in rows):
        raise ValueError(f"{key} must be {count} items of {shape or 'one'} finite numbers")
    return rows


def _fits(value: object, shape: tuple) -> bool:
    if shape:
        return isinstance(value, list) and len(value) == shape[0] and all(_fits(each, shape[1:]) for each in value)
    return type(value) in (int, float) and abs(value) < 1e30 and math.isfinite(value)


def _each(data: dict, key: str, count: int, kind: type, missing: object) -> list:
    """One thing of a kind for each stroke."""
    values = data.get(key, [missing] * count)
    if not isinstance(values, list) or len(values) != count or not all(type(value) is kind for value in values):
        raise ValueError(f"{key} must be {count} items of {kind.__name__}")
    return values
