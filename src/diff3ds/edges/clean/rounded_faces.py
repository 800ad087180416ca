"""Lines along the borders of rounded corners: they leave where a line goes on smoothly in an arc, and are no edges."""

import numpy as np
import torch

from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.curves.shapes.primitives import Kind
from diff3ds.curves.shapes.smooth_joints import smooth_joints


def without_rounded_faces(curves: Curves) -> Curves:
    """The curves without lines that end where another line goes on smoothly in an arc.

    The face behind the arc is a part of a cylinder there, and the line its border, or its outline, or a shadow of it.
    """
    joints, vertex = smooth_joints(curves, through=True), curves.vertex.numpy()
    straight = (curves.kind == Kind.LINE).numpy()
    pairs = joints // 2
    pairs = pairs[straight[pairs].sum(1) == 1]
    gone = np.zeros(len(curves), bool)
    for pair in pairs:
        (there,) = np.intersect1d(*vertex[pair])[:1]
        ends_there = (vertex == there).any(1)
        ends_there[pair] = False
        gone |= ends_there & straight
    return curves[torch.from_numpy(~gone)]
