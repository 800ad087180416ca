"""PDF files: views of a sketch as the vector paths that SVG files have, by an own small writer (ISO 32000-1)."""

import re
import zlib
from codecs import BOM_UTF16_BE
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from diff3ds._files import write_bytes
from diff3ds.camera import Cameras
from diff3ds.formats.vector.page_layers import Layers, PathOptions, layered_page
from diff3ds.formats.vector.svg import Background, ground_of
from diff3ds.page.drawn_paths import TOLERANCE, DrawnPath
from diff3ds.page.pens.pen_paths import Travel
from diff3ds.page.sheet.page_layout import Layout
from diff3ds.page.sheet.page_setup import PageSetup
from diff3ds.page.stroke_outlines import straight
from diff3ds.sketch import Sketch
from diff3ds.svg.layer_groups import Group, outermost

# Points of 1/72 inch, in which PDF measures.
POINTS_PER_MM = 72 / 25.4


def save_pdf(
    path: str | Path,
    sketch: Sketch | Sequence[Sketch],
    cameras: Cameras,
    *,
    background: Background = "auto",
    page: PageSetup | None = None,
    alone: bool = False,
    layers: Layers | Sequence[str | Group] | Sequence[Sequence[str | Group]] | None = None,
    centerline: bool = False,
    pen_mm: float | None = None,
    tolerance: float = TOLERANCE,
) -> Travel | None:
    """Writes the views of all cameras as `save_svg` does and with the same paths; whole or not at all.

    Layers are optional content, which viewers can switch off. The same sketch gives the same file.

    Args:
        sketch: one for all views, or one a view.
        background: RGB in [0, 1], or None for none; by default as of `save_svg`.
        page: as of `save_svg`; without it a pixel is 1/96 inch.
        alone: whether each view has a page of its own.
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
    how = PathOptions(layers, centerline, pen_mm, tolerance)
    layout, views, travelled = layered_page(sketch, cameras, background, page, how, alone)
    write_bytes(Path(path), pdf_of(layout, views, background, alone=alone))
    return travelled


def pdf_of(
    layout: Layout,
    views: Sequence[Mapping[Group, list[DrawnPath]]],
    background: Sequence[float] | None,
    *,
    alone: bool = False,
    ground: Sequence[DrawnPath] = (),
) -> bytes:
    """A PDF file of views.

    Args:
        layout: where they lie.
        views: the paths of each in layers.
        background: RGB of the page, or None.
        alone: whether each view has a page of its own.
        ground: what lies on each page below the views, in its pixels.
    """
    scale = POINTS_PER_MM / layout.per_mm
    width, height = layout.size
    written = _Written([], [], [])
    # From pixels with y down to points with y up; of the scale more digits, since pages have thousands of pixels.
    below = [f"{scale:.10g} 0 0 {-scale:.10g} 0 {_numbers(height * scale)} cm 1 J 1 j"]
    if background is not None:
        below.append(f"{_numbers(*np.clip(background, 0, 1))} rg 0 0 {_numbers(width, height)} re f")
    below += [_operators(path, written.paints) for path in ground]
    order: list[Any] = []
    pages: list[list[str]] = []
    for view, groups in enumerate(views):
        if alone or not pages:
            pages.append(list(below))
        (x, y), (high, wide) = layout.corners[view], layout.cameras.size
        written.content.append(f"q {_numbers(x, y, wide, high)} re W n {_numbers(1, 0, 0, 1, x, y)} cm")
        order += _layers(groups, f"view-{view}-" if len(views) > 1 else "", written)
        pages[-1] += [*written.content, "Q"]
        written.content.clear()
    contents = ["\n".join(page).encode("ascii") for page in pages]
    return _file(contents, written, _numbers(width * scale, height * scale), order)


class _Written(NamedTuple):
    """What is written: operators, and what they speak of by number.

    Attributes:
        content: operators.
        names: of layers.
        paints: opacities, and whether colours are multiplied.
    """

    content: list[str]
    names: list[str]
    paints: list[tuple[float, bool]]


def _layers(groups: Mapping[Group, list[DrawnPath]], prefix: str, written: _Written) -> list[Any]:
    """Writes layers and those within them; returns their numbers, after each a list of those in it."""
    order: list[Any] = []
    for label, inner in outermost(groups).items():
        if not label:
            written.content.extend(_operators(path, written.paints) for path in inner[()])
            continue
        order.append(len(written.names))
        written.content.append(f"/OC /L{len(written.names)} BDC")
        written.names.append(prefix + label)
        below = _layers(inner, prefix, written)
        order += [below] if below else []
        written.content.append("EMC")
    return order


def _operators(path: DrawnPath, paints: list[tuple[float, bool]]) -> str:
    """What draws a path; its opacity is added to those that the page must know, if it is new."""
    paint = path.opacity, path.multiplied
    if paint not in paints:
        paints.append(paint)
    state = f"/A{paints.index(paint)} gs {_numbers(*path.color)} {'rg' if path.width is None else 'RG'}"
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


def _file(contents: Sequence[bytes], written: _Written, size: str, order: list[Any]) -> bytes:
    """A PDF file with a page for each of the contents."""
    # Numbers of objects: the catalogue, the list of pages, each page before its content, then the layers.
    first = 3 + 2 * len(contents)
    groups = range(first, first + len(written.names))
    listed = " ".join(f"{number} 0 R" for number in groups)
    blend = ("", " /BM /Multiply")
    states = " ".join(
        f"/A{i} << /CA {_numbers(opacity)} /ca {_numbers(opacity)}{blend[multiplied]} >>"
        for i, (opacity, multiplied) in enumerate(written.paints)
    )
    properties = " ".join(f"/L{i} {number} 0 R" for i, number in enumerate(groups))
    resources = f"<< /ExtGState << {states} >> /Properties << {properties} >> >>"
    shown = f"<< /Order {_listed(order, first)} /ON [{listed}] >>"
    optional = f" /OCProperties << /OCGs [{listed}] /D {shown} >>" if written.names else ""
    pages = range(3, first, 2)
    kids = " ".join(f"{number} 0 R" for number in pages)
    objects = [
        f"<< /Type /Catalog /Pages 2 0 R{optional} >>".encode(),
        f"<< /Type /Pages /Kids [{kids}] /Count {len(contents)} >>".encode(),
    ]
    for number, content in zip(pages, contents, strict=True):
        packed = zlib.compress(content, 9)
        page = f"/MediaBox [0 0 {size}] /Contents {number + 1} 0 R /Resources {resources}"
        objects.append(f"<< /Type /Page /Parent 2 0 R {page} >>".encode())
        head = f"<< /Length {len(packed)} /Filter /FlateDecode >>\nstream\n".encode()
        objects.append(head + packed + b"\nendstream")
    objects += [f"<< /Type /OCG /Name {_text(name)} >>".encode() for name in written.names]
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


def _listed(order: list[Any], first: int) -> str:
    """Layers and those within them, as PDF lists them, where the object of the first has this number."""
    entries = (_listed(entry, first) if isinstance(entry, list) else f"{first + entry} 0 R" for entry in order)
    return f"[{' '.join(entries)}]"


def _text(text: str) -> str:
    """A text of any letters."""
    if text.isascii():
        escaped = re.sub(r"([()\\])", r"\\\1", text)
        return f"({escaped})"
    return f"<{(BOM_UTF16_BE + text.encode('utf-16-be')).hex()}>"


def _numbers(*values: float) -> str:
    """PDF has no exponents; four digits are a ten-thousandth of a pixel."""
    return " ".join(f"{value:.4f}".rstrip("0").rstrip(".") or "0" for value in values)
