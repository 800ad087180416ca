"""The three axes at right angles that most straight lines of a thing follow (a Manhattan world)."""

from dataclasses import dataclass

import torch

from diff3ds._shapes import Float, Tensor

# A line follows an axis within this angle while axes are looked for, and at the end. Empirical.
WIDE, NARROW = 5.0, 2.0
# Pairs of so many of the longest lines are tried, and the axes of the best are placed so often.
TRIED, ROUNDS = 40, 6


@dataclass(frozen=True, eq=False)
class Axes:
    """What the lines say.

    Attributes:
        axes: unit vectors as rows, right-handed.
        share: of the lines' length that follows each of them.
    """

    axes: Float[Tensor, "3 3"]
    share: Float[Tensor, " 3"]


def line_axes(directions: Float[Tensor, "N 3"], lengths: Float[Tensor, " N"]) -> Axes | None:
    """The axes that as much length as possible follows; None without two lines at right angles.

    Args:
        directions: of the lines, unit vectors of either sign, float64.
        lengths: of the lines.
    """
    longest = lengths.argsort(descending=True)[:TRIED]
    first, second = torch.combinations(longest, 2).unbind(1)
    across = (directions[first] * directions[second]).sum(1).abs() < torch.sin(torch.deg2rad(torch.tensor(WIDE)))
    if not bool(across.any()):
        return None
    tried = _right_angled(directions[first[across]], directions[second[across]])
    close = (tried @ directions.mT).abs().amax(1) > _cos(WIDE)
    axes = tried[int((close * lengths).sum(1).argmax())]
    for turn in range(ROUNDS):
        follows = _followed(axes, directions, WIDE if turn < ROUNDS // 2 else NARROW)
        signed = torch.sign(directions @ axes.mT) * follows * lengths[:, None]
        u, _, v = torch.linalg.svd(signed.mT @ directions)
        # The rotation nearest to the means of what follows each axis.
        axes = u @ torch.diag(directions.new_tensor([1.0, 1.0, float(torch.linalg.det(u @ v))])) @ v
    share = (_followed(axes, directions, NARROW) * lengths[:, None]).sum(0) / lengths.sum()
    return Axes(axes, share)


def _right_angled(first: Float[Tensor, "P 3"], second: Float[Tensor, "P 3"]) -> Float[Tensor, "P 3 3"]:
    third = torch.nn.functional.normalize(torch.linalg.cross(first, second), dim=1)
    return torch.stack([first, torch.linalg.cross(third, first), third], 1)


def _followed(axes: Float[Tensor, "3 3"], directions: Float[Tensor, "N 3"], degrees: float) -> Float[Tensor, "N 3"]:
    """1 where a line follows an axis."""
    return ((directions @ axes.mT).abs() > _cos(degrees)).to(directions.dtype)


def _cos(degrees: float) -> float:
    return float(torch.cos(torch.deg2rad(torch.tensor(degrees, dtype=torch.float64))))
