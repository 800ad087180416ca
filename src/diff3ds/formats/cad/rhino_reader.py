"""The curves of a 3DM file as NURBS, by rhino3dm; `reader_process.py` runs it."""

from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import rhino3dm

MILLIMETRES = {"Microns": 1e-3, "Millimeters": 1.0, "Centimeters": 10.0, "Decimeters": 100.0, "Meters": 1000.0}
MILLIMETRES |= {"Dekameters": 1e4, "Hectometers": 1e5, "Kilometers": 1e6, "Nanometers": 1e-6, "Angstroms": 1e-7}
MILLIMETRES |= {"Microinches": 25.4e-6, "Mils": 25.4e-3, "Inches": 25.4, "Feet": 304.8, "Yards": 914.4}
MILLIMETRES |= {"Miles": 1609344.0, "NauticalMiles": 1852e3, "PrinterPoints": 25.4 / 72, "PrinterPicas": 25.4 / 6}
# Objects, with those of blocks in blocks: more is taken for an attack, which needs few bytes to ask for many.
MOST = 1_000_000
DEPTH = 16

Rgb = tuple[float, float, float]
Matrix = tuple[tuple[float, ...], ...]


class Place(NamedTuple):
    """Where objects are: how deep in blocks, and the colour that they may take over."""

    matrices: tuple[Matrix, ...] = ()
    color: Rgb = (0.0, 0.0, 0.0)


def found_in(path: str, told: Callable[[int, int], None]) -> tuple[list[dict[str, Any]], list[str]]:
    """All curves that are shown, and what is said.

    Each has points, weights and knots, its colour (sRGB, in [0, 1]), and the millimetres of a unit.
    """
    model: Any = rhino3dm.File3dm.Read(path)
    if model is None:
        raise ValueError("rhino3dm cannot read this 3DM file: it is broken or none")
    reader = Reader(model)
    top = [item for item in model.Objects if not item.Attributes.IsInstanceDefinitionObject]
    return list(reader.read(top, Place())), reader.said()


class Reader:
    """Reads the objects of a model, and counts what it leaves out."""

    def __init__(self, model: Any) -> None:
        self._layers = list(model.Layers)
        self._by_id = {str(layer.Id): layer for layer in self._layers}
        self._unit: str = model.Settings.ModelUnitSystem.name
        objects = {str(item.Attributes.Id): item for item in model.Objects}
        self._blocks = {
            str(block.Id): [objects[str(key)] for key in block.GetObjectIds() if str(key) in objects]
            for block in model.InstanceDefinitions
        }
        self._left_out, self._hidden, self._elsewhere, self._count = Counter[str](), 0, 0, 0

    def said(self) -> list[str]:
        """What whoever reads the file should know, a line each."""
        lines = []
        parts = [f"{count} {kind}" for kind, count in sorted(self._left_out.items())]
        parts += [f"{self._hidden} hidden (themselves or by their layers)"] if self._hidden else []
        parts += [f"{self._elsewhere} on sheets (layouts)"] if self._elsewhere else []
        if parts:
            lines.append(f"left out of what is drawn: {', '.join(parts)}")
        if self._unit not in MILLIMETRES:
            lines.append(f"says no unit of length that is known ({self._unit}): millimetres are assumed")
        return lines

    def read(self, items: list[Any], place: Place) -> Iterator[dict[str, Any]]:
        """The curves of objects, those of blocks too."""
        for item in items:
            self._count += 1
            if self._count > MOST:
                raise ValueError(f"more than {MOST} objects in this 3DM file")
            attributes, geometry = item.Attributes, item.Geometry
            if self._is_hidden(attributes):
                self._hidden += 1
            elif attributes.ActiveSpace.name == "PageSpace":
                self._elsewhere += 1
            elif isinstance(geometry, rhino3dm.InstanceReference):
                yield from self._block(geometry, place._replace(color=self._color(attributes, place)))
            elif isinstance(geometry, rhino3dm.Curve):
                name = attributes.Name or "a curve"
                curves = [_moved(_nurbs(part, name), place.matrices) for part in _parts(geometry)]
                scale = MILLIMETRES.get(self._unit, 1.0)
                yield {"curves": curves, "color": self._color(attributes, place), "scale": scale}
            else:
                self._left_out[type(geometry).__name__] += 1

    def _block(self, reference: Any, place: Place) -> Iterator[dict[str, Any]]:
        """What a block reference shows."""
        items = self._blocks.get(str(reference.ParentIdefId))
        if not items:
            self._left_out["references to empty or missing blocks"] += 1
            return
        if len(place.matrices) >= DEPTH:
            raise ValueError(f"blocks more than {DEPTH} deep in this 3DM file")
        xform = reference.Xform
        matrix = tuple(tuple(getattr(xform, f"M{row}{column}") for column in range(4)) for row in range(3))
        yield from self.read(items, place._replace(matrices=(matrix, *place.matrices)))

    def _is_hidden(self, attributes: Any) -> bool:
        """Whether an object is hidden, or a layer that it is on, or one above that."""
        if attributes.Mode == rhino3dm.ObjectMode.Hidden or not attributes.Visible:
            return True
        layer = self._layer(attributes)
        for _ in self._layers:
            if layer is None or not layer.Visible:
                break
            layer = self._by_id.get(str(layer.ParentLayerId))
        return layer is not None and not layer.Visible

    def _layer(self, attributes: Any) -> Any:
        """The layer of an object, or None."""
        index = attributes.LayerIndex
        return self._layers[index] if 0 <= index < len(self._layers) else None

    def _color(self, attributes: Any, place: Place) -> Rgb:
        layer = self._layer(attributes)
        if attributes.ColorSource == rhino3dm.ObjectColorSource.ColorFromParent:
            return place.color
        if attributes.ColorSource != rhino3dm.ObjectColorSource.ColorFromLayer:
            rgb = attributes.ObjectColor
        else:
            # Objects on no layer are on Rhino's default layer, which is black.
            rgb = (0, 0, 0) if layer is None else layer.Color
        r, g, b = (channel / 255 for channel in rgb[:3])
        return r, g, b


def _parts(curve: Any) -> Iterator[Any]:
    """The curves that a curve is made of."""
    if isinstance(curve, rhino3dm.PolyCurve):
        for i in range(curve.SegmentCount):
            yield from _parts(curve.SegmentCurve(i))
    else:
        yield curve


def _nurbs(curve: Any, name: str) -> dict[str, Any]:
    curve = curve if isinstance(curve, rhino3dm.NurbsCurve) else curve.ToNurbsCurve()
    if curve is None:
        raise ValueError(f"rhino3dm makes no NURBS curve of {name!r}")
    homogeneous = [(p.X, p.Y, p.Z, p.W) for p in (curve.Points[i] for i in range(len(curve.Points)))]
    knots = [curve.Knots[i] for i in range(len(curve.Knots))]
    return {
        "points": [(x / w, y / w, z / w) for x, y, z, w in homogeneous],
        "weights": [w for *_, w in homogeneous],
        # Others have one more at each end.
        "knots": [knots[0], *knots, knots[-1]],
    }


def _moved(curve: dict[str, Any], matrices: tuple[Matrix, ...]) -> dict[str, Any]:
    """A curve in its block, at the place of the block in another one, and so on: the innermost matrix is the first."""
    points = curve["points"]
    for matrix in matrices:
        points = [tuple(a * x + b * y + c * z + d for a, b, c, d in matrix) for x, y, z in points]
    return {**curve, "points": points}
