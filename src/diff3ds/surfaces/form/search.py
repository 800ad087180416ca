"""Which forms a surface is made of: fitted to patches of it, the best of them grown and refitted, one by one."""

from dataclasses import dataclass

import numpy as np

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask
from diff3ds.render.backends import for_kernels, kernels
from diff3ds.surfaces.form.form_kinds import Form, FormKind, fits_of_patches
from diff3ds.surfaces.form.samples import Samples

# Rounds of patches, each on what no form has explained; patches of a round, and their numbers of samples, of which
# FITTED are fitted. Empirical.
ROUNDS, PATCHES, PATCH_SIZES, FITTED = 4, 300, (16, 48, 144, 400), 24
# So large a share of its own patch a form must explain to be looked at further, and so many are at once. Empirical.
LEAST_ON, BLOCK = 0.8, 128
# Samples on which the forms of all patches are compared.
COMPARED = 1500
# A sample is on a form within so many standard deviations of the noise and so much of the longest side more, where
# their normals are nearer than this, radians. Empirical.
DEVIATIONS, SLACK, ALIKE = 3.0, 0.0012, 0.35
# A form has at least so many samples, and so large a share of all. Empirical.
LEAST, LEAST_SHARE = 12, 0.0012
# A round is over when so many patches in a row, nearly, gave nothing. Empirical.
FAILURES = 60
# Times a form is refitted while it grows, and the samples that a fit looks at then, and once it has grown.
GROWN, GROWING, REFITTED = 6, 500, 1500
# The step that ends a fit while a form grows, relative to the size of its samples; what has grown is fitted again.
ROUGH = 1e-4
# A kind with more numbers is taken where it makes the mean square distance so much smaller. Empirical.
BETTER = 1.12
# Standard deviations in a median distance.
STANDARD = 1.4826
# A form rounder than this, in longest sides, is flat. Empirical.
ROUNDEST = 4.0


@dataclass(frozen=True, eq=False)
class Found:
    """A form and the samples that it was found on."""

    form: Form
    members: Int[Index, " M"]


def within(samples: Samples) -> float:
    """How far from a form a sample of it may lie, world units."""
    return DEVIATIONS * samples.noise + SLACK * samples.size


def found_forms(samples: Samples, generator: np.random.Generator) -> list[Found]:
    """Forms of a surface, larger ones first; what none of them explains is left over."""
    search = _Search(samples, generator)
    for _ in range(ROUNDS):
        if not search.round():
            break
    return search.found


class _Search:
    """What is explained so far."""

    def __init__(self, samples: Samples, generator: np.random.Generator) -> None:
        from scipy.spatial import cKDTree

        self.samples, self.generator = samples, generator
        self.free = np.ones(len(samples), bool)
        self.found: list[Found] = []
        self.tree = cKDTree(samples.points)
        self.reach = within(samples)
        self.least = max(LEAST, int(LEAST_SHARE * len(samples)))

    def round(self) -> int:
        """Looks at patches of what is not explained; returns how many forms that gave."""
        rows = np.flatnonzero(self.free)
        if len(rows) < self.least:
            return 0
        compared = np.sort(self.generator.choice(rows, min(COMPARED, len(rows)), replace=False))
        forms, weights = self._candidates(rows, compared)
        gains = weights.sum(1)
        least = 0.4 * self.least * len(compared) / len(rows)
        count, failures = 0, 0
        while failures < min(FAILURES, len(forms)):
            best = int(gains.argmax())
            if gains[best] < least:
                break
            grown = self._grown(forms[best])
            gains[best] = 0
            if grown is None:
                failures += 1
                continue
            self.found.append(grown)
            count += 1
            before = self.free[compared].copy()
            self.free[grown.members] = False
            gains -= weights[:, before & ~self.free[compared]].sum(1)
        return count

    def _candidates(self, rows: Index, compared: Index) -> tuple[list[Form], Float[Array, "C S"]]:
        """Forms of patches, and how well each explains the compared samples."""
        points, normals = self.samples.points, self.samples.normals
        forms: list[Form] = []
        weights = []
        seeds = np.sort(self.generator.choice(rows, min(PATCHES, len(rows)), replace=False))
        for size in PATCH_SIZES:
            if size > len(points) / 4:
                break
            near = self.tree.query(points[seeds], k=size, workers=-1)[1]
            near = near[:, np.unique(np.linspace(0, size - 1, FITTED).astype(int))]
            own = normals[near]
            sign = np.sign(np.einsum("mki,mi->mk", own, normals[seeds]))
            for fitted in fits_of_patches(points[near], own * np.where(sign == 0, 1, sign)[..., None]):
                on = (np.abs(fitted.distance(points[near])) < self.reach).mean(1) > LEAST_ON
                keep = np.flatnonzero(on & sound(self.samples, fitted))
                for block in np.split(keep, range(BLOCK, len(keep), BLOCK)):
                    many = fitted[block]
                    weights.append(self._weights(many, points[compared], normals[compared]).astype(np.float32))
                    forms += [many[row] for row in range(len(block))]
        return forms, np.concatenate(weights or [np.zeros((0, len(compared)), np.float32)])

    def _weights(self, form: Form, points: Array, normals: Array, reach: float | None = None) -> Float[Array, "*b S"]:
        distance, cosine = form.measured(points, normals)
        near = np.maximum(1 - (distance / (reach or self.reach)) ** 2, 0)
        return near * (np.abs(cosine) > np.cos(ALIKE))

    def _grown(self, form: Form) -> Found | None:
        """The form refitted to the largest piece of what it explains, and to that of what it explains then."""
        free = np.flatnonzero(self.free)
        points, normals = self.samples.points[free], self.samples.normals[free]
        members: Index = np.zeros(0, np.int64)
        for step in range(GROWN):
            rows = free[self._weights(form, points, normals) > 0]
            before, members = len(members), self._largest(rows)
            if len(members) < self.least:
                return None
            if step > 1 and abs(len(members) - before) < 0.01 * len(members):
                break
            form = self._refitted(form, members, step in (1, 3))
            if not sound(self.samples, form):
                return None
        return Found(form, members)

    def _largest(self, rows: Index) -> Index:
        """The largest connected piece of some samples."""
        if kernel := getattr(kernels(), "largest_piece", None):
            graph = self.samples.graph
            # Of C's long long, which numpy tells from its own integers.
            found: Index = kernel(*for_kernels(graph.indptr, graph.indices, rows)).view(np.int64)
            return found
        from scipy.sparse.csgraph import connected_components

        if not len(rows):
            return rows
        piece = connected_components(self.samples.graph[rows][:, rows], directed=False)[1]
        return rows[piece == np.bincount(piece).argmax()]

    def _refitted(self, form: Form, members: Index, other_kinds: bool) -> Form:
        some = members[np.unique(np.linspace(0, len(members) - 1, GROWING).astype(int))]
        points, normals = self.samples.points[some], self.samples.normals[some]
        scale = self.reach / 2
        own = form.fitted(points, scale, settled=ROUGH)
        return best_kind(own, points, normals, self.samples, wide=False) if other_kinds else own


def sound(samples: Samples, form: Form) -> Bool[Mask, "*b"]:
    """Whether forms are what their kind says, and not nearly a simpler one."""
    size = samples.size
    ok = np.isfinite(form.center).all(-1) & np.isfinite(form.radius)
    ok &= np.linalg.norm(form.center - samples.middle, axis=-1) < 100 * size
    if form.kind == FormKind.CONE:
        return np.asarray(ok & (np.abs(form.angle) > 0.03) & (np.abs(form.angle) < 1.5))
    if form.kind == FormKind.TORUS:
        ok &= (form.ring > 1.05 * form.radius) & (form.ring < ROUNDEST * size)
    if form.kind != FormKind.PLANE:
        ok &= (form.radius > 0.5 * samples.spacing) & (form.radius < ROUNDEST * size)
    return np.asarray(ok)


def alike(own: Form, points: Float[Array, "S 3"], normals: Float[Array, "S 3"]) -> Float[Array, "S 3"]:
    """Normals turned to the side of a form's own."""
    sign = np.sign((own.normal(points) * normals).sum(1))
    return normals * np.where(sign == 0, 1, sign)[:, None]


def best_kind(
    own: Form, points: Array, normals: Array, samples: Samples, better: float = BETTER, wide: bool = True
) -> Form:
    """The simplest form that fits points nearly as well as the best one does.

    Args:
        better: a kind with more numbers makes the mean square distance so much smaller.
        wide: whether other kinds are fitted to all points first, and not only to those near to what normals say.
    """
    scale = within(samples) / 2
    turned = alike(own, points, normals)
    fits = {own.kind: own}
    for one in fits_of_patches(points[None], turned[None]):
        if one.kind != own.kind and sound(samples, one[0]):
            rough = STANDARD * float(np.median(np.abs(one[0].distance(points))))
            start = one[0].fitted(points, rough, settled=ROUGH) if wide and rough > scale else one[0]
            fits[one.kind] = start.fitted(points, scale, settled=ROUGH)
    floor = (0.2 * samples.noise) ** 2 + (1e-4 * samples.size) ** 2
    found: Form | None = None
    price = np.inf
    for kind in sorted(fits):
        one = fits[kind]
        if not sound(samples, one):
            continue
        off = one.distance(points)
        spread = float(np.minimum(off * off, scale * scale * 4).mean()) + floor
        if spread * better < price:
            found, price = one, spread
    return own if found is None else found
