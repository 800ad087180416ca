"""What a picture shows: the category, attributes and pose of the library's view whose lines are most like its own."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.bezier import evaluate
from diff3ds.camera import Cameras, orbit
from diff3ds.library.categories import CATEGORIES
from diff3ds.library.members import member
from diff3ds.sketch import Sketch
from diff3ds.tasks.recognition.lines import Lines

# Views of the table, degrees; distance and field of view are those of the built-in prior's cameras.
AZIMUTHS, ELEVATIONS = tuple(15.0 * i for i in range(24)), (0.0, 15.0, 30.0)
DISTANCE, FOV = 1.9, 60.0
# A descriptor counts pieces of lines in cells of a square of this side, in lengths of the longer side of their box, by
# direction; the blur is in cells, and every second cell is kept.
CELLS, DIRECTIONS, SIDE, BLUR, EVERY = 32, 4, 1.2, 1.6, 2
# Pieces of a stroke.
PIECES = 32
# So many best views of the best categories are refined: each with so many seeds, at its pose and beside it (degrees).
CANDIDATES, REFINED, SEEDS, STEPS_AROUND, STEPS_UP = 4, 5, 6, (-5.0, 0.0, 5.0), (-5.0, 0.0, 5.0)
# Seeds among which members like the picture are sought.
POOL = 64
# Confidence is a logistic function of the score of the best category, of its lead over the next one and of how far its
# lines lie from the picture's, squared: hidden lines that a drawing lacks are forgiven, whole parts are not. Fitted to
# distorted members of other seeds, half of them with their category left out, to some without hidden lines, and to
# shapes that are no thing: `benchmarks/recognise.py confidence`.
OF_SCORE, OF_LEAD, OF_SQUARED_GAP, OFFSET = 36.4, 50.3, -3100.0, -35.2
LEAST_CONFIDENCE = 0.5
SUGGESTIONS = 3


@dataclass(frozen=True)
class Recognised:
    """What a picture shows.

    Attributes:
        category, attributes: of the library.
        azimuth, elevation: of the camera, degrees.
        confidence: in [0, 1]: so many of such pictures showed this category, where every other one showed something
            that the library lacks.
        scores: of the categories that are most like the picture, in [0, 1].
        caption: such as "a chair with armrests".
    """

    category: str
    attributes: tuple[str, ...]
    azimuth: float
    elevation: float
    confidence: float
    scores: tuple[tuple[str, float], ...]
    caption: str

    @property
    def camera(self) -> Cameras:
        """The camera that took the picture, as far as its lines tell."""
        return cameras_at([(self.azimuth, self.elevation)])

    def __str__(self) -> str:
        """Says it in words."""
        side, height = round((self.azimuth + 180) % 360 - 180), round(self.elevation)
        # Azimuths run counter-clockwise seen from above, which is to the right of who faces the front.
        beside = f"{abs(side)} degrees to the {'right' if side > 0 else 'left'} of the front"
        around = {0: "in front", 180: "behind", -180: "behind"}.get(side, beside)
        upright = f"{abs(height)} {'above' if height >= 0 else 'below'}"
        return f"{self.caption} ({self.confidence:.0%}), seen from {around}, {upright}"

    def as_json(self) -> dict[str, object]:
        """Says it in the types of JSON."""
        return {**asdict(self), "attributes": list(self.attributes), "scores": [list(pair) for pair in self.scores]}


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


def recognise(lines: Lines, category: str | None = None, attributes: tuple[str, ...] = ()) -> Recognised:
    """Finds what lines show.

    Args:
        category: if it is known; the confidence is 1 then.
        attributes: the same; if none are named, they are sought.

    Raises:
        ValueError: nothing in the library is like it.
    """
    wanted = described(lines)
    if category is not None:
        best = _refined(wanted, category, _table_of(category, attributes))
        return _recognised(category, best, 1.0, ((category, 1.0),))
    found = matches(wanted)
    scores = sorted(((name, match.score) for name, match in found.items()), key=lambda pair: -pair[1])[:SUGGESTIONS]
    name = scores[0][0]
    sure = confidence(scores[0][1], scores[1][1], gap_to(lines, name, found[name]))
    if sure < LEAST_CONFIDENCE:
        raise ValueError(
            f"the built-in prior does not recognise the {lines.kind} ({sure:.0%} sure): it is most like "
            f"{', '.join(f'{one} ({score:.2f})' for one, score in scores)}, but may be none of them. "
            f"If it shows one of the {len(CATEGORIES)} kinds of things that it knows, say so: "
            f'--shows "{CATEGORIES[name].captions()[0]}". '
            "For any picture use Zero-1-to-3, on a GPU: diff3ds fetch zero123, then --prior zero123"
        )
    return _recognised(name, found[name], sure, tuple(scores))


def _recognised(category: str, best: Match, sure: float, scores: tuple[tuple[str, float], ...]) -> Recognised:
    caption = CATEGORIES[category].captions(best.attributes)[0]
    return Recognised(category, best.attributes, best.azimuth, best.elevation, sure, scores, caption)


def confidence(best: float, next_best: float, gap: float) -> float:
    """That the category with the best score is right, whose lines lie this far from the picture's."""
    return 1 / (1 + math.exp(-(OF_SCORE * best + OF_LEAD * (best - next_best) + OF_SQUARED_GAP * gap**2 + OFFSET)))


def gap_to(lines: Lines, category: str, match: Match) -> float:
    """Measures how far the lines of a match lie from a picture's: see `gap`."""
    return gap(lines, _drawn(category, match.attributes, match.seed), cameras_at([(match.azimuth, match.elevation)]))


def gap(lines: Lines, sketch: Sketch, cameras: Cameras) -> float:
    """Measures how far a sketch's lines, as a camera sees them, lie from a picture's: the mean distance both ways.

    In lengths of the longer side of their boxes. Scores forgive what is missing: a bare circle is more like a clock
    than like anything else, but hands and ticks lie far from it.
    """
    from scipy.spatial import cKDTree

    seen = pieces(sketch, cameras)[0][0].numpy()
    there, back = cKDTree(lines.points).query(seen)[0], cKDTree(seen).query(lines.points)[0]
    return float(there.mean() + back.mean()) / 2


def matches(wanted: Float[Tensor, " D"]) -> dict[str, Match]:
    """The best match of every category; those of the best categories are refined."""
    found = {name: _best(wanted, table(name)) for name in CATEGORIES}
    best = sorted(found, key=lambda name: -found[name].score)[:CANDIDATES]
    return found | {name: _refined(wanted, name, table(name)) for name in best}


def alike(lines: Lines, found: Recognised, count: int) -> list[Sketch]:
    """The members of what was recognised that are most like the picture, from where it was taken; the best first."""
    wanted, camera = described(lines), found.camera
    pool = [_drawn(found.category, found.attributes, seed) for seed in range(POOL)]
    scores = torch.stack([descriptors(*pieces(sketch, camera))[0] for sketch in pool]) @ wanted
    return [pool[int(i)] for i in scores.topk(count).indices]


def drawn_over(lines: Lines, sketch: Sketch, cameras: Cameras, width: float) -> Float[Tensor, "H W 3"]:
    """The lines, black on white, where and as large as a camera sees a sketch that is like them.

    Args:
        cameras: one view of square images.
        width: of the lines, as a fraction of the image height.
    """
    seen = _projected(sketch, cameras).flatten(0, 2) / cameras.size[0]
    low, high = seen.amin(0), seen.amax(0)
    x, y = ((low + high) / 2).tolist()
    ink = lines.ink(cameras.size[0], width, float((high - low).max()), (x, y))
    return 1 - torch.from_numpy(ink)[..., None].repeat(1, 1, 3)


def _best(wanted: Float[Tensor, " D"], views: "Views") -> Match:
    scores = views.descriptors @ wanted
    best = int(scores.argmax())
    return Match(views.attributes[best], *views.poses[best], float(scores[best]))


def _refined(wanted: Float[Tensor, " D"], category: str, views: "Views") -> Match:
    """The best match among poses beside those of the best views, with proportions of other seeds."""
    found = []
    for i in (views.descriptors @ wanted).topk(REFINED).indices.tolist():
        kind, (azimuth, elevation) = views.attributes[i], views.poses[i]
        poses = [((azimuth + a) % 360, max(0.0, elevation + e)) for a in STEPS_AROUND for e in STEPS_UP]
        cameras = cameras_at(poses)
        for seed in range(SEEDS):
            scores = descriptors(*pieces(_drawn(category, kind, seed), cameras)) @ wanted
            best = int(scores.argmax())
            found.append(Match(kind, *poses[best], float(scores[best]), seed))
    return max(found, key=lambda match: match.score)


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
    seen = [descriptors(*pieces(_drawn(category, kind, 0), cameras)) for kind in kinds]
    return Views(torch.cat(seen), tuple(kind for kind in kinds for _ in poses), poses * len(kinds))


def _table_of(category: str, attributes: tuple[str, ...]) -> Views:
    """Views of members with just these attributes; of all members, if none are named."""
    return _views(category, [attributes]) if attributes else table(category)


def cameras_at(poses: Sequence[tuple[float, float]]) -> Cameras:
    """Views from azimuths and elevations, degrees."""
    return orbit([a for a, _ in poses], [e for _, e in poses], DISTANCE, fov=FOV, size=1)


@cache
def _drawn(category: str, attributes: tuple[str, ...], seed: int) -> Sketch:
    return member(category, torch.Generator().manual_seed(seed), attributes).sketch


def described(lines: Lines) -> Float[Tensor, " D"]:
    """The descriptor of a picture's lines."""
    points, tangents = (torch.from_numpy(a).float()[None] for a in (lines.points, lines.tangents))
    return descriptors(points, tangents)[0]


def _projected(sketch: Sketch, cameras: Cameras) -> Float[Tensor, "V C S 2"]:
    """Points along the strokes in pixels."""
    points = evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, PIECES + 1))
    homogeneous = torch.cat([points, torch.ones_like(points[..., :1])], -1)
    seen = torch.einsum("vij,csj->vcsi", cameras.projection[:, :3].float(), homogeneous)
    return seen[..., :2] / seen[..., 2:]


def pieces(sketch: Sketch, cameras: Cameras) -> tuple[Float[Tensor, "V N 2"], Float[Tensor, "V N 2"]]:
    """Middles and vectors of the strokes' pieces as cameras see them, in the frame of `Lines`."""
    seen = _projected(sketch, cameras)
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
    length = torch.linalg.vector_norm(tangents, dim=-1) * CELLS / SIDE
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
