"""What no plane, cylinder, cone, sphere or torus explains: free-form regions, as quadrics through their samples."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.surfaces.form.form_kinds import FormKind
from diff3ds.surfaces.form.samples import Samples

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

# Neighbouring samples of a free-form region turn by less than this, radians. Empirical.
SMOOTH = 0.5
# A region has at least so many samples, so large a share of them not beside a form. Empirical.
LEAST, DEEP = 40, 0.1
# Samples to which a quadric is fitted: with no noise, and at most; noise of so many spacings asks for twice as many.
NEAREST, MOST, NOISY = 20, 100, 0.1
# Pull of a quadric's bends towards a plane, relative to the number of samples: decides where noise hides them.
FLAT = 1e-3
NONE = -1


@dataclass(frozen=True, eq=False)
class FreeForm:
    """A region of a surface of which nothing is known but its samples; like `Form` for what only asks for distances.

    Attributes:
        points, normals: of its samples.
        count: how many of them say where it is near to a point.
    """

    points: Float[Array, "M 3"]
    normals: Float[Array, "M 3"]
    count: int
    kind = FormKind.FREE

    @cached_property
    def _tree(self) -> "cKDTree":
        from scipy.spatial import cKDTree

        return cKDTree(self.points)

    def distance(self, points: Float[Array, "S 3"]) -> Float[Array, " S"]:
        """Signed distances, positive on the side of the normals."""
        return self.placed(points)[0]

    def normal(self, points: Float[Array, "S 3"]) -> Float[Array, "S 3"]:
        """Unit normals."""
        return self.placed(points)[1]

    def placed(self, points: Float[Array, "S 3"]) -> tuple[Float[Array, " S"], Float[Array, "S 3"]]:
        """Signed distances from quadrics through the nearest samples, and unit normals of these."""
        count = min(self.count, len(self.points))
        far, near = self._tree.query(points, k=count)
        own = self.points[near]
        middle = own.mean(1)
        local = own - middle[:, None]
        axes = np.linalg.eigh(np.einsum("ski,skj->sij", local, local))[1]
        sign = np.sign(np.einsum("si,si->s", axes[:, :, 0], self.normals[near[:, 0]]))
        axes[:, :, 0] *= np.where(sign == 0, 1, sign)[:, None]
        z, x, y = np.moveaxis(local @ axes, 2, 0)
        scale = np.sqrt((x * x + y * y).mean(1, keepdims=True)) + 1e-300
        # Nearer samples say more of the place.
        weight = np.exp(-((far / (far[:, -1:] + 1e-300)) ** 2))[..., None]
        design = _terms(x / scale, y / scale) * weight
        gram = np.swapaxes(design, 1, 2) @ design
        gram[:, range(3, 6), range(3, 6)] += FLAT * count
        gram += 1e-9 * np.eye(6)
        solved = np.linalg.solve(gram, np.swapaxes(design, 1, 2) @ (z[..., None] * weight))[..., 0]
        w, u, v = np.moveaxis(np.einsum("si,sij->sj", points - middle, axes), 1, 0)
        u, v = u / scale[:, 0], v / scale[:, 0]
        du = (solved[:, 1] + 2 * solved[:, 3] * u + solved[:, 4] * v) / scale[:, 0]
        dv = (solved[:, 2] + solved[:, 4] * u + 2 * solved[:, 5] * v) / scale[:, 0]
        normal = np.einsum("sij,sj->si", axes, np.stack([np.ones_like(du), -du, -dv], 1))
        steep = np.linalg.norm(normal, axis=1)
        off = (w - np.einsum("sj,sj->s", _terms(u, v), solved)) / steep
        return off, normal / steep[:, None]


def _terms(x: Array, y: Array) -> Array:
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], -1)


def free_regions(
    samples: Samples, label: Int[Index, " N"], carried: Int[Index, " N"], first: int
) -> tuple[Int[Index, " N"], list[FreeForm]]:
    """Regions of samples without a label that no sharp turn parts; they get numbers from `first` on.

    Args:
        carried: the labels carried on over the bands between forms: a region has samples that this does not reach.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    i, j = samples.pairs.T
    alike = np.abs((samples.normals[i] * samples.normals[j]).sum(1)) > np.cos(SMOOTH)
    bare = label == NONE
    inner = bare[i] & bare[j]
    joined = inner & alike
    graph = coo_matrix((np.ones(joined.sum(), bool), (i[joined], j[joined])), shape=(len(label), len(label)))
    piece = connected_components(graph, directed=False)[1]
    out = label.copy()
    forms: list[FreeForm] = []
    size = np.bincount(piece[bare], minlength=piece.max() + 1)
    deep = np.bincount(piece[bare], carried[bare] == NONE, minlength=piece.max() + 1)
    count = int(min(NEAREST * (1 + (samples.noise / (NOISY * samples.spacing)) ** 2), MOST))
    for k in np.flatnonzero((size >= LEAST) & (deep >= DEEP * size)):
        members = np.flatnonzero(bare & (piece == k))
        out[members] = first + len(forms)
        forms.append(FreeForm(samples.points[members], samples.normals[members], count))
    return out, forms
