"""Hidden lines beside OCCT's polygonal removal (HLRBRep_PolyAlgo): the same triangles, the same view, one run.

    python benchmarks/hidden_lines.py [--json FILE]

Orthographic views of generated parts (cad/) and of a torus through a box, whose triangles OCCT has made itself, in two
sizes. Processor seconds of one thread, medians of three, without the triangulation. diff3ds: "first" has the feature
curves and the mesh's index, which are reused from view to view; "view" is contours, cuts and visibility, as curves.
OCCT: reading the shape's triangles, removal, and its straight edges as compounds. The CAD kernel is needed:
pip install 'diff3ds[cad]'.
"""

import argparse
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from cad.boundary import mesh as triangulated
from cad.part import random_part
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeTorus
from OCP.BRepTools import BRepTools
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.HLRAlgo import HLRAlgo_Projector
from OCP.HLRBRep import HLRBRep_PolyAlgo, HLRBRep_PolyHLRToShape
from OCP.TopoDS import TopoDS_Shape
from report import environment, show, write_json

import diff3ds as ds
from diff3ds.curves.shapes.smooth_joints import sketch_of
from diff3ds.surfaces.lines.feature_curves import feature_curves

ROUNDS = 3
# Of triangles from the faces, as a share of the box that a part lies in; finer ones turn by less, too.
DEFLECTIONS = (1e-3, 1e-4)
TOWARDS = (0.6, -0.7, 0.4)


def ring() -> TopoDS_Shape:
    """A torus through a box, in the unit cube."""
    torus = BRepPrimAPI_MakeTorus(gp_Ax2(gp_Pnt(0.5, 0.5, 0.5), gp_Dir(0.3, 0.2, 1)), 0.3, 0.12).Shape()
    return BRepAlgoAPI_Fuse(torus, BRepPrimAPI_MakeBox(gp_Pnt(0.6, 0.4, 0.35), 0.35, 0.2, 0.3).Shape()).Shape()


def by_occt(solid: TopoDS_Shape) -> None:
    """One view, as visible and hidden edges."""
    algorithm = HLRBRep_PolyAlgo()
    algorithm.Load(solid)
    algorithm.Projector(HLRAlgo_Projector(gp_Ax2(gp_Pnt(0.5, 0.5, 0.5), gp_Dir(*TOWARDS))))
    algorithm.Update()
    found = HLRBRep_PolyHLRToShape()
    found.Update(algorithm)
    for edges in (found.VCompound(), found.OutLineVCompound(), found.HCompound(), found.OutLineHCompound()):
        assert edges is None or isinstance(edges, TopoDS_Shape)


def seconds(work: Callable[[], Any]) -> float:
    """The processor time of one thread, in the median."""
    times = []
    for _ in range(ROUNDS):
        begun = time.process_time()
        work()
        times.append(time.process_time() - begun)
    return statistics.median(times)


def row(name: str, solid: TopoDS_Shape, deflection: float) -> dict[str, Any]:
    """One solid."""
    BRepTools.Clean_s(solid)
    triangles = triangulated(solid, deflection, 100 * deflection**0.75)
    mesh = ds.TriangleMesh(triangles.vertices, triangles.triangles)
    eye = torch.tensor([[0.5, 0.5, 0.5]], dtype=torch.float64) + 3 * torch.tensor([TOWARDS], dtype=torch.float64)
    cameras = ds.look_at(eye, (0.5, 0.5, 0.5), height=1.5, size=512).to(torch.float64)
    begun = time.process_time()
    sketch = sketch_of(feature_curves(mesh).curves, 0.006).to(torch.float64)
    ds.visible_lines(sketch, cameras, mesh)
    first = time.process_time() - begun
    view, other = seconds(lambda: ds.visible_lines(sketch, cameras, mesh)), seconds(lambda: by_occt(solid))
    times = {"first": first, "view": view, "occt": other, "ratio": view / other, "ratio_first": first / other}
    return {"solid": name, "faces": len(mesh), **times}


def main() -> None:
    """Measures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    solids = [*((f"part {seed}", random_part(seed).solid) for seed in (0, 3)), ("ring through a box", ring())]
    rows = [row(name, solid, deflection) for name, solid in solids for deflection in DEFLECTIONS]
    show("Hidden lines", [*rows[0]], [[*r.values()] for r in rows])
    if chosen.json:
        write_json(chosen.json, environment(), {"rows": rows})


if __name__ == "__main__":
    main()
