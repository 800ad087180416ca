"""Members of the categories: seeded 3D sketches that fill the unit ball, with captions."""

import difflib
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import torch

from diff3ds._checks import check_generator
from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds.bezier import evaluate
from diff3ds.library.categories import CATEGORIES
from diff3ds.library.category import Category
from diff3ds.library.faces import Faces, Solid
from diff3ds.library.shapes import Part, Strokes, join
from diff3ds.sketch import Sketch

# Distance of the farthest point from the origin.
RADIUS = 0.95
# Points on a stroke where extents are measured. A half circle's extreme can lie half a step, a 128th of it, away from
# the nearest: short by 1 - cos(180 / 128 degrees) = .0003 of its radius.
_SAMPLES = 65


@dataclass(frozen=True, eq=False)
class Member:
    """A sketch of one thing.

    Attributes:
        sketch: float32 cubics, black, of the default width, in the unit ball: the middle of the bounding box is at the
            origin, the farthest point .95 away from it. The front is on +x, z is up.
        category: name of what it is.
        attributes: names of what it has, in the category's order.
        captions: ways to call it, the usual one first.
        solids: what of it hides things that lie behind it.
        details: which detail each stroke is of, such as the windows of a house; -1 for none.
    """

    sketch: Sketch
    category: str
    attributes: tuple[str, ...]
    captions: tuple[str, ...]
    solids: tuple[Solid, ...] = ()
    details: Int[Tensor, " N"] = field(default_factory=lambda: torch.zeros(0, dtype=torch.int64))

    @cached_property
    def faces(self) -> Faces:
        """The triangles of its solid parts, in the frame of the sketch; none if all of it is wires."""
        return torch.cat([torch.zeros(0, 3, 3, dtype=torch.float64), *(solid.faces for solid in self.solids)])

    @property
    def caption(self) -> str:
        """The usual way to call it: "a chair with armrests"."""
        return self.captions[0]


def member(category: str, generator: torch.Generator, attributes: Collection[str] = ()) -> Member:
    """Draws a member of a category; the generator (on the CPU) varies its proportions.

    Raises:
        TypeError: no generator.
        ValueError: no such category, no such attribute of it, or attributes that exclude each other; the message says
            what there is.
    """
    kind = _find(category)
    names = _check(kind, attributes)
    check_generator(generator)
    parts = _made(kind, generator, names)
    made = join(*parts)
    center, scale = _ball_around(made.strokes)
    matrix = torch.eye(4, dtype=torch.float64) * scale
    matrix[:3, 3] = -scale * center
    matrix[3, 3] = 1
    solids = tuple(solid.moved(matrix) for solid in made.solids)
    owners = torch.tensor([i if part.detail else -1 for i, part in enumerate(parts)])
    details = owners.repeat_interleave(torch.tensor([len(part) for part in parts]))
    return Member(fill_ball(made.strokes), kind.name, names, kind.captions(names), solids, details)


def added_strokes(category: str, seed: int, attributes: Collection[str]) -> Bool[Tensor, " N"]:
    """Which strokes of a member its attributes bring: those that the plain member of the same seed does not have.

    Raises:
        ValueError: as `member`.
    """
    kind = _find(category)
    whole, plain = (
        join(*_made(kind, torch.Generator().manual_seed(seed), names)).strokes
        for names in (_check(kind, attributes), ())
    )
    return ~(whole[:, None] == plain).all(-1).all(-1).any(1)


def _made(kind: Category, generator: torch.Generator, names: tuple[str, ...]) -> Sequence[Part]:
    """The parts of a member as its kind makes them, of any size and anywhere."""

    def vary(low: float, high: float) -> float:
        return low + (high - low) * torch.rand((), generator=generator, dtype=torch.float64).item()

    return kind.make(vary, names)


def _find(category: str) -> Category:
    if not (isinstance(category, str) and category in CATEGORIES):
        raise ValueError(f"no category is named {category!r}{_nearest(category, CATEGORIES)}")
    return CATEGORIES[category]


def _check(category: Category, attributes: Collection[str]) -> tuple[str, ...]:
    """The attributes in the category's order."""
    if isinstance(attributes, str) or not isinstance(attributes, Collection):
        raise ValueError(f"attributes must be a collection of names, got {attributes!r}")
    known = [attribute.name for attribute in category.attributes]
    for name in attributes:
        if name not in known:
            raise ValueError(f"{category.name} has no attribute {name!r}{_nearest(name, known)}")
    chosen = tuple(name for name in known if name in attributes)
    if chosen not in category.combinations():
        raise ValueError(f"no {category.name} has all of {', '.join(chosen)}: some of these exclude each other")
    return chosen


def _nearest(word: object, known: Iterable[str]) -> str:
    names = list(known)
    near = difflib.get_close_matches(str(word), names, n=3)
    return f"; did you mean {' or '.join(near)}?" if near else f"; there are {', '.join(names) or 'none'}"


def fill_ball(strokes: Strokes) -> Sketch:
    """Strokes of any size and anywhere as a sketch in the unit ball, as members are.

    Raises:
        ValueError: they have no size.
    """
    weights = strokes[..., 3]
    center, scale = _ball_around(strokes)
    return Sketch(((strokes[..., :3] / weights[..., None] - center) * scale).float(), weights.float())


def _ball_around(strokes: Strokes) -> tuple[Float[Tensor, " 3"], Tensor]:
    """The middle of the bounding box, and what makes the farthest point lie `RADIUS` away from it."""
    weights = strokes[..., 3]
    points = strokes[..., :3] / weights[..., None]
    on = evaluate(points, weights, torch.linspace(0, 1, _SAMPLES, dtype=torch.float64)).flatten(0, 1)
    center = (on.amin(0) + on.amax(0)) / 2
    return center, RADIUS / torch.linalg.vector_norm(on - center, dim=1).max()
