"""Entities of a STEP file (ISO 10303-21 and -42): numbered lines of text for points, curves and how they look."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from diff3ds.formats.cad.arcs import Arc, Vector
from diff3ds.formats.cad.strokes_as_curves import Curve, Line, Spline


class Entities:
    """Entities, numbered from `first`; what refers to one takes its "#number"."""

    def __init__(self, first: int) -> None:
        self.next = first
        self.lines: list[str] = []

    def add(self, text: str) -> str:
        """Adds an entity; returns its reference."""
        reference = f"#{self.next}"
        self.lines.append(f"{reference}={text};\n")
        self.next += 1
        return reference

    def point(self, place: Sequence[float] | Vector) -> str:
        """A point."""
        return self.add(f"CARTESIAN_POINT('',({reals(place)}))")

    def direction(self, vector: Vector) -> str:
        """A unit vector."""
        return self.add(f"DIRECTION('',({reals(vector / np.linalg.norm(vector))}))")


def stroke_entity(entities: Entities, name: str, curves: Sequence[Curve], closed: bool) -> str:
    """A stroke of curves that follow on each other: a whole circle or ellipse, a trimmed curve or a composite one.

    Args:
        name: a STEP string.
    """
    if len(curves) == 1:
        curve = curves[0]
        return (
            _basis(entities, name, curve) if isinstance(curve, Arc) and curve.whole else _trimmed(entities, name, curve)
        )
    parts = []
    for i, curve in enumerate(curves):
        goes_on = "CONTINUOUS" if closed or i < len(curves) - 1 else "DISCONTINUOUS"
        parts.append(entities.add(f"COMPOSITE_CURVE_SEGMENT(.{goes_on}.,.T.,{_trimmed(entities, name, curve)})"))
    return entities.add(f"COMPOSITE_CURVE({name},({','.join(parts)}),.F.)")


def _trimmed(entities: Entities, name: str, curve: Curve) -> str:
    basis = _basis(entities, name, curve)
    start, stop = 0.0, 1.0
    if isinstance(curve, Arc):
        start, stop = curve.start, curve.stop
    elif isinstance(curve, Spline):
        stop = float(curve.knots[-1])
    ends = ",".join(f"(PARAMETER_VALUE({reals([t])}))" for t in (start, stop))
    return entities.add(f"TRIMMED_CURVE({name},{basis},{ends},.T.,.PARAMETER.)")


def _basis(entities: Entities, name: str, curve: Curve) -> str:
    """The curve without its ends, named, for some readers look there."""
    if isinstance(curve, Line):
        along = curve.stop - curve.start
        start, direction = entities.point(curve.start), entities.direction(along)
        vector = entities.add(f"VECTOR('',{direction},{reals([np.linalg.norm(along)])})")
        return entities.add(f"LINE({name},{start},{vector})")
    if isinstance(curve, Arc):
        axis = np.cross(curve.major, curve.minor)
        frame = [entities.point(curve.center), entities.direction(axis), entities.direction(curve.major)]
        place = entities.add(f"AXIS2_PLACEMENT_3D('',{','.join(frame)})")
        radii = [np.linalg.norm(curve.major)] + ([] if curve.circular else [np.linalg.norm(curve.minor)])
        return entities.add(f"{'CIRCLE' if curve.circular else 'ELLIPSE'}({name},{place},{reals(radii)})")
    return _spline(entities, name, curve)


def _spline(entities: Entities, name: str, curve: Spline) -> str:
    points, degree = [entities.point(point) for point in curve.points.tolist()], curve.degree
    segments = (len(points) - 1) // degree
    multiplicities = ",".join(map(str, [degree + 1, *[degree] * (segments - 1), degree + 1]))
    # It is never called closed: OCCT would make it periodic, and replace its last weight by the first.
    return entities.add(
        f"(BOUNDED_CURVE()B_SPLINE_CURVE({degree},({','.join(points)}),.UNSPECIFIED.,.F.,.U.)"
        f"B_SPLINE_CURVE_WITH_KNOTS(({multiplicities}),({reals(range(segments + 1))}),.PIECEWISE_BEZIER_KNOTS.)"
        "CURVE()GEOMETRIC_REPRESENTATION_ITEM()"
        f"RATIONAL_B_SPLINE_CURVE(({reals(curve.weights)}))REPRESENTATION_ITEM({name}))"
    )


def reals(values: Iterable[Any]) -> str:
    """Numbers that read back to the same bits: a STEP real has a point, and its exponent a capital E."""
    written = []
    for value in values:
        mantissa, mark, exponent = repr(float(value)).upper().partition("E")
        written.append((mantissa if "." in mantissa else mantissa + ".") + mark + exponent)
    return ",".join(written)


def string(text: str) -> str:
    """A STEP string: quotes and backslashes doubled, all but printable ASCII as code points (ISO 10303-21, X4)."""
    escaped = ""
    for character in text:
        if " " <= character <= "~":
            escaped += character * 2 if character in "'\\" else character
        else:
            escaped += f"\\X4\\{ord(character):08X}\\X0\\"
    return f"'{escaped}'"
