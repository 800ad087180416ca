"""STEP files (ISO 10303-21, AP242): exact rational curves for CAD programs, by an own small writer; read through OCCT.

One product with one set of curves: a world unit is written as 1 mm, or as another unit. A stroke becomes a line, a
circle or an ellipse where it is one, trimmed or whole, else a rational B-spline of its own degree with its control
points and weights to the last bit; one of several such curves is a composite curve. It is called by its name, or
"stroke 0", "stroke 1" and so on, with its colour, on a layer of that colour, or one that the caller names. Its width,
the mean one where it changes, is written as the style's line width, which few programs show; the name of the style says
what it means. STEP has no transparent lines: opacity is not kept.
"""

import importlib.util
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from diff3ds._files import write_text
from diff3ds._units import MILLIMETRES, Unit, check_tolerance, check_unit
from diff3ds.formats.apart import check_size, strokes_apart
from diff3ds.formats.assembly import ReadStroke, sketch_of
from diff3ds.formats.cad.layers import checked_layers, color_layers
from diff3ds.formats.cad.step_entities import Entities, reals, string, stroke_entity
from diff3ds.formats.cad.strokes_as_curves import curves_of
from diff3ds.formats.opening import check_sketch
from diff3ds.sketch import DEFAULT_WIDTH, Sketch, WidthSpace

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
# Of the largest coordinate: how far apart ends that meet may be, which are computed in float64. Readers make a wire of
# what meets within the accuracy that the file says.
_ROUNDING = 16 * float(np.finfo(np.float64).eps)
_PREFIXES = {"mm": ".MILLI.", "cm": ".CENTI.", "m": "$"}
_NAMES = {"in": "INCH", "ft": "FOOT"}
# Names of curve styles, by which a reader knows what their widths mean.
WIDTHS: dict[WidthSpace, str] = {"image": "width of the image height", "world": "width in space"}


def save_step(
    path: str | Path,
    sketch: Sketch,
    *,
    unit: Unit = "mm",
    layers: Sequence[str] | None = None,
    tolerance: float | None = None,
) -> None:
    """Writes a STEP file, whole or not at all; the same sketch and name give the same file.

    Lines, circles and ellipses stand for what they are within the tolerance of, and are read back to 1e-12 of their
    size; B-splines are bit for bit, but for one factor of their weights.

    Not kept: opacity, widths along strokes, colours outside [0, 1] (they are clamped). A STEP reader may drop strokes
    shorter than its resolution, 1e-7 mm in OCCT, and write equal weights as 1.

    Args:
        unit: what a world unit is.
        layers: the layer of each stroke, by name; by default there is one a colour.
        tolerance: how far what stands for a curve may lie off it, world units; by default as well as the coordinates
            are known (`strokes_as_curves.resolution`).

    Raises:
        ValueError: no strokes, layers that are not one a stroke, a unit that is not known, a tolerance that is negative
            or not finite, or values that have become invalid since the sketch was made.
        OSError: the file cannot be written.
    """
    path = Path(path)
    check_sketch(path, sketch, "a STEP")
    check_unit(unit)
    check_tolerance(tolerance)
    sketch = sketch.detach().to("cpu")
    named = checked_layers(layers, sketch) or color_layers(sketch)
    entities = Entities(_FIRST_FREE)
    closed = [False] * len(sketch) if sketch.chains is None else sketch.chains.closed.tolist()
    names = sketch.names or ("",) * len(sketch)
    curves = [
        stroke_entity(entities, string(names[i] or f"stroke {i}"), found, closed[i])
        for i, found in enumerate(curves_of(sketch, tolerance))
    ]
    styles = _styles(entities, sketch, curves, named)
    length = _length_unit(unit, entities)
    product = _PRODUCT.format(
        length=length,
        resolution=reals([max(_RESOLUTION / MILLIMETRES[unit], _ROUNDING * float(sketch.points.abs().max()))]),
        name=string(path.stem),
        curves=",\n".join(curves),
        styles=",\n".join(styles),
    )
    header = _HEADER.format(name=string(path.name))
    write_text(path, "".join([header, product, *entities.lines, "ENDSEC;\nEND-ISO-10303-21;\n"]))


def _length_unit(unit: Unit, entities: Entities) -> str:
    """What a unit of length is."""
    if unit in _PREFIXES:
        return f"LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({_PREFIXES[unit]},.METRE.)"
    millimetre = entities.add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))")
    measure = f"LENGTH_MEASURE({reals([MILLIMETRES[unit]])})"
    factor = entities.add(f"LENGTH_MEASURE_WITH_UNIT({measure},{millimetre})")
    exponents = entities.add("DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.)")
    return f"CONVERSION_BASED_UNIT('{_NAMES[unit]}',{factor})LENGTH_UNIT()NAMED_UNIT({exponents})"


def _styles(entities: Entities, sketch: Sketch, curves: list[str], named: list[str]) -> list[str]:
    """How the strokes look, and their layers."""
    widths, space = sketch.width.double(), sketch.width_space
    if widths.ndim == 2:
        rows = torch.arange(len(sketch)) if sketch.chains is None else sketch.chains.stroke
        sums = torch.zeros(len(sketch), dtype=torch.float64).index_add(0, rows, widths.mean(1))
        widths = sums / torch.bincount(rows)
    styles, layers = [], dict[str, list[str]]()
    colors = sketch.color.double().tolist()
    for curve, layer, width, color in zip(curves, named, widths.tolist(), colors, strict=True):
        shown = [min(max(c, 0.0), 1.0) for c in color]
        layers.setdefault(layer, []).append(curve)
        ink = entities.add(f"COLOUR_RGB('',{reals(shown)})")
        # A line width must be positive.
        measure = f"POSITIVE_LENGTH_MEASURE({reals([width])})" if width > 0 else "$"
        style = entities.add(f"CURVE_STYLE('{WIDTHS[space]}',#19,{measure},{ink})")
        styles.append(
            entities.add(f"STYLED_ITEM('',({entities.add(f'PRESENTATION_STYLE_ASSIGNMENT(({style}))')}),{curve})")
        )
    for name, some in layers.items():
        entities.add(f"PRESENTATION_LAYER_ASSIGNMENT({string(name)},'',({','.join(some)}))")
    return styles


def load_step(path: str | Path) -> Sketch:
    """Every wire and every other edge of a STEP file as a stroke, float64, in millimetres; needs the extra `cad`.

    Rational curves up to degree 3 (a B-spline has a segment between each two knots), lines, circles, ellipses,
    parabolas and hyperbolas are exact; other curves are approximated by cubics to 1e-4 of their size. Colours are
    those of the curves, black where there is none. Wires that bound a face are single edges. Widths and `width_space`
    are those of `save_step`, of other programs' files the defaults of `Sketch`, as opacities are of all.

    OCCT reads in a process of its own: a file that makes it crash or hang gives an error like any other broken file.
    Single curves that OCCT refuses are left out.

    Raises:
        ImportError: the extra `cad` is not installed.
        ValueError: larger than 256 MiB, not a STEP file, a broken one, one without curves.
        OSError: the file cannot be read.
    """
    path = Path(path)
    check_step(path)
    if importlib.util.find_spec("OCP") is None:
        raise ImportError("reading STEP files takes OCCT: install it with pip install 'diff3ds[cad]'")
    strokes = strokes_apart(path, "diff3ds.formats.cad.step_reader", "OCCT", "STEP")
    try:
        return _sketch(strokes)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def check_step(path: Path) -> None:
    """Raises ValueError for what is too large, no STEP file, or one that has been cut off."""
    check_size(path)
    size = path.stat().st_size
    with path.open("rb") as file:
        start = file.read(1024)
        file.seek(max(size - 1024, 0))
        end = file.read()
    if b"ISO-10303-21;" not in start:
        raise ValueError(f"{path}: not a STEP file: it must begin with ISO-10303-21;")
    if b"END-ISO-10303-21;" not in end:
        raise ValueError(f"{path}: a STEP file that has been cut off: it must end with END-ISO-10303-21;")


def _sketch(strokes: list[dict[str, Any]]) -> Sketch:
    """The strokes, with their widths where all are called as `save_step` calls them."""
    said = [found["width"] or {"name": "", "value": 0.0, "millimetres": 1.0} for found in strokes]
    names = {style["name"] for style in said}
    space = next((space for space, name in WIDTHS.items() if names == {name}), None)
    read = []
    for found, style in zip(strokes, said, strict=True):
        segments = [(segment["points"], segment["weights"]) for segment in found["segments"]]
        unit = style["millimetres"] if space == "world" else 1.0
        width = DEFAULT_WIDTH if space is None else style["value"] * unit
        read.append(ReadStroke(segments, found["closed"], found["color"], width))
    return sketch_of(read, space or "image")
