"""The paper's crossing figure: depth decides at every point of the strokes, and weights change them.

python examples/crossing_figure.py [OUTPUT_FOLDER]

Three quadratics have the same control points (gray) and depths; the weight of the middle one differs. They are near on
the left, where they hide the line, and far on the right, where it hides them.
"""

import sys
from pathlib import Path

import torch

import diff3ds as ds
from diff3ds.library.crossing import crossing_cameras, crossing_strokes


def main(folder: Path) -> None:
    """Writes the picture."""
    strokes, cameras = crossing_strokes(), crossing_cameras()
    # On the rays from the camera to the control points: the picture stays, the depth changes.
    rays = strokes.points[0] - cameras.centers[0]
    far, close = cameras.centers[0] + 2.0 * rays, cameras.centers[0] + 0.5 * rays
    polygon = ds.Sketch(torch.stack([far[:2], far[1:]]), width=0.005, color=(0.7, 0.7, 0.7))
    dots = ds.Sketch(close[:, None].expand(3, 2, 3), width=0.05, color=(0.7, 0.7, 0.7))
    ds.save(folder / "crossing.png", ds.Sketch.concatenate([strokes, polygon, dots]), cameras)


if __name__ == "__main__":
    main(Path(*sys.argv[1:2]))
