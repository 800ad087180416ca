"""USD files (.usd, .usda, .usdc, .usdz) for scenes, by usd-core (the extra `usd`).

Each stroke is a NurbsCurves called "stroke_0", "stroke_1" and so on, with its knots and weights, for programs that know
them, such as Blender: their purpose is "render". Many viewers draw such curves as their control polygons or not at all:
for them there are polylines of all strokes, a BasisCurves of the purpose "proxy". z is up. Points, widths and colours
are float32, weights double. What USD has no words for stands in attributes of the curves called "diff3ds:...".
"""

import importlib.util
import tempfile
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._files import replacing
from diff3ds._shapes import Float
from diff3ds._units import MILLIMETRES, Unit
from diff3ds.bezier import to_nurbs
from diff3ds.formats.apart import check_size, nurbs_sketch
from diff3ds.formats.opening import check_writable
from diff3ds.formats.scenes.polylines import Polyline, polylines_of
from diff3ds.formats.scenes.tubes import width_unit
from diff3ds.sketch import Sketch
from diff3ds.svg.layer_groups import Group, check_layers, grouped, outermost

# Of the radius of the sketch: how far the polylines for viewers may be off the curves.
PROXY = 1e-3
# The path of all curves.
STROKES = "/sketch/strokes"


def save_usd(
    path: str | Path, sketch: Sketch, *, unit: Unit = "m", layers: Sequence[str | Group] | None = None
) -> None:
    """Writes a USD file, whole or not at all; a package of one (.usdz) by its suffix.

    Widths in image units become those of a picture that the sketch fills; the numbers themselves are kept beside them.

    Args:
        unit: what a world unit is.
        layers: of each stroke, its layer, or layers within layers from the outermost on: groups that show these names.

    Raises:
        ImportError: the extra `usd` is not installed.
        ValueError: another number of layers than of strokes, no strokes, a unit that is not known, or values that have
            become invalid since the sketch was made.
        OSError: the file cannot be written.
    """
    path = Path(path)
    check_writable(path, sketch, unit, "USD", "pxr", "usd-core", "usd")
    check_layers(layers, len(sketch))
    sketch = sketch.detach().to("cpu")
    usd: Any = import_module("pxr.Usd")
    geometry: Any = import_module("pxr.UsdGeom")
    stage = usd.Stage.CreateInMemory()
    geometry.SetStageUpAxis(stage, geometry.Tokens.z)
    geometry.SetStageMetersPerUnit(stage, MILLIMETRES[unit] / 1000)
    root = geometry.Xform.Define(stage, "/sketch")
    stage.SetDefaultPrim(root.GetPrim())
    geometry.Scope.Define(stage, STROKES)
    _layers(stage, sketch, STROKES, grouped(layers, range(len(sketch))), polylines_of(sketch, PROXY))
    with replacing(path) as temporary:
        _write(stage, temporary, path.suffix.lower() == ".usdz")


def _layers(stage: Any, sketch: Sketch, place: str, groups: Mapping[Group, list[int]], lines: list[Polyline]) -> None:
    """The strokes of layers and of those within them below a path, and polylines beside the strokes of each."""
    tf: Any = import_module("pxr.Tf")
    geometry: Any = import_module("pxr.UsdGeom")
    loose = groups.get((), [])
    taken = {"polylines", *(f"stroke_{stroke}" for stroke in loose)}
    if loose:
        _curves(stage, sketch, place, loose)
        _polylines(stage, sketch, loose, lines, "/sketch/polylines" if place == STROKES else f"{place}/polylines")
    for label, inner in outermost({group: held for group, held in groups.items() if group}).items():
        # Names of prims have letters of identifiers alone, and different ones may become the same.
        known = tf.MakeValidIdentifier(label)
        free = next(name for name in (known, *(f"{known}_{i}" for i in range(len(taken) + 1))) if name not in taken)
        taken.add(free)
        group = geometry.Xform.Define(stage, f"{place}/{free}")
        group.GetPrim().SetDisplayName(label)
        _layers(stage, sketch, f"{place}/{free}", inner, lines)


def _write(stage: Any, path: Path, packed: bool) -> None:
    """USD tells of a full disk by an exception of its own, or by a file that is short.

    Args:
        stage: what is written.
        path: where to.
        packed: whether as a package of one file.
    """
    tf: Any = import_module("pxr.Tf")
    try:
        if packed:
            utils: Any = import_module("pxr.UsdUtils")
            with tempfile.TemporaryDirectory() as folder:
                alone = Path(folder) / "sketch.usdc"
                written = stage.GetRootLayer().Export(str(alone))
                written = written and utils.CreateNewUsdzPackage(str(alone), str(path))
        else:
            written = stage.GetRootLayer().Export(str(path))
    except tf.ErrorException as error:
        raise OSError(f"{path}: {error}") from error
    if not written:
        raise OSError(f"{path}: usd-core cannot write this file")


def _curves(stage: Any, sketch: Sketch, place: str, strokes: Sequence[int]) -> None:
    """Some strokes as curves below a path."""
    geometry: Any = import_module("pxr.UsdGeom")
    sdf: Any = import_module("pxr.Sdf").ValueTypeNames
    points, weights = sketch.points.double(), sketch.weights.double()
    widths = sketch.with_widths_along().width.double()
    unit = width_unit(sketch)
    first = range(len(sketch) + 1) if sketch.chains is None else sketch.chains.first.tolist()
    for stroke in strokes:
        rows = slice(first[stroke], first[stroke + 1])
        control, weight, knots = to_nurbs(points[rows], weights[rows])
        along = torch.cat([widths[rows][:1, 0], widths[rows][:, 1:].flatten()])
        curve = geometry.NurbsCurves.Define(stage, f"{place}/stroke_{stroke}")
        curve.CreatePointsAttr(control.float().numpy())
        curve.CreatePointWeightsAttr(weight.numpy())
        curve.CreateKnotsAttr(knots.numpy())
        curve.CreateOrderAttr([points.shape[1]])
        curve.CreateRangesAttr([(0.0, float(rows.stop - rows.start))])
        curve.CreateCurveVertexCountsAttr([len(control)])
        even = bool((along == along[0]).all())
        curve.CreateWidthsAttr(((along[:1] if even else along) * unit).float().numpy())
        curve.SetWidthsInterpolation("constant" if even else "vertex")
        curve.CreateDisplayColorAttr([tuple(sketch.color[stroke].tolist())])
        curve.CreateDisplayOpacityAttr([float(sketch.opacity[stroke])])
        curve.CreatePurposeAttr("render")
        curve.CreateExtentAttr(_extent(control.numpy(), float(along.max()) * unit))
        prim = curve.GetPrim()
        prim.CreateAttribute("diff3ds:width", sdf.DoubleArray).Set((along[:1] if even else along).numpy())
        prim.CreateAttribute("diff3ds:widthSpace", sdf.Token).Set(sketch.width_space)
        prim.CreateAttribute("diff3ds:closed", sdf.Bool).Set(_closed(sketch, stroke))


def _polylines(stage: Any, sketch: Sketch, strokes: list[int], polylines: list[Polyline], place: str) -> None:
    """Some strokes as polylines, one prim at a path."""
    geometry: Any = import_module("pxr.UsdGeom")
    lines = [polylines[stroke] for stroke in strokes]
    vertices = [np.concatenate([line.vertices, line.vertices[:1]]) if line.closed else line.vertices for line in lines]
    counts = [len(some) for some in vertices]
    width = sketch.width.double() if sketch.width.ndim == 1 else _mean_widths(sketch)
    thick = (width * width_unit(sketch))[strokes].numpy()
    curves = geometry.BasisCurves.Define(stage, place)
    curves.CreateTypeAttr("linear")
    curves.CreateWrapAttr("nonperiodic")
    curves.CreateCurveVertexCountsAttr(counts)
    curves.CreatePointsAttr(np.concatenate(vertices).astype(np.float32))
    curves.CreateWidthsAttr(thick.astype(np.float32))
    curves.SetWidthsInterpolation("uniform")
    colors = geometry.PrimvarsAPI(curves).CreatePrimvar(
        "displayColor", import_module("pxr.Sdf").ValueTypeNames.Color3fArray, "uniform"
    )
    colors.Set(sketch.color[strokes].float().numpy())
    curves.CreatePurposeAttr("proxy")
    curves.CreateExtentAttr(_extent(np.concatenate(vertices), float(thick.max())))


def _mean_widths(sketch: Sketch) -> torch.Tensor:
    rows = torch.arange(len(sketch)) if sketch.chains is None else sketch.chains.stroke
    sums = torch.zeros(len(sketch), dtype=torch.float64).index_add(0, rows, sketch.width.double().mean(1))
    return sums / torch.bincount(rows)


def _closed(sketch: Sketch, stroke: int) -> bool:
    return sketch.chains is not None and bool(sketch.chains.closed[stroke])


def _extent(points: Float[NDArray[np.float64], "_ 3"], width: float) -> Float[NDArray[np.float32], "2 3"]:
    """The box that holds the curves, as thick as they are."""
    return np.stack([points.min(0) - width / 2, points.max(0) + width / 2]).astype(np.float32)


def load_usd(path: str | Path) -> Sketch:
    """The curves that a USD file shows as strokes, float64, z up, in metres; ours come back as they are in float32.

    NurbsCurves and BasisCurves (linear, Bézier, B-spline, Catmull-Rom) are exact, also as instances and of point
    instancers; what is y up is turned. Colours and opacities are what is shown (`displayColor`; the mean one along a
    curve), the widths those of `save_usd`; of other files they get the defaults of `Sketch`. What moves is taken at the
    first frame. Guides and proxies are left out. Files that this one refers to are opened if
    they lie in its folder. A warning counts, by kind, what else is drawn, and what is invisible; another one says that
    the file names no unit of length.

    usd-core reads in a process of its own: a file that makes it crash or hang gives an error like any broken file.

    Raises:
        ImportError: the extra `usd` is not installed.
        ValueError: larger than 256 MiB, not a USD file, a broken one, no curves, a curve of a degree above 3, or a file
            that refers to what is missing or not in its folder.
        OSError: the file cannot be read.
    """
    path = Path(path)
    check_size(path)
    if importlib.util.find_spec("pxr") is None:
        raise ImportError(f"{path}: reading USD takes usd-core: install it with pip install 'diff3ds[usd]'")
    return nurbs_sketch(path, "diff3ds.formats.scenes.usd_reader", "usd-core", "USD")
