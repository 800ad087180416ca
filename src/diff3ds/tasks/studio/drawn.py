"""What is drawn on the studio's canvas: as a picture, and what it may show."""

import base64
import io
import math
from pathlib import Path
from typing import Any

import numpy as np
import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.formats import save_png
from diff3ds.formats.png import as_pillow
from diff3ds.pictures.reference_picture import OBJECT, OF, ReferencePicture
from diff3ds.recognition.picture_lines import lines_of
from diff3ds.recognition.recognise import recognise

# The width of a pen, pixels of a reference picture; the side of the pictures of guesses, pixels.
PEN, SHOWN = 3, 96
# Of strokes and of points of all, more than a hand draws.
MOST_STROKES, MOST_POINTS = 2000, 200_000


def picture_of(strokes: Any) -> Float[Tensor, "S S 1"]:
    """Lines that a pen drew, black on white, as large in it as `read_reference` makes things.

    Args:
        strokes: lists of points (x, y), y down, in any unit.

    Raises:
        ValueError: none, too many, or something else.
    """
    from PIL import Image, ImageDraw

    lines = _checked(strokes)
    every = np.concatenate(lines)
    low, high = every.min(0), every.max(0)
    scale = (OBJECT - PEN) / max(float((high - low).max()), 1e-9)
    # Twice as large, and reduced: smooth lines.
    image = Image.new("L", (2 * OF, 2 * OF), 255)
    pen = ImageDraw.Draw(image)
    for line in lines:
        places = ((line - (low + high) / 2) * scale + OF / 2) * 2
        pen.line([(float(x), float(y)) for x, y in places], 0, 2 * PEN, "curve")
        for x, y in (places[0], places[-1]):
            pen.ellipse((x - PEN, y - PEN, x + PEN, y + PEN), 0)
    small = np.asarray(image.resize((OF, OF), Image.Resampling.BOX), np.float32) / 255
    return torch.from_numpy(small[..., None].copy())


def as_reference(strokes: Any) -> ReferencePicture:
    """A drawing as ink on nothing: where the paper is need not be found out.

    Raises:
        ValueError: as `picture_of`.
    """
    ink = 1 - picture_of(strokes)
    return ReferencePicture(torch.cat([torch.zeros_like(ink).expand(-1, -1, 3), ink], -1))


def _checked(strokes: Any) -> list[Any]:
    if not isinstance(strokes, list) or not strokes:
        raise ValueError("nothing is drawn yet")
    if len(strokes) > MOST_STROKES or sum(len(s) if isinstance(s, list) else 0 for s in strokes) > MOST_POINTS:
        raise ValueError(f"a drawing has at most {MOST_STROKES} strokes of {MOST_POINTS} points together")
    lines = []
    for stroke in strokes:
        try:
            line = np.asarray(stroke, np.float64)
        except (ValueError, TypeError) as error:
            raise ValueError("a stroke is a list of points, each two numbers") from error
        if line.ndim != 2 or line.shape[1] != 2 or not len(line) or not bool(np.isfinite(line).all()):
            raise ValueError("a stroke is a list of points, each two finite numbers")
        if float(np.abs(line).max()) > 1e6:
            raise ValueError("a point of the drawing is too far away")
        lines.append(line)
    return lines


def guesses_of(strokes: Any) -> dict[str, Any]:
    """What a drawing may show, the likeliest first, each with its `caption`, `sure` and a small `picture`.

    Raises:
        ValueError: as `picture_of`; too little is drawn to tell.
    """
    found = recognise(lines_of(as_reference(strokes)))
    guesses = [
        {"caption": guess.caption, "sure": guess.confidence, "picture": _as_address(guess.picture(SHOWN))}
        for guess in found.guesses
        if math.isfinite(guess.confidence)
    ]
    return {"guesses": guesses, "taken": found.taken}


def _as_address(picture: Float[Tensor, "S S C"]) -> str:
    """A picture as an address that holds it."""
    held = io.BytesIO()
    as_pillow(picture).convert("L").save(held, "PNG")
    return f"data:image/png;base64,{base64.b64encode(held.getvalue()).decode()}"


def save_drawing(path: Path, strokes: Any) -> None:
    """Writes a drawing as a picture.

    Raises:
        ValueError, OSError: as `picture_of`; it cannot be written.
    """
    save_png(path, picture_of(strokes).expand(-1, -1, 3))
