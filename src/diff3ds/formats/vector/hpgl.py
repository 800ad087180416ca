"""HPGL files for plotters: views on a page as the paths of pens, in steps of a fortieth of a millimetre."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from diff3ds._files import write_text
from diff3ds._shapes import Index, Int
from diff3ds.bezier import tessellate
from diff3ds.camera import Cameras
from diff3ds.formats.vector.page_layers import Layers, PathOptions, layered_page
from diff3ds.page.drawn_paths import TOLERANCE
from diff3ds.page.pens.pen_paths import Travel
from diff3ds.page.sheet.page_setup import PageSetup
from diff3ds.page.stroke_outlines import Path as Curve
from diff3ds.sketch import Sketch
from diff3ds.svg.layer_groups import Group

# Steps of plotters to a millimetre (HP 7475A), and how far lines may be off the curves, steps: as far as rounding.
STEPS, OFF = 40.0, 0.5


def save_hpgl(
    path: str | Path,
    sketch: Sketch | Sequence[Sketch],
    cameras: Cameras,
    page: PageSetup,
    *,
    layers: Layers | Sequence[str | Group] | Sequence[Sequence[str | Group]] | None = None,
    pen_mm: float | None = None,
    tolerance: float = TOLERANCE,
) -> Travel | None:
    """Writes the views of all cameras as lines of pens, joined and in an order of short ways; whole or not at all.

    Each layer, by default one a colour, has a pen of its own: 1, 2 and so on, by the first of each. The origin is the
    lower left corner of the page.

    Args:
        sketch: one for all views, or one a view.
        cameras: the views.
        page: that they lie on.
        layers: as of `save_svg`.
        pen_mm: the same.
        tolerance: the same.

    Returns:
        What the pens travel, millimetres.

    Raises:
        ValueError: as `save_svg`.
        OSError: the file cannot be written.
    """
    how = PathOptions(layers, True, pen_mm, tolerance)
    layout, views, travelled = layered_page(sketch, cameras, None, page, how)
    scale = STEPS / layout.per_mm
    pens: dict[Group, list[str]] = {}
    for corner, groups in zip(layout.corners, views, strict=True):
        for group, paths in groups.items():
            lines = pens.setdefault(group, [])
            for drawn in paths:
                for curve in drawn.curves:
                    x, y = ((curve + np.array(corner)) * scale).T
                    lines.append(_line(np.stack([x, layout.size[1] * scale - y], 1)))
    blocks = [f"SP{number};\n" + "\n".join(lines) for number, lines in enumerate(pens.values(), 1)]
    write_text(Path(path), "\n".join(["IN;", *blocks, "SP0;"]) + "\n")
    return travelled


def _line(curve: Curve) -> str:
    """The pen goes up to the start of cubics, then along them."""
    cubics = torch.from_numpy(curve[3 * np.arange(len(curve) // 3)[:, None] + np.arange(4)])
    chords = [vertices[1:].numpy() for _, vertices in tessellate(cubics, None, OFF)]
    places: Int[Index, "M 2"] = np.rint(np.concatenate([curve[:1], *chords])).astype(np.int64)
    moved = np.flatnonzero(np.append(True, (np.diff(places, axis=0) != 0).any(1)))
    start, *then = (f"{x},{y}" for x, y in places[moved].tolist())
    return f"PU{start};PD{','.join(then or [start])};PU;"
