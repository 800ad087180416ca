"""From where a thing of a known kind is seen: the view of the library's members whose lines are most like its own."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import torch
from numpy.typing import NDArray

from diff3ds._shapes import Float, Tensor
from diff3ds.bezier import evaluate
from diff3ds.camera import Cameras, orbit
from diff3ds.library.categories import CATEGORIES
from diff3ds.library.members import Member, added_strokes, member
from diff3ds.recognition.network import AZIMUTHS, ELEVATIONS
from diff3ds.recognition.picture_lines import Lines
from diff3ds.sketch import Sketch

# Distance and field of view of the cameras, those of the built-in prior's; the azimuths and elevations of the views are
# those that the network tells apart.
DISTANCE, FOV = 1.9, 60.0
# A descriptor counts pieces of lines in cells of a square of this side, in lengths of the longer side of their box, by
# direction; the blur is in cells, and every second cell is kept.
CELLS, DIRECTIONS, SIDE, BLUR, EVERY = 32, 4, 1.2, 1.6, 2
# Pieces of a stroke.
PIECES = 32
# So many best views are refined: each with so many seeds, at its pose and beside it (degrees).
REFINED, SEEDS, STEPS_AROUND, STEPS_UP = 5, 6, (-5.0, 0.0, 5.0), (-5.0, 0.0, 5.0)
# Seeds among which members like the picture are sought.
POOL = 64
# A direction that differs by a quarter turn counts as this distance.
TURNED = 0.1
# A picture shows an attribute if it has lines this near to those that the attribute adds, in lengths of the longer side
# of their box, along this share of them. Empirical: members by a shaky hand have .5 and more, and a chair's straight
# legs .2 of rockers.
BY_LINES, SHOWN = 0.04, 0.5

# Confidence is a logistic function of the score of the best kind, of its lead over the next one and of how far its
# lines lie from the picture's, squared: hidden lines that a drawing lacks are forgiven, whole parts are not. Fitted to
# distorted members of the built-in library of other seeds, half of them with their category left out, to some without
# hidden lines, and to shapes that are no thing: `benchmarks/recognise.py confidence`.
OF_SCORE, OF_LEAD, OF_SQUARED_GAP, OFFSET = 36.4, 50.3, -3100.0, -35.2
LEAST_CONFIDENCE = 0.5


@dataclass(frozen=True)
class Match:
    """A view of a category's members that is like a picture.

    Attributes:
        attributes: of the member.
        azimuth, elevation: of the camera, degrees.
        score: in [0, 1].
        seed: of the member.
    """

    attributes: tuple[str, ...]
    azimuth: float
    elevation: float
    score: float
    seed: int = 0


def seen_from(
    wanted: Float[Tensor, " D"],
    kind: str,
    attributes: tuple[str, ...] = (),
    likely: Float[Tensor, "A E"] | None = None,
) -> Match:
    """The view of a kind's members that is most like a picture.

    Args:
        wanted: the descriptor of the picture's lines.
        attributes: of the members; if none are named, they are sought.
        likely: added to the scores of the views from each of the azimuths and elevations.
    """
    views = _views(kind, [attributes]) if attributes else table(kind)
    scores = views.descriptors @ wanted
    if likely is not None:
        scores = scores + likely.flatten().repeat(len(scores) // likely.numel())
    return _refined(wanted, kind, views, scores)


def gap(lines: Lines, sketch: Sketch, cameras: Cameras) -> float:
    """Measures how far a sketch's lines, as a camera sees them, lie from a picture's: the mean distance both ways.

    In lengths of the longer side of their boxes. Scores forgive what is missing: a bare circle is more like a clock
    than like anything else, but hands and ticks lie far from it.
    """
    from scipy.spatial import cKDTree

    seen = pieces(sketch, cameras)[0][0].numpy()
    there, back = cKDTree(lines.points).query(seen)[0], cKDTree(seen).query(lines.points)[0]
    return float(there.mean() + back.mean()) / 2


def shows_attributes(lines: Lines, kind: str, match: Match) -> bool:
    """Whether a picture has the lines that the attributes of a match add to the kind.

    Attributes that change all of a thing are its shape, which the score has compared.
    """
    from scipy.spatial import cKDTree

    added = added_strokes(kind, match.seed, match.attributes)
    if added.all() or not added.any():
        return True
    sketch = member_drawn(kind, match.attributes, match.seed)
    places, along = (part[0] for part in pieces(sketch, cameras_at([(match.azimuth, match.elevation)])))
    own, length = added.repeat_interleave(PIECES), torch.linalg.vector_norm(along, dim=1)
    picture = np.column_stack([lines.points, heading(torch.from_numpy(lines.tangents)).numpy()])
    away, _ = cKDTree(picture).query(torch.cat([places, heading(along)], 1)[own].numpy())
    near = torch.from_numpy(away < BY_LINES)
    return float(length[own][near].sum()) >= SHOWN * float(length[own].sum())


def heading(tangents: Float[Tensor, "N 2"]) -> Float[Tensor, "N 2"]:
    """Directions of either sign as points on a circle, `TURNED` apart for a quarter turn."""
    x, y = torch.nn.functional.normalize(tangents, dim=-1).unbind(-1)
    return TURNED / 2 * torch.stack([x.square() - y.square(), 2 * x * y], -1)


@dataclass(frozen=True, eq=False)
class PlacedLines:
    """The lines of a picture where a camera sees them.

    Attributes:
        lines: of the picture.
        camera: one view of square images.
        side: the longer side of their box, as a fraction of the image height.
        middle: of their box, x and y, the same.
    """

    lines: Lines
    camera: Cameras
    side: float
    middle: tuple[float, float]

    @property
    def points(self) -> Float[NDArray[np.float64], "N 2"]:
        """Points along them, as fractions of the image height."""
        points: NDArray[np.float64] = self.lines.points * self.side + np.array(self.middle)
        return points

    def picture(self, size: int, width: float) -> Float[Tensor, "S S 3"]:
        """They are drawn black on white.

        Args:
            size: height and width, pixels.
            width: of the lines, as a fraction of the image height.
        """
        ink = self.lines.ink(size, width, self.side, self.middle)
        return 1 - torch.from_numpy(ink)[..., None].repeat(1, 1, 3)


def placed_over(lines: Lines, sketch: Sketch, camera: Cameras) -> PlacedLines:
    """The lines where and as large as one view sees a sketch that is like them."""
    seen = projected(sketch, camera).flatten(0, 2) / camera.size[0]
    low, high = seen.amin(0), seen.amax(0)
    x, y = ((low + high) / 2).tolist()
    return PlacedLines(lines, camera, float((high - low).max()), (x, y))


def gap_to(lines: Lines, kind: str, match: Match) -> float:
    """Measures how far the lines of a match lie from a picture's: see `gap`."""
    sketch = member_drawn(kind, match.attributes, match.seed)
    return gap(lines, sketch, cameras_at([(match.azimuth, match.elevation)]))


def confidence(best: float, next_best: float, gap: float) -> float:
    """That the kind with the best score is right, whose lines lie this far from the picture's."""
    return 1 / (1 + math.exp(-(OF_SCORE * best + OF_LEAD * (best - next_best) + OF_SQUARED_GAP * gap**2 + OFFSET)))


def alike(lines: Lines, kind: str, attributes: tuple[str, ...], camera: Cameras, count: int) -> list[Member]:
    """The members of a kind that are most like a picture, from where it was taken; the best first."""
    wanted = described(lines)
    pool = [_known(kind, attributes, seed) for seed in range(POOL)]
    scores = torch.stack([descriptors(*pieces(one.sketch, camera))[0] for one in pool]) @ wanted
    best = scores.topk(count).indices.tolist()
    # What attributes bring was seen, or asked for.
    given = [added_strokes(kind, seed, attributes) for seed in best]
    return [replace(pool[i], details=pool[i].details.where(~added, -1)) for i, added in zip(best, given, strict=True)]


def _refined(wanted: Float[Tensor, " D"], kind: str, views: "Views", scores: Float[Tensor, " V"]) -> Match:
    """The best match among poses beside those of the best views, with proportions of other seeds."""
    found = []
    for i in scores.topk(REFINED).indices.tolist():
        attributes, (azimuth, elevation) = views.attributes[i], views.poses[i]
        likely = float(scores[i] - views.descriptors[i] @ wanted)
        poses = [((azimuth + a) % 360, max(0.0, elevation + e)) for a in STEPS_AROUND for e in STEPS_UP]
        cameras = cameras_at(poses)
        for seed in range(SEEDS):
            beside = descriptors(*pieces(member_drawn(kind, attributes, seed), cameras)) @ wanted
            best = int(beside.argmax())
            match = Match(attributes, *poses[best], float(beside[best]), seed)
            found.append((match.score + likely, match))
    return max(found, key=lambda pair: pair[0])[1]


@dataclass(frozen=True, eq=False)
class Views:
    """Views of members of one category.

    Attributes:
        descriptors: of their lines.
        attributes: of the member in each.
        poses: azimuth and elevation of each, degrees.
    """

    descriptors: Float[Tensor, "V D"]
    attributes: tuple[tuple[str, ...], ...]
    poses: tuple[tuple[float, float], ...]


@cache
def table(category: str) -> Views:
    """Views of a category's members, plain and with each attribute, all around; kept while the program runs."""
    return _views(category, [(), *((attribute.name,) for attribute in CATEGORIES[category].attributes)])


def _views(category: str, kinds: Sequence[tuple[str, ...]]) -> Views:
    poses = tuple((a, e) for a in AZIMUTHS for e in ELEVATIONS)
    cameras = cameras_at(poses)
    seen = [descriptors(*pieces(member_drawn(category, kind, 0), cameras)) for kind in kinds]
    return Views(torch.cat(seen), tuple(kind for kind in kinds for _ in poses), poses * len(kinds))


def cameras_at(poses: Sequence[tuple[float, float]]) -> Cameras:
    """Views from azimuths and elevations, degrees."""
    return _cameras_at(tuple(poses))


@cache
def _cameras_at(poses: tuple[tuple[float, float], ...]) -> Cameras:
    return orbit([a for a, _ in poses], [e for _, e in poses], DISTANCE, fov=FOV, size=1)


def member_drawn(category: str, attributes: tuple[str, ...], seed: int) -> Sketch:
    """The sketch of a member of a category; kept while the program runs."""
    return _known(category, attributes, seed).sketch


@cache
def _known(category: str, attributes: tuple[str, ...], seed: int) -> Member:
    return member(category, torch.Generator().manual_seed(seed), attributes)


def described(lines: Lines) -> Float[Tensor, " D"]:
    """The descriptor of a picture's lines."""
    points, tangents = (torch.from_numpy(a).float()[None] for a in (lines.points, lines.tangents))
    return descriptors(points, tangents)[0]


def projected(sketch: Sketch, cameras: Cameras) -> Float[Tensor, "V C S 2"]:
    """Points along the strokes in pixels."""
    points = evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, PIECES + 1))
    homogeneous = torch.cat([points, torch.ones_like(points[..., :1])], -1)
    seen = torch.einsum("vij,csj->vcsi", cameras.projection[:, :3].float(), homogeneous)
    return seen[..., :2] / seen[..., 2:]


def pieces(sketch: Sketch, cameras: Cameras) -> tuple[Float[Tensor, "V N 2"], Float[Tensor, "V N 2"]]:
    """Middles and vectors of the strokes' pieces as cameras see them, in the frame of `Lines`."""
    seen = projected(sketch, cameras)
    low, high = seen.amin((1, 2), keepdim=True), seen.amax((1, 2), keepdim=True)
    seen = (seen - (low + high) / 2) / (high - low).amax(-1, keepdim=True)
    return ((seen[:, :, 1:] + seen[:, :, :-1]) / 2).flatten(1, 2), (seen[:, :, 1:] - seen[:, :, :-1]).flatten(1, 2)


def descriptors(points: Float[Tensor, "V N 2"], tangents: Float[Tensor, "V N 2"]) -> Float[Tensor, "V D"]:
    """Describes how much line of which direction lies where, by unit vectors whose dot products compare views.

    A histogram of oriented pieces over cells, blurred. A cell holds no more than a line through it: lines that fall
    together count once. Square roots lessen the weight of what is dense.
    """
    cell = ((points / SIDE + 0.5) * CELLS).long().clamp(0, CELLS - 1)
    turn = torch.atan2(tangents[..., 1], tangents[..., 0]) / torch.pi % 1 * DIRECTIONS
    # `vector_norm` of pairs that lie apart in memory takes sixty times as long.
    length = torch.hypot(*tangents.unbind(-1)) * CELLS / SIDE
    count = torch.zeros(len(points) * DIRECTIONS * CELLS * CELLS)
    place = torch.arange(len(points))[:, None] * (DIRECTIONS * CELLS * CELLS) + cell[..., 1] * CELLS + cell[..., 0]
    lower, fraction = turn.long(), turn.frac()
    for direction, weight in ((lower, 1 - fraction), (lower + 1, fraction)):
        count.index_add_(0, (place + direction % DIRECTIONS * (CELLS * CELLS)).flatten(), (weight * length).flatten())
    held = count.view(-1, DIRECTIONS, CELLS, CELLS)
    held = held / held.sum(1, keepdim=True).clamp(min=1)
    blurred = (_blur() @ held @ _blur().mT).sqrt().flatten(1)
    return torch.nn.functional.normalize(blurred, dim=1)


@cache
def _blur() -> Float[Tensor, "c C"]:
    """A Gaussian at every second cell."""
    kept = torch.arange(0, CELLS, EVERY) + EVERY / 2
    return torch.exp(-((kept[:, None] - torch.arange(CELLS) - 0.5) ** 2) / (2 * BLUR**2))
