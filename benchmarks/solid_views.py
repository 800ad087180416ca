"""Drawings of a STEP assembly by diff3ds mesh beside OCCT's exact hidden-line removal (HLRBRep_Algo).

    python benchmarks/solid_views.py [--file STEP] [--views 12] [--json FILE]

Orthographic views from all around, 512 pixels. The length of visible lines of one drawing that has a line of the other
within half a pixel, and the other way round; sharp edges, smooth ones (tangent) and outlines. By default the bracket of
cad/assembly.py. The CAD kernel is needed: pip install 'diff3ds[cad]'.
"""

import argparse
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from cad.assembly import write_assembly
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepLib import BRepLib
from OCP.GCPnts import GCPnts_QuasiUniformDeflection
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.HLRAlgo import HLRAlgo_Projector
from OCP.HLRBRep import HLRBRep_Algo, HLRBRep_HLRToShape
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Shape
from report import environment, show, write_json
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds.project import project
from diff3ds.surfaces.form.solid_mesh import Solid, load_solid

SIZE, NEAR, STEP = 512, 0.5, 0.2


def read(path: Path) -> TopoDS_Shape:
    """A STEP file as one shape."""
    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    reader.TransferRoots()
    return reader.OneShape()


def views_of(solid: Solid, count: int) -> ds.Cameras:
    """Views from all around, on a spiral, none of them along an axis."""
    low, high = solid.mesh.bounds
    reach = float(np.linalg.norm(high - low))
    step = np.arange(count) + 0.5
    azimuth = np.degrees(np.pi * (1 + 5**0.5) * step) + 7
    elevation = np.degrees(np.arcsin(1 - 2 * step / count))
    return ds.orbit(
        azimuth.tolist(),
        elevation.tolist(),
        2 * reach,
        height=1.05 * reach,
        size=SIZE,
        target=((low + high) / 2).tolist(),
    ).to(torch.float64)


def of_occt(shape: TopoDS_Shape, camera: ds.Cameras) -> dict[str, np.ndarray]:
    """Visible lines by kind, as chords (n, 2, 2), pixels."""
    pose = camera.world_to_camera[0].double().numpy()
    turn, centre = pose[:3, :3], -pose[:3, :3].T @ pose[:3, 3]
    algorithm = HLRBRep_Algo()
    algorithm.Add(shape, 0)
    frame = gp_Ax2(gp_Pnt(*centre), gp_Dir(*-turn[2]), gp_Dir(*turn[0]))
    algorithm.Projector(HLRAlgo_Projector(frame))
    algorithm.Update()
    algorithm.Hide()
    found = HLRBRep_HLRToShape(algorithm)
    scale = float(camera.intrinsics[0, 0, 0])
    kinds = {"sharp": found.VCompound(), "smooth": found.Rg1LineVCompound(), "outline": found.OutLineVCompound()}
    return {kind: _chords(edges, 0.02 / scale) * [scale, -scale] + SIZE / 2 for kind, edges in kinds.items()}


def _chords(edges: TopoDS_Shape | None, deflection: float) -> np.ndarray:
    chords = []
    if edges is not None and not edges.IsNull():
        BRepLib.BuildCurves3d_s(edges)
        explorer = TopExp_Explorer(edges, TopAbs_EDGE)
        while explorer.More():
            edge = TopoDS.Edge(explorer.Current())
            explorer.Next()
            points = GCPnts_QuasiUniformDeflection(BRepAdaptor_Curve(edge), deflection)
            line = np.array([(points.Value(i).X(), points.Value(i).Y()) for i in range(1, points.NbPoints() + 1)])
            chords.append(np.stack([line[:-1], line[1:]], 1))
    return np.concatenate([np.zeros((0, 2, 2)), *chords])


def of_sketch(sketch: ds.Sketch, camera: ds.Cameras) -> np.ndarray:
    """Strokes as chords, pixels."""
    cubics = project(sketch.detach(), camera).cubics[0]
    t = torch.linspace(0, 1, 33, dtype=torch.float64)
    line = ds.bezier.evaluate(cubics[..., :2] / cubics[..., 2:3], cubics[..., 2], t).numpy()
    return np.stack([line[:, :-1], line[:, 1:]], 2).reshape(-1, 2, 2)


def points_on(chords: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points along chords, and the length of line that each stands for."""
    length = np.linalg.norm(chords[:, 1] - chords[:, 0], axis=1)
    count = np.maximum(np.ceil(length / STEP).astype(int), 1)
    row = np.repeat(np.arange(len(chords)), count)
    place = (np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[row]
    points = chords[row, 0] * (1 - place[:, None]) + chords[row, 1] * place[:, None]
    return points, (length / count)[row]


def agreement(one: np.ndarray, other: np.ndarray) -> tuple[float, float, np.ndarray]:
    """The length of one drawing that the other has, the whole length, and points that it has not."""
    points, weight = points_on(one)
    if not len(points):
        return 0.0, 0.0, points
    there = points_on(other)[0]
    near = cKDTree(there).query(points)[0] <= NEAR if len(there) else np.zeros(len(points), bool)
    return float(weight[near].sum()), float(weight.sum()), points[~near]


def compare(solid: Solid, shape: TopoDS_Shape, cameras: ds.Cameras) -> list[dict[str, Any]]:
    """Each view: shares of length that agree, and where they do not."""
    begun = time.perf_counter()
    drawn = ds.visible_lines(solid.edges, cameras, solid.mesh, kinds=solid.kinds)
    ours = (time.perf_counter() - begun) / len(cameras)
    rows = []
    for view, lines in enumerate(drawn):
        begun = time.perf_counter()
        occt = np.concatenate([*of_occt(shape, cameras[view]).values()])
        theirs = time.perf_counter() - begun
        mine = of_sketch(lines.strokes(True), cameras[view])
        shown, whole, missing = agreement(occt, mine)
        true, all_mine, extra = agreement(mine, occt)
        rows.append(
            {
                "view": view + 1,
                "pixels of OCCT's": whole,
                "drawn": shown / whole,
                "true": true / max(all_mine, 1e-9),
                "s": ours,
                "s of OCCT": theirs,
                "missing": missing,
                "extra": extra,
            }
        )
    return rows


def main() -> None:
    """Measures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--file", type=Path)
    parser.add_argument("--views", type=int, default=12)
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = chosen.file or Path(folder) / "assembly.step"
        shape = read(path) if chosen.file else write_assembly(path)
        solid = load_solid(path, "z")
    rows = compare(solid, shape, views_of(solid, chosen.views))
    for row in rows:
        row |= {"missing": len(row["missing"]) * STEP, "extra": len(row["extra"]) * STEP}
    show("Solids beside OCCT's exact hidden lines", [*rows[0]], [[*row.values()] for row in rows])
    weight = np.array([row["pixels of OCCT's"] for row in rows])
    print({name: float(np.average([row[name] for row in rows], weights=weight)) for name in ("drawn", "true")})
    if chosen.json:
        write_json(chosen.json, environment(), {"rows": rows})


if __name__ == "__main__":
    main()
