"""DXF files with one feature each, for the tables of docs/reference/formats-read.md."""

from pathlib import Path

import numpy as np
import pytest
import torch
from read_curves import box, on_circle, reaches
from read_example import Example

import diff3ds as ds


def dxf(draw, version: str = "R2010", units: int = 4, **how):
    """A DXF file on which a function draws; `how` is that of ezdxf's saveas."""

    def make(folder: Path) -> Path:
        ezdxf = pytest.importorskip("ezdxf")
        document = ezdxf.new(version)
        document.header["$INSUNITS"] = units
        draw(document)
        document.saveas(folder / "a.dxf", **how)
        return folder / "a.dxf"

    return make


def in_block(draw, references, flags=None):
    """Draws in a block "b", and references to it with these attributes."""

    def all_of(document) -> None:
        block = document.blocks.new("b", dxfattribs=flags or {})
        draw(block)
        for place, given in references:
            document.modelspace().add_blockref("b", place, dxfattribs=given)

    return all_of


def line(space, **given) -> None:
    space.add_line((0, 0), (1, 0), dxfattribs=given)


def line_of(document) -> None:
    line(document.modelspace())


def and_line(draw):
    """A line beside what a function draws in the model space."""

    def all_of(document) -> None:
        line_of(document)
        draw(document.modelspace())

    return all_of


def circle_in_block(block) -> None:
    block.add_circle((1, 0), 1)


def framed_polyline(document) -> None:
    """As AutoCAD fits one by a spline: the vertices with flag 16 are its frame, which is not drawn."""
    polyline = document.modelspace().add_polyline2d([(0, 0), (1, 9), (0, 0), (1, 0)], dxfattribs={"flags": 4})
    for vertex, flags in zip(polyline.vertices, (16, 16, 8, 8), strict=True):
        vertex.dxf.flags = flags


def nested(document) -> None:
    """A circle stretched twice in a block that is turned by 45 degrees in another: an ellipse, at an angle, sheared."""
    circle_in_block(document.blocks.new("inner"))
    document.blocks.new("outer").add_blockref("inner", (0, 0), dxfattribs={"rotation": 45.0, "xscale": 2.0})
    document.modelspace().add_blockref("outer", (10, 0), dxfattribs={"yscale": 3.0})


def sheared(found: ds.Sketch) -> bool:
    t = torch.linspace(0, 1, 9, dtype=torch.float64)
    on = ds.bezier.evaluate(found.points, found.weights, t).reshape(-1, 3).numpy()[:, :2]
    turn = np.array([[1.0, -1], [1, 1]]) / np.sqrt(2)
    back = np.linalg.solve(np.diag([1.0, 3]) @ turn @ np.diag([2.0, 1]), (on - [10, 0]).T).T
    return bool(np.allclose(np.linalg.norm(back - [1, 0], axis=1), 1))


def hidden_dxf(document) -> None:
    space = document.modelspace()
    line(space)
    document.layers.add("off").off()
    document.layers.add("frozen").freeze()
    for given in ({"layer": "off"}, {"layer": "frozen"}, {"invisible": 1}):
        space.add_line((0, 0), (50, 0), dxfattribs=given)


def colors_dxf(document) -> None:
    """By block, of red references; on layer 0 in it, which is that of the reference, green; by its own layer, blue."""
    document.layers.add("green", color=3)
    document.layers.add("blue", color=5)
    block = document.blocks.new("b")
    for given in ({"color": 0}, {"layer": "0"}, {"layer": "blue"}):
        line(block, **given)
    document.modelspace().add_blockref("b", (0, 0), dxfattribs={"layer": "green", "color": 1})


def others_dxf(space) -> None:
    space.add_text("a")
    space.add_mtext("b")
    space.add_point((0, 0))
    space.add_3dface([(0, 0), (9, 0), (9, 9)])
    space.add_solid([(0, 0), (9, 0), (9, 9)])
    space.add_hatch().paths.add_polyline_path([(0, 0), (9, 0), (9, 9)])
    space.add_ray((0, 0), (1, 1))
    space.add_linear_dim(base=(0, 2), p1=(0, 0), p2=(9, 0)).render()


OTHERS = "1 3DFACE, 1 DIMENSION, 1 HATCH, 1 MTEXT, 1 POINT, 1 RAY, 1 SOLID, 1 TEXT"


def sheet(document) -> None:
    line_of(document)
    document.layout("Layout1").add_line((0, 0), (9, 0))


def clipped(document) -> None:
    from ezdxf.xclip import XClip

    block = document.blocks.new("b")
    line(block)
    XClip(document.modelspace().add_blockref("b", (0, 0))).set_block_clipping_path([(0, 0), (0.5, 0.5)])


def dwg(folder: Path) -> Path:
    (folder / "a.dxf").write_bytes(b"AC1032\0\0\0\0")
    return folder / "a.dxf"


def cp1252(document) -> None:
    document.layers.add("Maß", color=1)
    line(document.modelspace(), layer="Maß")


def without(what: str, then: str):
    """A DXF file of a line from whose text something is taken."""

    def make(folder: Path) -> Path:
        path = dxf(line_of)(folder)
        content = path.read_text()
        assert what in content
        path.write_text(content.replace(what, then))
        return path

    return make


ELLIPSE = {"center": (1, 0), "major_axis": (2, 0), "ratio": 0.5}
UNIT_LINE = reaches([0, 0, 0], [1, 0, 0], 1)
FIT = [(0, 0), (1, 1), (2, 0), (3, 1)]


def closed_spline(space) -> None:
    space.add_spline().set_closed([(0, 0, 0), (6, 0, 0), (6, 6, 0), (0, 6, 0)], degree=3)


DXF = {
    "lines, arcs and circles, seen from below too": Example(
        dxf(lambda d: d.modelspace().add_arc((-1, 2), 3, 0, 90, dxfattribs={"extrusion": (0, 0, -1)})),
        on_circle((1, 2, 0), 3.0, 90.0),
    ),
    "ellipses": Example(dxf(lambda d: d.modelspace().add_ellipse(**ELLIPSE)), reaches([-1, -1, 0], [3, 1, 0], 1)),
    "polylines in a plane, with bulges": Example(
        dxf(lambda d: d.modelspace().add_lwpolyline([(0, 0, 1), (2, 0, 1)], format="xyb", close=True)),
        on_circle((1, 0, 0), 1.0),
    ),
    "polylines in space": Example(
        dxf(lambda d: d.modelspace().add_polyline3d([(0, 0, 0), (1, 0, 2), (1, 3, 0)])),
        reaches([0, 0, 0], [1, 3, 2], 2),
    ),
    "polylines fitted by splines, without their frame": Example(dxf(framed_polyline), UNIT_LINE),
    "splines: rational, closed, knots that are not clamped": Example(
        dxf(lambda d: closed_spline(d.modelspace())), reaches([0.25, 0.25, 0], [5.75, 5.75, 0], 1)
    ),
    "splines of points to go through alone": Example(
        dxf(lambda d: d.modelspace().add_spline(FIT)), lambda found: box(found)[1][0] == 3 and len(found) == 1
    ),
    "splines of a degree above 3": Example(
        dxf(lambda d: d.modelspace().add_open_spline([(i, i % 2) for i in range(9)], degree=5)), words="of degree 5"
    ),
    "multilines, helices": Example(
        dxf(lambda d: d.modelspace().add_mline([(0, 0), (4, 0)])), reaches([0, -1, 0], [4, 0, 0], 2)
    ),
    "blocks in blocks: turned, stretched, mirrored, sheared": Example(dxf(nested), sheared),
    "arrays of blocks": Example(
        dxf(
            in_block(
                circle_in_block,
                [((0, 0), {"row_count": 2, "column_count": 3, "row_spacing": 5, "column_spacing": 4})],
            )
        ),
        reaches([0, -1, 0], [10, 6, 0], 6),
    ),
    "colours: of entities, layers, blocks": Example(
        dxf(colors_dxf), lambda found: found.color.tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    ),
    "what layers that are off or frozen hide, invisible entities": Example(dxf(hidden_dxf), UNIT_LINE, "3 hidden"),
    "layers that do not print": Example(
        dxf(lambda d: (setattr(d.layers.add("a").dxf, "plot", 0), line(d.modelspace(), layer="a"))), UNIT_LINE
    ),
    "sheets (paper space)": Example(dxf(sheet), UNIT_LINE, "1 on sheets"),
    "texts, dimensions, hatches, faces, solids, points, rays": Example(dxf(and_line(others_dxf)), UNIT_LINE, OTHERS),
    "references to other drawings": Example(
        dxf(lambda d: (line_of(d), d.add_xref_def("x.dxf", "x"), d.modelspace().add_blockref("x", (0, 0)))),
        UNIT_LINE,
        "1 references to other files",
    ),
    "references to blocks that are missing": Example(
        dxf(lambda d: (line_of(d), d.modelspace().add_blockref("none", (0, 0)))), UNIT_LINE, "1 references to missing"
    ),
    "clipped block references: they are read whole": Example(dxf(clipped), UNIT_LINE, "1 clipped block references"),
    "units of length": Example(dxf(line_of, units=10), reaches([0, 0, 0], [914.4, 0, 0], 1)),
    "no unit: millimetres are assumed": Example(dxf(line_of, units=0), UNIT_LINE, "no unit of length"),
    "binary files": Example(dxf(line_of, fmt="bin"), UNIT_LINE),
    "versions R12 to R2018": Example(dxf(line_of, "R2018"), UNIT_LINE),
    "code pages": Example(dxf(cp1252, "R2000", encoding="cp1252"), reaches([0, 0, 0], [1, 0, 0], 1, [1, 0, 0])),
    "files that are broken a little": Example(without("SECTION\n  2\nOBJECTS", "SECTION\n  2\nOBJECT"), UNIT_LINE),
    "DWG under the name of a DXF file": Example(dwg, words="a DWG file"),
}
