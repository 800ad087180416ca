"""The curves of a DXF file as NURBS, by ezdxf; `reader_process.py` runs it."""

from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import ezdxf
from ezdxf import recover
from ezdxf.colors import aci2rgb, int2rgb
from ezdxf.math import ConstructionEllipse, Matrix44, rational_bspline_from_ellipse
from ezdxf.xclip import XClip

APPLICATION = "DIFF3DS"
# Of $INSUNITS; those of surveys are a share of 1200 / 3937 m.
MILLIMETRES = {1: 25.4, 2: 304.8, 3: 1609344.0, 4: 1.0, 5: 10.0, 6: 1000.0, 7: 1e6, 8: 25.4e-6, 9: 25.4e-3, 10: 914.4}
MILLIMETRES |= {11: 1e-7, 12: 1e-6, 13: 1e-3, 14: 100.0, 15: 1e4, 16: 1e5, 17: 1e12}
MILLIMETRES |= {21: 1.2e6 / 3937, 22: 1e5 / 3937, 23: 3.6e6 / 3937, 24: 5280 * 1.2e6 / 3937}
# Entities, with those of blocks in blocks: more is taken for an attack, which needs few bytes to ask for many.
MOST = 1_000_000
DEPTH = 16
# The colour that AutoCAD shows black on white.
BLACK_OR_WHITE = 7
BY_BLOCK, BY_LAYER = 0, 256
# Of a vertex of a polyline through which a spline was fitted: it is what the spline was made from, and not drawn.
FRAME = 16
# What is no drawing of its own.
SILENT = ("VIEWPORT", "ATTDEF", "SEQEND")

Rgb = tuple[float, float, float]


class Place(NamedTuple):
    """Where entities are: how deep in blocks, and what of their reference they take over."""

    matrix: Any = None
    layer: str = "0"
    color: Rgb = (0.0, 0.0, 0.0)
    depth: int = 0


def found_in(path: str, told: Callable[[int, int], None]) -> tuple[list[dict[str, Any]], list[str]]:
    """All curves that the model space shows, those that we wrote of one stroke after each other as one; what is said.

    Each has NURBS curves with points, weights and knots, its colour (sRGB, in [0, 1]), and the millimetres of a unit.
    """
    reader = Reader(_document(path))
    strokes: list[dict[str, Any]] = []
    last: int | None = None
    for curves, number, color in reader.read(reader.document.modelspace(), Place()):
        if strokes and number is not None and number == last:
            strokes[-1]["curves"] += curves
        elif number is not None:
            strokes.append({"curves": curves, "color": color, "scale": reader.unit})
        else:
            strokes += [{"curves": [curve], "color": color, "scale": reader.unit} for curve in curves]
        last = number
    return strokes, reader.said()


def _document(path: str) -> Any:
    with open(path, "rb") as file:
        start = file.read(6)
    if start.startswith(b"AC1") and start[3:].isdigit():
        raise ValueError("a DWG file, which is not read: save it as .dxf in the program that made it")
    try:
        return ezdxf.readfile(path)
    except UnicodeDecodeError as error:
        raise ValueError("not a DXF file: it is neither text nor binary DXF") from error
    except OSError as error:
        raise ValueError(f"not a DXF file: {error}") from error
    except (ezdxf.DXFError, ValueError):
        # What other programs write is often broken a little.
        return recover.readfile(path)[0]


class Reader:
    """Reads the entities of a document, and counts what it leaves out.

    Attributes:
        document: as ezdxf has it.
        unit: the millimetres of a unit of length.
    """

    def __init__(self, document: Any) -> None:
        self.document = document
        self._unit = document.header.get("$INSUNITS", 0)
        self.unit = MILLIMETRES.get(self._unit, 1.0)
        self._left_out, self._hidden, self._clipped, self._count = Counter[str](), 0, 0, 0

    def said(self) -> list[str]:
        """What whoever reads the file should know, a line each."""
        lines = []
        layouts = (layout for layout in self.document.layouts if not layout.is_modelspace)
        elsewhere = sum(entity.dxftype() not in SILENT for layout in layouts for entity in layout)
        parts = [f"{count} {kind}" for kind, count in sorted(self._left_out.items())]
        parts += [f"{self._hidden} hidden (off, frozen or invisible)"] if self._hidden else []
        parts += [f"{elsewhere} on sheets (paper space)"] if elsewhere else []
        if parts:
            lines.append(f"left out of what is drawn: {', '.join(parts)}")
        if self._clipped:
            lines.append(f"{self._clipped} clipped block references are read whole")
        if self._unit not in MILLIMETRES:
            lines.append(f"says no unit of length that is known ($INSUNITS {self._unit}): millimetres are assumed")
        return lines

    def read(self, space: Any, place: Place) -> Iterator[tuple[list[dict[str, Any]], int | None, Rgb]]:
        """Curves of each entity that is shown, with the number of its stroke and its colour; those of blocks too."""
        for entity in space:
            self._count += 1
            if self._count > MOST:
                raise ValueError(f"more than {MOST} entities in this DXF file")
            kind, layer = entity.dxftype(), self._layer(entity, place)
            if self._is_hidden(entity, layer, kind == "INSERT"):
                self._hidden += 1
            elif kind == "INSERT":
                yield from self._block(entity, place._replace(layer=layer, color=self._color(entity, layer, place)))
            elif kind not in SILENT:
                curves = self._curves(entity, kind)
                if curves:
                    moved = [_moved(curve, place.matrix) for curve in curves] if place.matrix else curves
                    yield moved, _number(entity), self._color(entity, layer, place)

    def _block(self, insert: Any, place: Place) -> Iterator[tuple[list[dict[str, Any]], int | None, Rgb]]:
        """What a block reference shows, at each place of its array."""
        block = insert.block()
        if block is None or block.block.is_xref:
            self._left_out["references to other files" if block is not None else "references to missing blocks"] += 1
            return
        if place.depth >= DEPTH:
            raise ValueError(f"blocks more than {DEPTH} deep in this DXF file")
        self._left_out.update(attribute.dxftype() for attribute in insert.attribs)
        self._clipped += XClip(insert).has_clipping_path
        if insert.mcount > MOST:
            raise ValueError(f"more than {MOST} entities in this DXF file")
        for copy in insert.multi_insert() if insert.mcount > 1 else [insert]:
            self._count += 1
            matrix = copy.matrix44() * place.matrix if place.matrix else copy.matrix44()
            yield from self.read(block, place._replace(matrix=matrix, depth=place.depth + 1))

    def _curves(self, entity: Any, kind: str) -> list[dict[str, Any]]:
        """An entity as curves, in the coordinates of its block."""
        if kind in ("LWPOLYLINE", "POLYLINE", "MLINE") and not _is_mesh(entity):
            if kind == "POLYLINE":
                entity.vertices[:] = [vertex for vertex in entity.vertices if not vertex.dxf.flags & FRAME]
            parts = [part for part in entity.virtual_entities() if part.dxftype() in ("LINE", "ARC")]
        elif kind in ("LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "HELIX"):
            parts = [entity]
        else:
            self._left_out["mesh" if kind == "POLYLINE" else kind] += 1
            return []
        found = []
        for part in parts:
            try:
                found.append(_nurbs(part))
            except (ArithmeticError, ValueError):
                self._left_out[f"broken {kind}"] += 1
        return found

    def _layer(self, entity: Any, place: Place) -> str:
        """The name of the layer that says how an entity looks: on 0, what is in a block takes that of its reference."""
        name: str = entity.dxf.layer
        return place.layer if place.depth and name == "0" else name

    def _is_hidden(self, entity: Any, name: str, block: bool) -> bool:
        layer = self.document.layers.get(name) if name in self.document.layers else None
        # A block reference on a layer that is off hides only what takes its layer over.
        on_layer = layer is not None and (layer.is_frozen() or (layer.is_off() and not block))
        return bool(entity.dxf.get("invisible", 0)) or on_layer

    def _color(self, entity: Any, name: str, place: Place) -> Rgb:
        dxf = entity.dxf
        index = dxf.get("color", BY_LAYER)
        if not dxf.hasattr("true_color"):
            if index == BY_BLOCK:
                return place.color
            if index == BY_LAYER and name in self.document.layers:
                dxf = self.document.layers.get(name).dxf
        if dxf.hasattr("true_color"):
            rgb = int2rgb(dxf.true_color)
        else:
            index = abs(dxf.get("color", BLACK_OR_WHITE))
            rgb = (0, 0, 0) if index == BLACK_OR_WHITE or not 0 < index < BY_LAYER else aci2rgb(index)
        r, g, b = (channel / 255 for channel in rgb)
        return r, g, b


def _is_mesh(entity: Any) -> bool:
    return bool(entity.dxftype() == "POLYLINE" and (entity.is_polygon_mesh or entity.is_poly_face_mesh))


def _nurbs(entity: Any) -> dict[str, Any]:
    kind, dxf = entity.dxftype(), entity.dxf
    if kind == "LINE":
        return {"points": [list(dxf.start), list(dxf.end)], "weights": [1.0, 1.0], "knots": [0.0, 0.0, 1.0, 1.0]}
    if kind in ("SPLINE", "HELIX"):
        spline = entity.construction_tool()
    else:
        if kind == "ELLIPSE":
            ellipse = entity.construction_tool()
        else:
            ends = (dxf.start_angle, dxf.end_angle) if kind == "ARC" else (0.0, 360.0)
            # The centre is in the frame of the normal, as the entity has it.
            ellipse = ConstructionEllipse.from_arc(dxf.center, abs(dxf.radius), dxf.extrusion, *ends)
        spline = rational_bspline_from_ellipse(ellipse)
    weights = [float(w) for w in spline.weights()] or [1.0] * len(spline.control_points)
    return {"points": [list(p) for p in spline.control_points], "weights": weights, "knots": list(spline.knots())}


def _moved(curve: dict[str, Any], matrix: Matrix44) -> dict[str, Any]:
    """A curve at another place: what is affine moves control points, whatever becomes of circles."""
    return {**curve, "points": [list(p) for p in matrix.transform_vertices(curve["points"])]}


def _number(entity: Any) -> int | None:
    """Of the stroke, in files of ours."""
    if not entity.has_xdata(APPLICATION):
        return None
    return next((int(tag.value) for tag in entity.get_xdata(APPLICATION) if tag.code == 1071), None)
