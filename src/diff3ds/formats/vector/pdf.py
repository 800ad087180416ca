"""PDF files: views of a sketch as the vector paths that SVG files have, by an own small writer (ISO 32000-1)."""

import re
import zlib
from codecs import BOM_UTF16_BE
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from diff3ds._files import write_bytes
from diff3ds.camera import Cameras
from diff3ds.formats.vector.page_layers import Layers, check_layers, check_pen, layered
from diff3ds.formats.vector.svg import Background, ground_of
from diff3ds.page.drawn_paths import TOLERANCE, DrawnPath, drawn_paths
from diff3ds.page.pens.pen_paths import Travel, travel
from diff3ds.page.stroke_outlines import straight
from diff3ds.page.views_grid import check_page, corner, page_size
from diff3ds.sketch import Sketch
from diff3ds.svg.layer_groups import Group, outermost

# Points of 1/72 inch, in which PDF measures: of a millimetre, and of a pixel of which 96 make an inch, as on the web.
POINTS_PER_MM, POINTS_PER_PIXEL = 72 / 25.4, 72 / 96


def save_pdf(
    path: str | Path,
    sketch: Sketch,
    cameras: Cameras,
    *,
    background: Background = "auto",
    width_mm: float | None = None,
    layers: Layers | Sequence[str | Group] | None = None,
    centerline: bool = False,
    pen_mm: float | None = None,
    tolerance: float = TOLERANCE,
) -> Travel | None:
    """Writes the views of all cameras on one page, as `save_svg` does and with the same paths; whole or not at all.

    Layers are optional content, which viewers can switch off. The same sketch gives the same file.

    Args:
        background: RGB in [0, 1], or None for none; by default as of `save_svg`.
        width_mm: of the page, millimetres; without it a pixel is 1/96 inch.
        layers: as of `save_svg`.
        centerline: for plotters, as in `save_svg`.
        pen_mm: the same.
        tolerance: pixels.

    Returns:
        As `save_svg`.

    Raises:
        ValueError: as `save_svg`.
        OSError: the file cannot be written.
    """
    background = ground_of(background, centerline)
    sketch = check_page(sketch, cameras, background, width_mm, tolerance)
    width, height = page_size(cameras)
    scale = POINTS_PER_PIXEL if width_mm is None else POINTS_PER_MM * width_mm / width
    # From pixels with y down to points with y up.
    written = _Written([f"{_numbers(scale, 0, 0, -scale, 0, height * scale)} cm 1 J 1 j"], [], [])
    if background is not None:
        written.content.append(f"{_numbers(*np.clip(background, 0, 1))} rg 0 0 {width} {height} re f")
    check_layers(layers, len(sketch))
    check_pen(pen_mm, centerline, width_mm)
    mm = 1.0 if width_mm is None else width_mm / width
    order: list[Any] = []
    drawn: list[list[DrawnPath]] = []
    for view in range(len(cameras)):
        x, y = corner(cameras, view)
        written.content.append(
            f"q {_numbers(x, y, cameras.size[1], cameras.size[0])} re W n {_numbers(1, 0, 0, 1, x, y)} cm"
        )
        paths = drawn_paths(sketch, cameras, view, centerline=centerline, tolerance=tolerance)
        groups = layered(paths, layers, centerline, None if pen_mm is None else pen_mm / mm)
        drawn += groups.values()
        order += _layers(groups, f"view-{view}-" if len(cameras) > 1 else "", written)
        written.content.append("Q")
    size = _numbers(width * scale, height * scale)
    write_bytes(Path(path), _file(written, size, order))
    return travel(drawn, mm) if centerline else None


class _Written(NamedTuple):
    """What is written: operators, and the names of layers and the opacities that they speak of by number."""

    content: list[str]
    names: list[str]
    opacities: list[float]


def _layers(groups: dict[Group, list[DrawnPath]], prefix: str, written: _Written) -> list[Any]:
    """Writes layers and those within them; returns their numbers, after each a list of those in it."""
    order: list[Any] = []
    for label, inner in outermost(groups).items():
        if not label:
            written.content.extend(_operators(path, written.opacities) for path in inner[()])
            continue
        order.append(len(written.names))
        written.content.append(f"/OC /L{len(written.names)} BDC")
        written.names.append(prefix + label)
        below = _layers(inner, prefix, written)
        order += [below] if below else []
        written.content.append("EMC")
    return order


def _operators(path: DrawnPath, opacities: list[float]) -> str:
    """What draws a path; its opacity is added to those that the page must know, if it is new."""
    if path.opacity not in opacities:
        opacities.append(path.opacity)
    state = f"/A{opacities.index(path.opacity)} gs {_numbers(*path.color)} {'rg' if path.width is None else 'RG'}"
    state += f" {_numbers(path.width)} w" if path.width is not None else ""
    lines = []
    for curve in path.curves:
        points = [_numbers(*point) for point in curve.tolist()]
        parts = [
            f"{points[3 * i + 3]} l" if line else f"{' '.join(points[3 * i + 1 : 3 * i + 4])} c"
            for i, line in enumerate(straight(curve).tolist())
        ]
        lines.append(" ".join([f"{points[0]} m", *parts, *(["h"] if path.closed else [])]))
    return "\n".join([state, *lines, "f" if path.width is None else "S"])


def _file(written: _Written, size: str, order: list[Any]) -> bytes:
    """A PDF file of one page."""
    groups = range(5, 5 + len(written.names))
    listed = " ".join(f"{number} 0 R" for number in groups)
    states = " ".join(f"/A{i} << /CA {_numbers(a)} /ca {_numbers(a)} >>" for i, a in enumerate(written.opacities))
    properties = " ".join(f"/L{i} {number} 0 R" for i, number in enumerate(groups))
    resources = f"<< /ExtGState << {states} >> /Properties << {properties} >> >>"
    shown = f"<< /Order {_listed(order)} /ON [{listed}] >>"
    optional = f" /OCProperties << /OCGs [{listed}] /D {shown} >>" if written.names else ""
    packed = zlib.compress("\n".join(written.content).encode("ascii"), 9)
    objects = [
        f"<< /Type /Catalog /Pages 2 0 R{optional} >>".encode(),
        b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
        f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {size}] /Contents 4 0 R /Resources {resources} >>".encode(),
        f"<< /Length {len(packed)} /Filter /FlateDecode >>\nstream\n".encode() + packed + b"\nendstream",
        *(f"<< /Type /OCG /Name {_text(name)} >>".encode() for name in written.names),
    ]
    # The second line tells programs that the file is binary.
    file = b"%PDF-1.5\n%\xe2\xe3\xcf\xd3\n"
    places = []
    for number, entry in enumerate(objects, 1):
        places.append(len(file))
        file += f"{number} 0 obj\n".encode() + entry + b"\nendobj\n"
    table = "".join(f"{place:010d} 00000 n \n" for place in places)
    end = f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n{table}"
    end += f"trailer\n<< /Size {len(objects) + 1} /Root 1 0 R >>\nstartxref\n{len(file)}\n%%EOF\n"
    return file + end.encode()


def _listed(order: list[Any]) -> str:
    """Layers and those within them, as PDF lists them."""
    return f"[{' '.join(_listed(entry) if isinstance(entry, list) else f'{entry + 5} 0 R' for entry in order)}]"


def _text(text: str) -> str:
    """A text of any letters."""
    if text.isascii():
        escaped = re.sub(r"([()\\])", r"\\\1", text)
        return f"({escaped})"
    return f"<{(BOM_UTF16_BE + text.encode('utf-16-be')).hex()}>"


def _numbers(*values: float) -> str:
    """PDF has no exponents; four digits are a ten-thousandth of a pixel."""
    return " ".join(f"{value:.4f}".rstrip("0").rstrip(".") or "0" for value in values)
