"""Pages as independent readers measure them: size and box of the ink, millimetres from the upper left corner."""

import ctypes

import numpy as np
from PIL import Image


def svg_page(file):
    """By svgelements: ((width, height), (x0, y0, x1, y1)), the ink with its widths, but for the ground."""
    import svgelements

    page, mm = _svg(file)
    boxes = [e.bbox(with_stroke=True) for e in page.elements() if isinstance(e, svgelements.Path) and len(e)]
    return (page.width / mm, page.height / mm), around(np.array(boxes) / mm)


def svg_layer(file, name):
    """By svgelements: the ends (n, 2) of the lines and cubics of a group, and their length, millimetres."""
    from svgelements import Group, Move, Path

    page, mm = _svg(file)
    group = next(e for e in page.elements() if isinstance(e, Group) and e.id == name)
    drawn = [part for path in group if isinstance(path, Path) for part in path if not isinstance(part, Move)]
    ends = [(point.x, point.y) for part in drawn for point in (part.start, part.end)]
    return np.array(ends) / mm, sum(part.length(error=1e-3) for part in drawn) / mm


def _svg(file):
    """What svgelements reads, and how many of its units are a millimetre."""
    import svgelements

    # A thousandth of a millimetre to a unit: svgelements knows an inch by four digits.
    page = svgelements.SVG.parse(str(file), ppi=25400)
    return page, page.width / float(page.values["width"].removesuffix("mm"))


def pdf_pages(file):
    """By PDFium, its numbers of each page: the same, of stroked paths and outlines with cubics of svgpathtools."""
    import pypdfium2
    from pypdfium2 import raw

    with pypdfium2.PdfDocument(file) as document:
        for page in document:
            width, height = page.get_size()
            boxes = [_pdf_box(thing, raw) for thing in page.get_objects() if thing.type == raw.FPDF_PAGEOBJ_PATH]
            box = np.array([b for b in boxes if b is not None])
            box = np.stack([box[:, 0], height - box[:, 3], box[:, 2], height - box[:, 1]], -1)
            yield (width * 25.4 / 72, height * 25.4 / 72), around(box * 25.4 / 72)


def _pdf_box(thing, raw):
    from svgpathtools import CubicBezier, Line

    matrix = thing.get_matrix()
    points, found, width = [], [], ctypes.c_float(0)
    for k in range(raw.FPDFPath_CountSegments(thing.raw)):
        segment = raw.FPDFPath_GetPathSegment(thing.raw, k)
        x, y = ctypes.c_float(), ctypes.c_float()
        raw.FPDFPathSegment_GetPoint(segment, x, y)
        at = complex(*matrix.on_point(x.value, y.value))
        kind = raw.FPDFPathSegment_GetType(segment)
        if kind == raw.FPDF_SEGMENT_MOVETO:
            points = [at]
        elif kind == raw.FPDF_SEGMENT_LINETO:
            found.append(Line(points[-1], at).bbox())
            points = [at]
        else:
            points.append(at)
            if len(points) == 4:
                found.append(CubicBezier(*points).bbox())
                points = [at]
    fill, stroke = ctypes.c_int(), ctypes.c_int()
    raw.FPDFPath_GetDrawMode(thing.raw, fill, stroke)
    if stroke.value:
        raw.FPDFPageObj_GetStrokeWidth(thing.raw, width)
    if not found:
        return None
    box, reach = np.array(found), width.value * abs(matrix.a) / 2
    return box[:, 0].min() - reach, box[:, 2].min() - reach, box[:, 1].max() + reach, box[:, 3].max() + reach


def png_page(file):
    """By Pillow: the same, of pixels that are not white."""
    with Image.open(file) as picture:
        ink = np.asarray(picture.convert("RGB")).min(2) < 128
        mm = picture.info["dpi"][0] / 25.4
        rows, columns = np.flatnonzero(ink.any(1)), np.flatnonzero(ink.any(0))
        size = picture.width / mm, picture.height / mm
    return size, np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1]) / mm


def around(boxes):
    return np.concatenate([boxes[:, :2].min(0), boxes[:, 2:].max(0)])
