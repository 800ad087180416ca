"""Ground truth beside the scenes of NEF's and EMAP's data sets: sharp edges of ABC's models, points of DTU's scans.

DATASET/data/SCENE has a folder beside it in DATASET, as a rule `groundtruth`. That of ABC-NEF has ABC's own files:
meshes `obj/SCENE*.obj`, `chunk_*_feats.json` (curves along their vertices), `chunk_*_stats.json` (their boxes). That of
DTU has `edge_points/SCENE/edge_points.ply`, and the scene's meta_data.json `worldtogt`, from its world to millimetres.
"""

from glob import escape
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from diff3ds._files import read_json, read_text
from diff3ds.metrics.curve_scores import Points, resampled
from diff3ds.photogrammetry.point_files import load_points
from diff3ds.photogrammetry.programs.meta_data import NAME

# Millimetres in what the scores take for a metre.
METRE = 1000.0


def emap_truth(scene: Path) -> tuple[Points, float] | None:
    """Points (n, 3) on the true edges of a scene, in metres, and the length of a metre in its world; None without such.

    Of ABC's models the longest side of the box, which is 1 in their scenes, with its middle in (.5, .5, .5), counts as
    a metre; DTU's scans are as large as they were.

    Args:
        scene: folder with the pictures.

    Raises:
        ValueError: damaged files.
    """
    scene = scene.resolve()
    for feats in _beside(scene, "chunk_*_feats.json"):
        curves = _object(feats).get(scene.name)
        if curves is not None and (points := _abc(feats, scene.name, curves)) is not None:
            return points, 1.0
    for file in _beside(scene, f"edge_points/{escape(scene.name)}/edge_points.ply"):
        return _dtu(file, scene / NAME)
    return None


def _beside(scene: Path, pattern: str) -> list[Path]:
    """Files in the folders beside a scene, or beside the folder that it is in."""
    return sorted(chain(*(folder.glob(f"*/{pattern}") for folder in scene.parents[:2])))


def _abc(feats: Path, name: str, curves: Any) -> Points | None:
    """Points along the sharp curves of a model, in a box whose longest side is 1; None if it has no sharp ones."""
    low, span = _box(feats, name)
    if not isinstance(curves, list) or not all(isinstance(c, dict) and "sharp" in c for c in curves):
        raise ValueError(f'{feats}: {name} is no list of curves with "sharp" and "vert_indices"')
    sharp = [curve.get("vert_indices") for curve in curves if curve["sharp"]]
    if not sharp:
        return None
    file = _mesh(feats.parent / "obj", name)
    vertices = (_vertices(file) - (low + span / 2)) / span.max() + 0.5
    polylines = []
    for indices in sharp:
        whole = isinstance(indices, list) and all(type(i) is int and 0 <= i < len(vertices) for i in indices)
        if not whole or len(indices) < 2:
            raise ValueError(f"{feats}: a sharp curve of {name} has no vert_indices of vertices of {file.name}")
        polylines.append(resampled(vertices[indices]))
    return np.concatenate(polylines)


def _box(feats: Path, name: str) -> tuple[Points, Points]:
    """The least corner and the sides of a model's box."""
    stats = feats.with_name(feats.name.replace("_feats", "_stats"))
    if not stats.is_file():
        raise ValueError(f"{feats}: beside it {stats.name} is missing, with the boxes of the models")
    try:
        box = np.asarray(_object(stats)[name]["bbox"], np.float64)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{stats}: no bbox of {name}") from error
    if box.shape != (9,) or not np.isfinite(box).all() or not (box[6:] >= 0).all() or not box[6:].max() > 0:
        raise ValueError(f"{stats}: the bbox of {name} is nine numbers: least and greatest corner, and the sides")
    return box[:3], box[6:]


def _mesh(folder: Path, name: str) -> Path:
    files = sorted(folder.glob(f"{escape(name)}*.obj"))
    if len(files) != 1:
        raise ValueError(f"{folder}: {len(files)} files {name}*.obj, where the mesh of the model is needed")
    return files[0]


def _vertices(file: Path) -> Points:
    rows = [line.split()[1:4] for line in read_text(file).splitlines() if line.startswith("v ")]
    try:
        vertices = np.array(rows, np.float64).reshape(-1, 3)
    except ValueError as error:
        raise ValueError(f"{file}: damaged, a vertex is not three numbers") from error
    if not np.isfinite(vertices).all():
        raise ValueError(f"{file}: damaged, a vertex is not finite")
    return vertices


def _dtu(file: Path, cameras: Path) -> tuple[Points, float]:
    """Points in metres along the axes of the scene, and the length of a metre in its world."""
    if not cameras.is_file():
        raise ValueError(f"{file}: in millimetres, and no {cameras} says how the scene lies there (worldtogt)")
    try:
        matrix = np.asarray(_object(cameras)["worldtogt"], np.float64)
        turn, shift = matrix[:3, :3], matrix[:3, 3]
        scale = float(np.cbrt(np.linalg.det(turn))) if matrix.shape in ((3, 4), (4, 4)) else 0.0
        even = scale > 0 and np.allclose(turn @ turn.T, scale**2 * np.eye(3), atol=1e-3 * scale**2)
    except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
        raise ValueError(f"{cameras}: no worldtogt of 4x4 numbers, which {file} needs") from error
    if not even or not np.isfinite(shift).all():
        raise ValueError(f"{cameras}: worldtogt does not turn, scale and move alone")
    points = load_points(file).numpy()
    if not len(points):
        raise ValueError(f"{file}: no points in it")
    return (points - shift) @ (turn / scale) / METRE, METRE / scale


def _object(path: Path) -> dict[str, Any]:
    content = read_json(path)
    if not isinstance(content, dict):
        raise ValueError(f"{path}: not an object of JSON with an entry for each scene")
    return content
