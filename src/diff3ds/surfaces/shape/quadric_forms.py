"""What is inside of quadrics, and behind them from an eye, as quadratic and linear forms of homogeneous points."""

from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.surfaces.shape.quadrics import Quadrics


@dataclass(frozen=True, eq=False)
class Forms:
    """Of N solids, seen from one eye; outside of what torch differentiates.

    Attributes:
        local: to coordinates in which the solid is the unit ball, or a round solid between y3 = -1 and 1.
        inside: quadratic, negative inside (of the whole cone).
        cone: quadratic, zero where the line of sight touches the solid (the whole cone).
        rims: quadratic, zero where the line of sight meets the end circles.
        ends: linear, negative between the ends; zero for ellipsoids, which have none.
        polar: linear, zero where the tangent plane holds the eye, on the solid; positive where it is turned to the eye.
        eye: homogeneous.
        is_round: which are ellipsoids.
    """

    local: Float[Array, "N 4 4"]
    inside: Float[Array, "N 4 4"]
    cone: Float[Array, "N 4 4"]
    rims: Float[Array, "N 2 4 4"]
    ends: Float[Array, "N 2 4"]
    polar: Float[Array, "N 4"]
    eye: Float[Array, " 4"]
    is_round: Bool[Mask, " N"]

    @staticmethod
    def of(solids: Quadrics, eye: Float[Array, " 4"]) -> "Forms":
        """The forms of solids."""
        local, inside = (value.detach().cpu().numpy() for value in (solids.to_local(), solids.forms()))
        polar = inside @ eye
        cone = (polar @ eye)[:, None, None] * inside - polar[:, :, None] * polar[:, None, :]
        taper = solids.taper.detach().double().cpu().numpy()
        is_round = solids.is_round.cpu().numpy()
        seen = local @ eye
        rims, ends = [], []
        for z, radius in ((-1.0, np.ones_like(taper)), (1.0, taper)):
            # The point of the line from the eye to x in the end's plane is linear in x.
            plane = np.array([0.0, 0, 1, -z])
            matrix = (seen @ plane)[:, None, None] * np.eye(4) - seen[:, :, None] * plane
            circle = np.zeros((len(taper), 4, 4))
            circle[:, 0, 0] = circle[:, 1, 1] = 1
            circle[:, 3, 3] = -radius * radius
            form = np.swapaxes(matrix, 1, 2) @ circle @ matrix
            rims.append(np.swapaxes(local, 1, 2) @ form @ local)
            ends.append(z * plane @ local)
        sharp = ~is_round
        return Forms(
            local,
            inside,
            cone,
            np.stack(rims, 1) * sharp[:, None, None, None],
            np.stack(ends, 1) * sharp[:, None, None],
            polar,
            eye,
            is_round,
        )

    def holds(
        self, points: Float[Array, "P 4"], solid: Int[Index, " P"], depth: float | Float[Array, " P"] = 0.0
    ) -> Bool[Mask, " P"]:
        """Whether solids hold points, of which each is asked about one, deeper than a share of their radius."""
        y = np.einsum("pab,pb->pa", self.local[solid], points)
        y = y / y[:, 3:]
        value = np.einsum("pa,pab,pb->p", points, self.inside[solid], points) / points[:, 3] ** 2
        between = self.is_round[solid] | (np.abs(y[:, 2]) < 1 - depth)
        return (value < -2 * depth) & between

    def hide(self, points: Float[Array, "P 4"], solid: Int[Index, " P"], depth: float) -> Bool[Mask, " P"]:
        """Whether a solid lies between each point, of last coordinate 1, and the eye: that deep, of its radius."""
        away = self.eye[None] - points * self.eye[3]
        farthest = 1.0 if self.eye[3] else np.inf
        form, ends = self.inside[solid], self.ends[solid]
        a, b, c = (np.einsum("pa,pab,pb->p", x, form, y) for x, y in ((away, away), (points, away), (points, points)))
        root = np.sqrt(np.maximum(b * b - a * c, 0))
        with np.errstate(divide="ignore", invalid="ignore"):
            # In the form that loses no digits where a is small.
            q = -(b + np.where(b < 0, -root, root))
            stops = [q / a, c / q]
            stops += [
                -np.einsum("pa,pa->p", ends[:, k], points) / np.einsum("pa,pa->p", ends[:, k], away) for k in (0, 1)
            ]
        # Where the line of sight enters or leaves anything; in between one point tells.
        places = np.stack([np.zeros(len(points)), *stops], 1)
        places = np.where(np.isfinite(places), places, 0.0)
        last = np.full(len(points), farthest) if farthest == 1 else np.abs(places).max(1) * 2 + 1
        places = np.sort(np.clip(np.column_stack([places, last]), 0, last[:, None]), axis=1)
        hidden = np.zeros(len(points), bool)
        for k in range(places.shape[1] - 1):
            middle = (places[:, k] + places[:, k + 1]) / 2
            hidden |= (places[:, k + 1] > places[:, k]) & self.holds(points + middle[:, None] * away, solid, depth)
        return hidden
