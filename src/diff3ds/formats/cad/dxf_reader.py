"""The curves of a DXF file as NURBS, by ezdxf; `reader_process.py` runs it."""

from collections.abc import Iterator
from typing import Any

import ezdxf
from ezdxf import recover
from ezdxf.colors import aci2rgb, int2rgb
from ezdxf.math import ConstructionEllipse, rational_bspline_from_ellipse

APPLICATION = "DIFF3DS"
# Of $INSUNITS.
MILLIMETRES = {1: 25.4, 2: 304.8, 4: 1.0, 5: 10.0, 6: 1000.0}
# Entities, with those of blocks in blocks: more is taken for an attack, which needs few bytes to ask for many.
MOST = 1_000_000
DEPTH = 16
# The colour that AutoCAD shows black on white.
BLACK_OR_WHITE = 7


def strokes_of(path: str) -> list[dict[str, Any]]:
    """All curves of the model space; those that we wrote of one stroke after each other are one.

    Each has NURBS curves with points, weights and knots, its colour (sRGB, in [0, 1]), and the millimetres of a unit.
    """
    try:
        document = ezdxf.readfile(path)
    except ezdxf.DXFStructureError:
        # What other programs write is often broken a little.
        document, _ = recover.readfile(path)
    except UnicodeDecodeError as error:
        raise ValueError("not a DXF file: it is neither text nor binary DXF") from error
    except OSError as error:
        raise ValueError(f"not a DXF file: {error}") from error
    unit = MILLIMETRES.get(document.header.get("$INSUNITS", 0), 1.0)
    strokes: list[dict[str, Any]] = []
    last: int | None = None
    for count, entity in enumerate(_entities(document.modelspace(), 0)):
        if count >= MOST:
            raise ValueError(f"more than {MOST} entities in this DXF file")
        curve = _curve(entity)
        if curve is None:
            continue
        number = _number(entity)
        if strokes and number is not None and number == last:
            strokes[-1]["curves"].append(curve)
        else:
            strokes.append({"curves": [curve], "color": _color(document, entity), "scale": unit})
        last = number
    return strokes


def _entities(space: Any, depth: int) -> Iterator[Any]:
    """Entities, with polylines as lines and arcs, and with what is in blocks."""
    for entity in space:
        kind = entity.dxftype()
        if kind in ("LWPOLYLINE", "POLYLINE"):
            yield from entity.virtual_entities()
        elif kind == "INSERT":
            if depth >= DEPTH:
                raise ValueError(f"blocks more than {DEPTH} deep in this DXF file")
            yield from _entities(entity.virtual_entities(), depth + 1)
        else:
            yield entity


def _curve(entity: Any) -> dict[str, Any] | None:
    kind, dxf = entity.dxftype(), entity.dxf
    if kind == "LINE":
        return {"points": [list(dxf.start), list(dxf.end)], "weights": [1.0, 1.0], "knots": [0.0, 0.0, 1.0, 1.0]}
    if kind == "SPLINE":
        spline = entity.construction_tool()
    elif kind in ("ARC", "CIRCLE", "ELLIPSE"):
        if kind == "ELLIPSE":
            ellipse = entity.construction_tool()
        else:
            ends = (dxf.start_angle, dxf.end_angle) if kind == "ARC" else (0.0, 360.0)
            # The centre is in the frame of the normal, as the entity has it.
            ellipse = ConstructionEllipse.from_arc(dxf.center, abs(dxf.radius), dxf.extrusion, *ends)
        spline = rational_bspline_from_ellipse(ellipse)
    else:
        return None
    weights = [float(w) for w in spline.weights()] or [1.0] * len(spline.control_points)
    return {"points": [list(p) for p in spline.control_points], "weights": weights, "knots": list(spline.knots())}


def _number(entity: Any) -> int | None:
    """Of the stroke, in files of ours."""
    if not entity.has_xdata(APPLICATION):
        return None
    return next((int(tag.value) for tag in entity.get_xdata(APPLICATION) if tag.code == 1071), None)


def _color(document: Any, entity: Any) -> tuple[float, float, float]:
    dxf = entity.dxf
    layer = document.layers.get(dxf.layer) if dxf.layer in document.layers else None
    by_layer = dxf.get("color", 256) == 256 and not dxf.hasattr("true_color")
    source = layer.dxf if by_layer and layer is not None else dxf
    if source.hasattr("true_color"):
        rgb = int2rgb(source.true_color)
    else:
        index = abs(source.get("color", BLACK_OR_WHITE))
        rgb = (0, 0, 0) if index == BLACK_OR_WHITE or not 0 < index < 256 else aci2rgb(index)
    r, g, b = (channel / 255 for channel in rgb)
    return r, g, b
