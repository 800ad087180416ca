"""3DM files with one feature each, for the tables of docs/reference/formats-read.md."""

import math
from pathlib import Path

import pytest
from read_curves import reaches
from read_example import Example


def rhino(draw, unit: str = "Millimeters"):
    def make(folder: Path) -> Path:
        rhino3dm = pytest.importorskip("rhino3dm")
        model = rhino3dm.File3dm()
        model.Settings.ModelUnitSystem = getattr(rhino3dm.UnitSystem, unit)
        draw(rhino3dm, model)
        model.Write(str(folder / "a.3dm"), 7)
        return folder / "a.3dm"

    return make


def rhino_line(r, model, length: float = 1.0, **given) -> None:
    attributes = r.ObjectAttributes()
    for name, value in given.items():
        setattr(attributes, name, value)
    model.Objects.AddLine(r.Point3d(0, 0, 0), r.Point3d(length, 0, 0), attributes)


def rhino_polycurve(r, model) -> None:
    whole = r.PolyCurve()
    whole.Append(r.Line(r.Point3d(-2, 1, 0), r.Point3d(0, 1, 0)))
    whole.Append(r.Arc(r.Point3d(0, 1, 0), r.Point3d(1, 0, 0), r.Point3d(0, -1, 0)))
    model.Objects.AddCurve(whole)


def rhino_hidden(r, model) -> None:
    model.Layers.AddLayer("shown", (0, 0, 0, 255))
    rhino_line(r, model, LayerIndex=0)
    above, below = r.Layer(), r.Layer()
    above.Name, above.Visible, below.Name = "above", False, "below"
    model.Layers.Add(above)
    below.ParentLayerId = model.Layers[1].Id
    model.Layers.Add(below)
    rhino_line(r, model, 50.0, LayerIndex=2)
    rhino_line(r, model, 60.0, Visible=False)
    rhino_line(r, model, 70.0, Mode=r.ObjectMode.Hidden)


def rhino_others(r, model) -> None:
    rhino_line(r, model)
    model.Objects.AddPoint(1, 2, 3)
    model.Objects.AddSphere(r.Sphere(r.Point3d(0, 0, 0), 9))
    model.Objects.AddTextDot("a", r.Point3d(0, 0, 0))


def rhino_blocks(r, model) -> None:
    """A line of 1 along x in a block, at 5 and turned along y in another, at 100 and twice as large."""
    attributes = r.ObjectAttributes()
    inner = model.InstanceDefinitions.Add(
        "inner", "", "", "", r.Point3d(0, 0, 0), (r.LineCurve(r.Point3d(0, 0, 0), r.Point3d(1, 0, 0)),), (attributes,)
    )
    turn = r.Transform.Rotation(math.pi / 2, r.Vector3d(0, 0, 1), r.Point3d(0, 0, 0))
    placed = r.Transform.Multiply(r.Transform.Translation(5, 0, 0), turn)
    reference = r.InstanceReference(model.InstanceDefinitions[inner].Id, placed)
    outer = model.InstanceDefinitions.Add("outer", "", "", "", r.Point3d(0, 0, 0), (reference,), (attributes,))
    whole = r.Transform.Multiply(r.Transform.Translation(100, 0, 0), r.Transform.Scale(r.Point3d(0, 0, 0), 2))
    model.Objects.AddInstanceObject(r.InstanceReference(model.InstanceDefinitions[outer].Id, whole), attributes)


def high_degree(r, model) -> None:
    model.Objects.AddCurve(r.NurbsCurve.Create(False, 5, [r.Point3d(i, i * i % 5, 0) for i in range(6)]))


UNIT_LINE = reaches([0, 0, 0], [1, 0, 0], 1)
RHINO = {
    "lines, polylines": Example(rhino(rhino_line), UNIT_LINE),
    "polycurves": Example(rhino(rhino_polycurve), reaches([-2, -1, 0], [1, 1, 0], 1)),
    "curves of a degree above 3": Example(rhino(high_degree), words="of degree 5"),
    "blocks in blocks": Example(rhino(rhino_blocks), reaches([110, 0, 0], [110, 2, 0], 1)),
    "what is hidden: itself, or by its layer or one above": Example(rhino(rhino_hidden), UNIT_LINE, "3 hidden"),
    "what is locked": Example(rhino(lambda r, m: rhino_line(r, m, Mode=r.ObjectMode.Locked)), UNIT_LINE),
    "points, surfaces, meshes, texts": Example(rhino(rhino_others), UNIT_LINE, "1 NurbsSurface, 1 Point, 1 TextDot"),
    "sheets (layouts)": Example(
        rhino(lambda r, m: (rhino_line(r, m), rhino_line(r, m, 9.0, ActiveSpace=r.ActiveSpace.PageSpace))),
        UNIT_LINE,
        "1 on sheets",
    ),
    "units of length": Example(rhino(rhino_line, "Yards"), reaches([0, 0, 0], [914.4, 0, 0], 1)),
    "no unit: millimetres are assumed": Example(rhino(rhino_line, "None"), UNIT_LINE, "no unit of length"),
}
