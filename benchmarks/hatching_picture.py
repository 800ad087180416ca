"""Draws hatched things: docs/pictures/hatching.png."""

import argparse
from pathlib import Path

import torch
from smooth_picture import turned

import diff3ds as ds
from diff3ds.curves.shapes.smooth_joints import sketch_of
from diff3ds.formats import save_png, tile_images
from diff3ds.formats.framing import framed
from diff3ds.surfaces.draw import visible_lines
from diff3ds.surfaces.lines.feature_curves import feature_curves

SIZE, PIXELS_WIDE, SPACING = 480, 1.8, 5.0


def meshes() -> list[ds.TriangleMesh]:
    """A ring, a vase and a nut."""
    tube = [(1 + 0.4 * torch.tensor(t).cos().item(), 0.4 * torch.tensor(t).sin().item()) for t in _around(24)]
    vase = [(0, 0), (0.5, 0), (0.58, 0.2), (0.5, 0.4), (0.35, 0.6), (0.28, 0.8), (0.3, 1.0), (0.4, 1.2), (0.55, 1.35)]
    nut = [(0.5, 0.0), (1.0, 0.0), (1.0, 0.6), (0.5, 0.6)]
    return [turned(tube, 48, closed=True), turned(vase, 32), turned(nut, 6, closed=True)]


def _around(count: int) -> list[float]:
    return [2 * torch.pi * k / count for k in range(count)]


def main() -> None:
    """Draws."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    drawn = []
    for mesh in meshes():
        corners = ds.Sketch(torch.from_numpy(mesh.vertices[:, None].repeat(2, 1)))
        camera = framed(corners, 30.0, 30.0, size=SIZE)
        curves = sketch_of(feature_curves(mesh).curves, PIXELS_WIDE / SIZE).to(torch.float64)
        (lines,) = visible_lines(
            curves, camera, ds.smooth_surface(mesh, 0.2 * mesh.size / SIZE), hatch=ds.Hatch(spacing=SPACING)
        )
        drawn.append(ds.render(lines.drawn("drop"), camera).color[0].float())
    save_png(parser.parse_args().file, tile_images(torch.stack(drawn), columns=len(drawn)))


if __name__ == "__main__":
    main()
