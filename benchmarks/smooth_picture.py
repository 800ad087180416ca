"""Draws coarse meshes as they are and made smooth: docs/pictures/smooth_surface.png."""

import argparse
from pathlib import Path

import numpy as np
import torch

import diff3ds as ds
from diff3ds.curves.shapes.smooth_joints import sketch_of
from diff3ds.formats import save_png, tile_images
from diff3ds.formats.framing import framed
from diff3ds.surfaces.draw import visible_lines
from diff3ds.surfaces.lines.feature_curves import feature_curves

SIZE, PIXELS_WIDE = 256, 1.6


def turned(profile: list[tuple[float, float]], sections: int, closed: bool = False) -> ds.TriangleMesh:
    """A mesh of points (radius, height) turned round z, which may come back to the first one."""
    radius, height = np.array(profile, float).T
    angle = 2 * np.pi * np.arange(sections) / sections
    points = np.stack([np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))], -1)
    points = np.concatenate([points, np.broadcast_to(height[:, None, None], (*points.shape[:2], 1))], -1)
    index = np.arange(points.shape[0] * sections).reshape(-1, sections)
    a = index if closed else index[:-1]
    b = np.roll(index, -1, 0) if closed else index[1:]
    a, b, c, d = a, np.roll(a, -1, 1), np.roll(b, -1, 1), b
    faces = [np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))]
    return ds.TriangleMesh(points.reshape(-1, 3), np.concatenate(faces))


def meshes() -> list[ds.TriangleMesh]:
    """A cylinder, a torus, a vase and a capsule, of few faces."""
    tube = [(1 + 0.4 * np.cos(t), 0.4 * np.sin(t)) for t in 2 * np.pi * np.arange(10) / 10]
    cap = [(0.5 * np.cos(t), 0.5 * np.sin(t)) for t in np.radians([0, 22.5, 45, 67.5, 90])]
    capsule = [(r, -0.5 - z) for r, z in cap[::-1]] + [(r, 0.5 + z) for r, z in cap]
    vase = [(0, 0), (0.5, 0), (0.58, 0.2), (0.5, 0.4), (0.35, 0.6), (0.28, 0.8), (0.3, 1.0), (0.4, 1.2), (0.55, 1.35)]
    return [
        turned([(0, 0), (0.6, 0), (0.6, 1.2), (0, 1.2)], 12),
        turned(tube, 16, closed=True),
        turned(vase, 16),
        turned(capsule, 12),
    ]


def main() -> None:
    """Draws."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    drawn = []
    for smooth in (False, True):
        for mesh in meshes():
            corners = ds.Sketch(torch.from_numpy(mesh.vertices[:, None].repeat(2, 1)))
            camera = framed(corners, 30.0, 20.0, size=SIZE)
            # Widths are a share of the picture's height.
            curves = sketch_of(feature_curves(mesh).curves, PIXELS_WIDE / SIZE).to(torch.float64)
            shown = ds.smooth_surface(mesh, 0.2 * mesh.size / SIZE) if smooth else mesh
            (lines,) = visible_lines(curves, camera, shown)
            drawn.append(ds.render(lines.drawn("drop"), camera).color[0].float())
    save_png(parser.parse_args().file, tile_images(torch.stack(drawn), columns=len(drawn) // 2))


if __name__ == "__main__":
    main()
