"""Strokes of smooth meshes against line drawings of them from sides that no fit has seen.

    python benchmarks/smooth_meshes.py [--strokes 12 24 48] [--json FILE]

A duck and a jug, made here, and spot.obj where the data for development are. Figures: mean distances between the
lines of a drawing (visible contours and features) and the strokes, both ways, over twelve views, in thousandths of the
diagonal of the mesh's box, and their mean (chamfer). Strokes before and after the fit, all of them drawn; and after it
with contours and without hidden lines. Beside them 3Doodle's way (Choi et al. 2024): single cubics that start
at points spread over the surface, as many as the strokes have cubics, moved by gradients through pictures of the
drawings; without its superquadrics, and with the pictures' difference, blurred at first, in place of its networks.
"""

import argparse
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from report import environment, show, write_json

import diff3ds as ds
from diff3ds.pictures.frame import Frame
from diff3ds.surfaces.chosen_strokes import choose_strokes
from diff3ds.surfaces.draw import visible_lines
from diff3ds.surfaces.fitted_strokes import fit_strokes
from diff3ds.surfaces.line_drawings import MARGIN, SIZE, all_around, mean_distances, points_along
from diff3ds.surfaces.shape.level_set import level_set
from diff3ds.surfaces.shape.smooth_surface import smooth_for_pictures

# Points of the grid along each axis, and half its side.
SIDE, REACH = 40, 1.2
# Of strokes in pictures, a share of their height.
WIDTH = 0.012
# Views that no fit has seen: turned by so many degrees.
HELD_OUT, TURN = 12, 40.0
# Views that fits see.
FITTED = 24
# 3Doodle's way: steps, views of a step, Adam's rate for a mesh of radius one, the blur's fall in pixels. Empirical: of
# rates of .002, .005 and .015 the best, with the loss that edge maps are fitted with; a symmetric one leaves dots.
STEPS, BATCH, RATE, BLURS = 1000, 4, 0.005, (6.0, 0.7)
Values = np.ndarray


def duck() -> ds.TriangleMesh:
    """A body, a neck, a head with a bill, a tail and wings, blended."""
    p, spacing = _grid()
    solid = _ellipsoid(p, (0, 0, -0.35), (0.85, 0.5, 0.42))
    solid = _blended(solid, _cone(p, (0.45, 0, -0.1), (0.5, 0, 0.45), 0.26, 0.2), 0.15)
    solid = _blended(solid, _ellipsoid(p, (0.55, 0, 0.55), (0.3, 0.26, 0.27)), 0.1)
    solid = _blended(solid, _ellipsoid(p, (0.88, 0, 0.5), (0.2, 0.13, 0.06)), 0.05)
    solid = _blended(solid, _cone(p, (-0.6, 0, -0.2), (-1.0, 0, 0.1), 0.25, 0.06), 0.15)
    for side in (-0.45, 0.45):
        solid = _blended(solid, _ellipsoid(p, (-0.1, side, -0.28), (0.42, 0.12, 0.22)), 0.06)
    return level_set(-solid, np.full(3, -REACH), spacing, crease=180.0)


def jug() -> ds.TriangleMesh:
    """A turned body with a handle."""
    p, spacing = _grid()
    x, y, z = np.moveaxis(p, -1, 0)
    profile = 0.42 + 0.22 * np.cos(3 * (z + 0.25)) + 0.18 * np.clip(z - 0.55, 0, 1)
    body = np.maximum(0.8 * (np.hypot(x, y) - profile), np.abs(z) - 0.9)
    handle = np.hypot(np.hypot(x - 0.5, z - 0.1) - 0.42, y) - 0.08
    return level_set(-_blended(body, handle, 0.08), np.full(3, -REACH), spacing, crease=180.0)


def _grid() -> tuple[Values, float]:
    axis = np.linspace(-REACH, REACH, SIDE)
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1), float(axis[1] - axis[0])


def _blended(one: Values, other: Values, reach: float) -> Values:
    """The smooth minimum of distances (Quilez)."""
    share = np.clip(0.5 + 0.5 * (other - one) / reach, 0, 1)
    return other * (1 - share) + one * share - reach * share * (1 - share)


def _ellipsoid(p: Values, center: tuple[float, ...], radii: tuple[float, ...]) -> Values:
    """Nearly the distance from an ellipsoid."""
    q = (p - np.array(center)) / np.array(radii)
    size, slope = np.linalg.norm(q, axis=-1), np.linalg.norm(q / np.array(radii), axis=-1)
    return size * (size - 1) / np.maximum(slope, 1e-9)


def _cone(p: Values, start: tuple[float, ...], stop: tuple[float, ...], first: float, last: float) -> Values:
    """Nearly the distance from a cone with round ends."""
    a, way = np.array(start), np.array(stop) - np.array(start)
    t = np.clip((p - a) @ way / (way @ way), 0, 1)
    return np.linalg.norm(p - a - t[..., None] * way, axis=-1) - (first + (last - first) * t)


def rows(name: str, mesh: ds.TriangleMesh, counts: list[int]) -> list[dict[str, Any]]:
    """One mesh with several numbers of strokes."""
    mesh = smooth_for_pictures(mesh, SIZE)
    nothing = ds.Sketch(torch.zeros(0, 4, 3, dtype=torch.float64))
    cameras = all_around(mesh, HELD_OUT, TURN)
    drawings = [points_along(visible_lines(nothing, c, mesh)[0].strokes(True), c) for c in _each(cameras)]

    def distances(sketch: ds.Sketch, surface: bool = False) -> dict[str, float]:
        pairs = []
        for drawing, camera in zip(drawings, _each(cameras), strict=True):
            drawn = visible_lines(sketch, camera, mesh)[0].strokes(True) if surface else sketch
            pairs.append(mean_distances(drawing, points_along(drawn, camera)))
        missing, extra = 1000 * MARGIN / cameras.size[0] * np.mean(pairs, axis=0)
        return {"missing": float(missing), "extra": float(extra), "chamfer": float(missing + extra) / 2}

    around = all_around(mesh, FITTED)
    seen = [visible_lines(nothing, c, mesh)[0].strokes(True) for c in _each(around)]
    found: list[dict[str, Any]] = []
    begun = time.process_time()
    # In the order in which they are taken: the first ones are what a smaller budget gives.
    ordered = choose_strokes(mesh, nothing, [], max(counts), False).sketch
    choosing = time.process_time() - begun
    for count in sorted({min(c, len(ordered)) for c in counts}):
        begun = time.process_time()
        start = ordered[:count]
        fitted = fit_strokes(mesh, nothing, start, 0)
        seconds = choosing + time.process_time() - begun
        before, after, whole = distances(start), distances(fitted), distances(fitted, True)
        other = distances(as_3doodle(mesh, seen, around, len(fitted.points)))
        found.append(
            {
                "mesh": name, "faces": len(mesh), "strokes": count, "seconds": seconds,
                **{f"before_{k}": v for k, v in before.items()}, **after,
                **{f"contours_{k}": v for k, v in whole.items()},
                "cubics": len(fitted.points), **{f"doodle_{k}": v for k, v in other.items()},
            }
        )  # fmt: skip
        print(found[-1], flush=True)
    return found


def as_3doodle(mesh: ds.TriangleMesh, drawings: list[ds.Sketch], cameras: ds.Cameras, count: int) -> ds.Sketch:
    """So many cubics from points far from each other on the surface, fitted to pictures of its drawings."""
    low, high = mesh.bounds
    frame = Frame(torch.from_numpy((low + high) / 2), float(np.linalg.norm(high - low)) / 2)
    generator = np.random.default_rng(0)
    chosen, far = [int(generator.integers(len(mesh.vertices)))], np.full(len(mesh.vertices), np.inf)
    for _ in range(count - 1):
        far = np.minimum(far, np.linalg.norm(mesh.vertices - mesh.vertices[chosen[-1]], axis=1))
        chosen.append(int(far.argmax()))
    first = (torch.from_numpy(mesh.vertices[chosen]) - frame.center) / frame.radius
    steps = 0.001 + 0.01 * torch.from_numpy(generator.random((count, 3, 3)))
    points = torch.cat([first[:, None], first[:, None] + steps.cumsum(1)], 1)
    start = ds.Sketch(points, width=torch.full((count,), WIDTH, dtype=torch.float64))
    views = frame.cameras(cameras)
    lines = [frame.from_world(drawing) for drawing in drawings]
    shown = [replace(drawing, width=torch.full_like(drawing.width, WIDTH)) for drawing in lines]

    def blur(step: int) -> ds.Analytic:
        return ds.Analytic(float(BLURS[0] * (BLURS[1] / BLURS[0]) ** (step / STEPS)))

    def objective(rendering: ds.Rendering, _: ds.Cameras, step: int) -> torch.Tensor:
        rows = picked[step % len(picked)]
        with torch.no_grad():
            target = torch.cat([ds.render(shown[v], views[v], antialiasing=blur(step)).alpha for v in rows])
        return ds.losses.ink_loss(rendering.alpha, target)

    picked = [generator.choice(len(drawings), BATCH, replace=False).tolist() for _ in range(STEPS)]
    config = ds.FitConfig(steps=STEPS, rates=ds.Rates(points=RATE), antialiasing=blur)
    for done in ds.fit(start, objective, lambda step, _: views[picked[step]], config):
        sketch = done.sketch
    return frame.to_world(sketch.detach())


def _each(cameras: ds.Cameras) -> list[ds.Cameras]:
    return [cameras[view] for view in range(len(cameras))]


def main() -> None:
    """Measures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strokes", type=int, nargs="+", default=[12, 24, 48])
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    meshes = {"duck": duck(), "jug": jug()}
    spot = Path(os.environ.get("DIFF3DS_DATA", "../shared/data")) / "meshes" / "spot.obj"
    if spot.is_file():
        meshes["spot"] = ds.load_surface(spot, up="y", crease=180.0)
    else:
        print(f"{spot} is not there: without spot")
    found = [row for name, mesh in meshes.items() for row in rows(name, mesh, chosen.strokes)]
    columns = ("mesh", "strokes", "before_chamfer", "missing", "extra", "chamfer", "contours_chamfer")
    columns += ("cubics", "doodle_missing", "doodle_extra", "doodle_chamfer", "seconds")
    show("Smooth meshes", columns, [tuple(row[c] for c in columns) for row in found])
    if chosen.json:
        write_json(chosen.json, environment(), {"rows": found})


if __name__ == "__main__":
    main()
