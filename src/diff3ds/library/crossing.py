"""The paper's crossing figure: three quadratics that differ in one weight, and a line that passes through them."""

import torch

from diff3ds.camera import Cameras, Size, orbit
from diff3ds.sketch import Sketch

# Of the middle control point: the curve comes close to it, less close, and stays near the chord.
MIDDLE_WEIGHTS = (5.0, 1.5, 0.5)


def crossing_strokes() -> Sketch:
    """Four quadratics: 0 to 2 have the same control points, near on the left and far on the right; 3 is a line.

    The line lies in the plane x = 0 across the view, through which each curve passes at its middle (t = 1/2): left of
    that the curves are in front of the line, right of it behind.
    """
    arch = torch.tensor([[0.5, -0.75, -0.5], [0.0, 0.0, 1.1], [-0.5, 0.9, -0.6]])
    line = torch.tensor([[0.0, -0.92, -0.3], [0.0, 0.0, -0.3], [0.0, 0.92, -0.3]])
    weights = torch.tensor([[1.0, w, 1.0] for w in (*MIDDLE_WEIGHTS, 1.0)])
    colors = torch.tensor([[0.84, 0.37, 0.30], [0.93, 0.66, 0.22], [0.27, 0.62, 0.53], [0.20, 0.27, 0.42]])
    return Sketch(torch.stack([arch, arch, arch, line]), weights, width=0.036, color=colors)


def crossing_cameras(size: Size = (420, 600)) -> Cameras:
    """One view along -x, from three units away."""
    return orbit(0.0, 0.0, 3.0, fov=36.0, size=size, target=(0.0, 0.03, 0.26))
