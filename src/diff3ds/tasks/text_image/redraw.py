"""The end of a run with the exact prior: what was found is drawn again, in few fair strokes whose ends meet.

Thick strokes in small pictures find a thing, but any scribble looks right where its lines lie closer than those are
thick. The prior knows drawings of what was found, so the strokes of the one that it has become are taken: those that it
shows, in its colours.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from diff3ds._shapes import Bool, Float, Tensor
from diff3ds.bezier import evaluate
from diff3ds.camera import orbit
from diff3ds.curves.close_gaps import close_gaps
from diff3ds.curves.join import join_smooth
from diff3ds.library.faces import Faces
from diff3ds.optimize.strokes import chord_lengths
from diff3ds.render import render
from diff3ds.sketch import DEFAULT_WIDTH, Sketch
from diff3ds.tasks.text_image.run_spec import CameraOptions

# Members are compared with what was found in so many views of this size, all around. Empirical.
VIEWS, ELEVATION, DISTANCE, SIZE = 8, 15.0, 1.9, 64
# What was found shows a stroke if it has something this near, world units, along half of it: the thick strokes of the
# prior's pictures are .11 wide at the distance of the cameras. Empirical.
NEAR, SHOWN = 0.08, 0.5
# What shows this fraction of a member's strokes, by length, means all of it: near lines hide the rest. Empirical.
WHOLE = 0.75
# Gaps of this width, as a fraction of the image height, are taken for none, if strokes are as thick. Empirical.
HIDDEN = 0.02
# What was found shows a member, and little else, where this fraction of the member's points, and this one of its own,
# have some of the other `NEAR`. By then the rest of the descent changes nothing of what is drawn again. Empirical.
ALL, OWN = 0.9, 0.6
# Points on a stroke, evenly spaced in its parameter.
SAMPLES = 33


@dataclass(frozen=True, eq=False)
class Redrawing:
    """What the strokes of the results are taken from.

    Attributes:
        members: that the phrase or picture means, any strokes.
        faces: of the solid parts of each, made when they are asked for; empty if nothing is known of any.
    """

    members: Sequence[Sketch]
    faces: Sequence[Callable[[], Faces]] = ()

    def faces_of(self, sketch: Sketch) -> Faces | None:
        """The faces of the member that a sketch is most like; None if it is not known to have any."""
        found = self.faces[nearest_member(sketch, self.members)]() if self.faces else None
        return found if found is not None and len(found) else None

    def is_found(self, sketch: Sketch) -> bool:
        """Whether a sketch shows all of the member that it is most like, and little else."""
        from scipy.spatial import cKDTree

        alike = self.members[nearest_member(sketch, self.members)]
        wanted, own = (cKDTree(_along(one).reshape(-1, 3)) for one in (alike, sketch))
        missing, extra = own.query(wanted.data)[0], wanted.query(own.data)[0]
        return bool((missing < NEAR).mean() >= ALL and (extra < NEAR).mean() >= OWN)

    def __call__(self, sketch: Sketch, most: int) -> Sketch:
        """The sketch in the strokes of the member that it is most like, thin ones.

        Args:
            sketch: what was found.
            most: strokes at most, before those that go on in each other are joined; the longest are kept.

        Returns:
            A sketch without strokes if what was found shows none of the member's.
        """
        alike = self.members[nearest_member(sketch, self.members)]
        strokes = alike[shown_by(sketch, alike).nonzero()[:, 0]]
        if len(strokes) > most:
            strokes = strokes[chord_lengths(strokes).argsort(descending=True, stable=True)[:most].sort().values]
        return join_smooth(dressed_as(sketch, strokes)).sketch


def tidied(sketch: Sketch, cameras: CameraOptions, thin: bool) -> Sketch:
    """What was found and shows no member, without the gaps that thick strokes hide in the small pictures of cameras.

    Args:
        thin: give it the width of other sketches as well.
    """
    away = sum(cameras.distance) / 2
    image_height = 2 * away * math.tan(math.radians(cameras.fov / 2))
    met = close_gaps(sketch, min(float(sketch.width.median()), HIDDEN) * image_height)
    return met.replace(width=torch.full_like(met.width, DEFAULT_WIDTH)) if thin else met


def nearest_member(sketch: Sketch, members: Sequence[Sketch]) -> int:
    """Which member looks most like a sketch, from all around."""
    cameras = orbit([360 * i / VIEWS for i in range(VIEWS)], ELEVATION, DISTANCE, size=SIZE)
    with torch.no_grad():
        # With its own, thicker strokes: near lines overlap.
        seen = render(_black(sketch), cameras).color
        width = float(sketch.width.detach().median())
        drawn = (render(replace(_black(m), width=torch.full_like(m.opacity, width)), cameras).color for m in members)
        away = [float((other - seen).square().mean()) for other in drawn]
    return int(np.argmin(away))


def shown_by(sketch: Sketch, member: Sketch) -> Bool[Tensor, " N"]:
    """Which strokes of a member a sketch shows: all, if it shows most of the member."""
    from scipy.spatial import cKDTree

    places = _along(member)
    away, _ = cKDTree(_along(sketch).reshape(-1, 3)).query(places)
    near = torch.from_numpy(away < NEAR).float().mean(1)
    chains = member.chains
    if chains is not None:
        near = torch.zeros(len(member)).index_add_(0, chains.stroke, near) / chains.counts
    shown, lengths = near >= SHOWN, chord_lengths(member)
    return torch.ones_like(shown) if float(lengths[shown].sum()) >= WHOLE * float(lengths.sum()) else shown


def dressed_as(sketch: Sketch, strokes: Sketch) -> Sketch:
    """The strokes in the colours and opacities that a sketch has beside them, as wide as those of other sketches."""
    from scipy.spatial import cKDTree

    plain = sketch.segments()
    _, nearest = cKDTree(_along(sketch).reshape(-1, 3)).query(_along(strokes))
    of = torch.from_numpy(nearest // SAMPLES)
    looks = torch.cat([plain.color, plain.opacity[:, None]], 1).detach()[of].mean(1)
    if strokes.chains is not None:
        chains = strokes.chains
        looks = looks.new_zeros(len(strokes), 4).index_add_(0, chains.stroke, looks) / chains.counts[:, None]
    width = torch.full_like(strokes.opacity, DEFAULT_WIDTH)
    opacity = looks[:, 3].clamp(0, 1).to(strokes.opacity)
    return replace(strokes, width=width, color=looks[:, :3].to(strokes.color), opacity=opacity)


def _black(sketch: Sketch) -> Sketch:
    return replace(sketch.detach(), color=torch.zeros_like(sketch.color), opacity=torch.ones_like(sketch.opacity))


def _along(sketch: Sketch) -> Float[np.ndarray, "M S 3"]:
    """Points along the segments."""
    points, weights = sketch.points.detach().double(), sketch.weights.detach().double()
    return evaluate(points, weights, torch.linspace(0, 1, SAMPLES, dtype=torch.float64)).numpy()
