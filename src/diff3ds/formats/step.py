"""STEP files (ISO 10303-21, AP242): exact rational curves for CAD programs, by an own small writer; read through OCCT.

One product with one set of curves: a world unit is written as 1 mm, or as another unit. A stroke becomes a trimmed
rational B-spline of its own degree with its control points and weights to the last bit, called "stroke 0", "stroke 1"
and so on, with its colour; one of several segments is one B-spline with a knot at each joint, whose weights go on over
the joints (those of a segment are scaled by one number). Its width, the mean one where it changes, is written as the
style's line width, which few programs show. STEP has no transparent lines and no lines of a width relative to the
picture: opacity and `width_space` are not kept.
"""

import importlib.util
import itertools
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import torch

from diff3ds._files import write_text
from diff3ds._units import MILLIMETRES, Unit, check_unit
from diff3ds.bezier import to_nurbs
from diff3ds.chains import Chains
from diff3ds.sketch import Sketch

# A sketch of 100,000 strokes takes 100 MB; more is taken for a mistake or an attack.
MAX_BYTES = 1 << 28
# Some broken files make OCCT hang. It reads about 2 MB a second; this leaves room for a slow machine.
SECONDS = 30
SECONDS_PER_MEGABYTE = 10

_HEADER = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION(('3D sketch'),'2;1');
FILE_NAME({name},'1970-01-01T00:00:00',(''),(''),'diff3ds','diff3ds','');
FILE_SCHEMA(('AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF {{ 1 0 10303 442 1 1 4 }}'));
ENDSEC;
DATA;
"""
# The product and its units; numbers below 20 are taken by it.
_PRODUCT = """#1=APPLICATION_CONTEXT('managed model based 3d engineering');
#2=APPLICATION_PROTOCOL_DEFINITION('international standard','ap242_managed_model_based_3d_engineering',2014,#1);
#3=PRODUCT_CONTEXT('',#1,'mechanical');
#4=PRODUCT({name},{name},'',(#3));
#5=PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,(#4));
#6=PRODUCT_DEFINITION_FORMATION('','',#4);
#7=PRODUCT_DEFINITION_CONTEXT('part definition',#1,'design');
#8=PRODUCT_DEFINITION('design','',#6,#7);
#9=PRODUCT_DEFINITION_SHAPE('','',#8);
#10=({length});
#11=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));
#12=(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT());
#13=UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE({resolution}),#10,'distance_accuracy_value','');
#14=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#13))
GLOBAL_UNIT_ASSIGNED_CONTEXT((#10,#11,#12))REPRESENTATION_CONTEXT('','3D'));
#15=SHAPE_DEFINITION_REPRESENTATION(#9,#16);
#16=GEOMETRICALLY_BOUNDED_WIREFRAME_SHAPE_REPRESENTATION({name},(#17),#14);
#17=GEOMETRIC_CURVE_SET({name},({curves}));
#18=MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',({styles}),#14);
#19=DRAUGHTING_PRE_DEFINED_CURVE_FONT('continuous');
"""
_FIRST_FREE = 20
# Millimetres: OCCT's.
_RESOLUTION = 1e-7
_PREFIXES = {"mm": ".MILLI.", "cm": ".CENTI.", "m": "$"}
_NAMES = {"in": "INCH", "ft": "FOOT"}
_CONVERSION = """#{0}=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));
#{1}=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE({millimetres}),#{0});
#{2}=DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);
"""


def save_step(path: str | Path, sketch: Sketch, *, unit: Unit = "mm") -> None:
    """Writes a STEP file, whole or not at all; the same sketch and name give the same file.

    Not kept: opacity, `width_space`, colours outside [0, 1] (they are clamped). A STEP reader may drop strokes shorter
    than its resolution, 1e-7 mm in OCCT, and write equal weights as 1.

    Args:
        unit: what a world unit is.

    Raises:
        ValueError: no strokes, a unit that is not known, or values that have become invalid since the sketch was made.
        OSError: the file cannot be written.
    """
    path = Path(path)
    check_unit(unit)
    sketch.check_values()
    if len(sketch) == 0:
        raise ValueError(f"{path}: a STEP file needs at least one stroke, got none")
    strokes = list(_strokes(sketch.detach()))
    # An entity for each control point and six for the rest of a stroke: see _entities.
    ends = list(itertools.accumulate((len(stroke["points"]) + 6 for stroke in strokes), initial=_FIRST_FREE))
    length, conversion = _length_unit(unit, ends[-1])
    product = _PRODUCT.format(
        length=length,
        resolution=_reals([_RESOLUTION / MILLIMETRES[unit]]),
        name=_string(path.stem),
        curves=",\n".join(f"#{end - 5}" for end in ends[1:]),
        styles=",\n".join(f"#{end - 1}" for end in ends[1:]),
    )
    lines = [_HEADER.format(name=_string(path.name)) + product]
    for index, (first, stroke) in enumerate(zip(ends, strokes, strict=False)):
        lines += [f"#{first + i}={entity};\n" for i, entity in enumerate(_entities(index, first, stroke))]
    write_text(path, "".join([*lines, conversion, "ENDSEC;\nEND-ISO-10303-21;\n"]))


def _length_unit(unit: Unit, free: int) -> tuple[str, str]:
    """What a unit of length is, and entities that it refers to, numbered from `free`."""
    if unit in _PREFIXES:
        return f"LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({_PREFIXES[unit]},.METRE.)", ""
    millimetres = _reals([MILLIMETRES[unit]])
    return (
        f"CONVERSION_BASED_UNIT('{_NAMES[unit]}',#{free + 1})LENGTH_UNIT()NAMED_UNIT(#{free + 2})",
        _CONVERSION.format(free, free + 1, free + 2, millimetres=millimetres),
    )


def _strokes(sketch: Sketch) -> Iterator[dict[str, Any]]:
    """What is written of each stroke: control points and weights of a B-spline of so many segments, width, colour."""
    tensors = {name: value.double() for name, value in sketch.tensors().items()}
    width, first = tensors["width"], range(len(sketch) + 1) if sketch.chains is None else sketch.chains.first.tolist()
    for index in range(len(sketch)):
        segments = slice(first[index], first[index + 1])
        points, weights, _ = to_nurbs(tensors["points"][segments], tensors["weights"][segments])
        yield {
            "points": points.tolist(),
            "weights": weights.tolist(),
            "segments": segments.stop - segments.start,
            "width": float(width[index] if width.ndim == 1 else width[segments].mean()),
            "color": tensors["color"][index].tolist(),
        }


def _entities(index: int, first: int, stroke: dict[str, Any]) -> Iterator[str]:
    """The entities of one stroke, to be numbered from `first`."""
    points, segments, name = stroke["points"], stroke["segments"], _string(f"stroke {index}")
    degree = (len(points) - 1) // segments
    for point in points:
        yield f"CARTESIAN_POINT('',({_reals(point)}))"
    # It is never called closed: OCCT would make it periodic, and replace its last weight by the first.
    poles = ",".join(f"#{first + i}" for i in range(len(points)))
    multiplicities = ",".join(map(str, [degree + 1, *[degree] * (segments - 1), degree + 1]))
    yield (
        f"(BOUNDED_CURVE()B_SPLINE_CURVE({degree},({poles}),.UNSPECIFIED.,.F.,.U.)"
        f"B_SPLINE_CURVE_WITH_KNOTS(({multiplicities}),({_reals(range(segments + 1))}),.PIECEWISE_BEZIER_KNOTS.)"
        "CURVE()GEOMETRIC_REPRESENTATION_ITEM()"
        f"RATIONAL_B_SPLINE_CURVE(({_reals(stroke['weights'])}))REPRESENTATION_ITEM({name}))"
    )
    spline = first + len(points)
    yield f"TRIMMED_CURVE({name},#{spline},(PARAMETER_VALUE(0.)),(PARAMETER_VALUE({segments}.)),.T.,.PARAMETER.)"
    yield f"COLOUR_RGB('',{_reals(min(max(c, 0.0), 1.0) for c in stroke['color'])})"
    # A line width must be positive.
    width = f"POSITIVE_LENGTH_MEASURE({_reals([stroke['width']])})" if stroke["width"] > 0 else "$"
    yield f"CURVE_STYLE('',#19,{width},#{spline + 2})"
    yield f"PRESENTATION_STYLE_ASSIGNMENT((#{spline + 3}))"
    yield f"STYLED_ITEM('',(#{spline + 4}),#{spline + 1})"


def _reals(values: Any) -> str:
    """Numbers that read back to the same bits: a STEP real has a point, and its exponent a capital E."""
    written = []
    for value in values:
        mantissa, mark, exponent = repr(float(value)).upper().partition("E")
        written.append((mantissa if "." in mantissa else mantissa + ".") + mark + exponent)
    return ",".join(written)


def _string(text: str) -> str:
    """A STEP string: quotes and backslashes doubled, all but printable ASCII as code points (ISO 10303-21, X4)."""
    escaped = ""
    for character in text:
        if " " <= character <= "~":
            escaped += character * 2 if character in "'\\" else character
        else:
            escaped += f"\\X4\\{ord(character):08X}\\X0\\"
    return f"'{escaped}'"


def load_step(path: str | Path) -> Sketch:
    """Every edge of a STEP file as a stroke, float64, in millimetres; needs the extra `cad`.

    Rational curves up to degree 3 (a B-spline has a segment between each two knots), lines, circles, ellipses,
    parabolas and hyperbolas are exact; other curves are approximated by cubics to 1e-4 of their size. Colours are
    those of the curves, black where there is none. Widths, opacities and `width_space` get the defaults of `Sketch`.

    OCCT reads in a process of its own: a file that makes it crash or hang gives an error like any other broken file.
    Single curves that OCCT refuses are left out.

    Raises:
        ImportError: the extra `cad` is not installed.
        ValueError: larger than 256 MiB, not a STEP file, a broken one, one without curves.
        OSError: the file cannot be read.
    """
    path = Path(path)
    _check_file(path)
    if importlib.util.find_spec("OCP") is None:
        raise ImportError("reading STEP files takes OCCT: install it with pip install 'diff3ds[cad]'")
    strokes = _read_apart(path)
    if not strokes:
        raise ValueError(f"{path}: no curves in this STEP file")
    try:
        return _sketch(strokes)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _check_file(path: Path) -> None:
    """Raises ValueError for what is too large, no STEP file, or one that has been cut off."""
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise ValueError(f"{path}: {size} bytes are more than the {MAX_BYTES} that are read")
    with path.open("rb") as file:
        start = file.read(1024)
        file.seek(max(size - 1024, 0))
        end = file.read()
    if b"ISO-10303-21;" not in start:
        raise ValueError(f"{path}: not a STEP file: it must begin with ISO-10303-21;")
    if b"END-ISO-10303-21;" not in end:
        raise ValueError(f"{path}: a STEP file that has been cut off: it must end with END-ISO-10303-21;")


def _read_apart(path: Path) -> list[dict[str, Any]]:
    """The strokes that step_reader.py finds, run as a process of its own."""
    script = Path(__file__).with_name("step_reader.py")
    command = [sys.executable, "-P", str(script), str(path.resolve())]
    patience = SECONDS + SECONDS_PER_MEGABYTE * path.stat().st_size / 1e6
    try:
        done = subprocess.run(command, capture_output=True, timeout=patience, check=False)
        answer = json.loads(done.stdout)
    except subprocess.TimeoutExpired as error:
        raise ValueError(f"{path}: OCCT has not read this STEP file in {patience:.0f} s") from error
    except ValueError as error:
        raise ValueError(f"{path}: OCCT failed on this STEP file (exit code {done.returncode})") from error
    if "error" in answer:
        raise ValueError(f"{path}: {answer['error']}")
    strokes: list[dict[str, Any]] = answer["strokes"]
    return strokes


def _sketch(strokes: list[dict[str, Any]]) -> Sketch:
    """Strokes of any degrees as one sketch, in their order."""
    parts, order = [], []
    for controls in sorted({len(s["segments"][0]["weights"]) for s in strokes}):
        rows = [i for i, s in enumerate(strokes) if len(s["segments"][0]["weights"]) == controls]
        segments = [segment for i in rows for segment in strokes[i]["segments"]]
        points, weights = (
            torch.tensor([segment[key] for segment in segments], dtype=torch.float64) for key in ("points", "weights")
        )
        color = torch.tensor([strokes[i]["color"] for i in rows], dtype=torch.float64)
        chains = Chains.of([len(strokes[i]["segments"]) for i in rows], [strokes[i]["closed"] for i in rows])
        parts.append(Sketch(points, weights, color=color, chains=chains))
        order += rows
    return Sketch.concatenate(parts)[torch.tensor(order).argsort()]
