"""The built-in prior: it has seen members of a library, and knows which of them the phrase or picture means."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.bezier import evaluate
from diff3ds.camera import Cameras
from diff3ds.guidance.built_in.exemplar import ExemplarDenoiser
from diff3ds.library.categories import CATEGORIES
from diff3ds.library.layout import in_ball
from diff3ds.library.members import member
from diff3ds.library.phrase import Request, parse
from diff3ds.render import render_batch
from diff3ds.sketch import Sketch
from diff3ds.tasks.exact_prior.folder_phrase import asked_of, fits
from diff3ds.tasks.exact_prior.sketch_folder import SketchFolder

# Members that the phrase means, and one of each other kind of those below. More of the latter take time and change
# little; they are the same whatever kinds the library has besides, so that a new kind changes no result.
FITTING = 6
OTHER_KINDS = (
    "airplane", "bed", "bicycle", "bookshelf", "bottle", "bus", "cactus", "car", "chair", "church", "fish", "guitar",
    "house", "lamp", "mug", "snowman", "sofa", "table", "tree", "umbrella",
)  # fmt: skip
SIZE, GROUP = 64, 4
# Of the strokes, as a fraction of the image height: 3 pixels. Thinner ones are found less often. Empirical.
WIDTH = 0.05
# Space between several things in a row, in their widths. Empirical.
GAP = 0.25
# Points on a stroke when extents are measured.
SAMPLES = 33

# Straight RGB.
Color = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Exemplars:
    """Members that a prior has seen.

    Attributes:
        members: their sketches, in the unit ball.
        fitting: one bool a member: whether the phrase means it.
        color: straight RGB of what it means, or None.
        ignored: words of the phrase without effect, as `Request`.
        mirrored: whether the left and the right side of what it means are alike.
    """

    members: tuple[Sketch, ...]
    fitting: tuple[bool, ...]
    color: Color | None
    ignored: tuple[str, ...] = ()
    mirrored: bool = False

    @property
    def meant(self) -> list[Sketch]:
        """The members that the phrase means."""
        return [member for member, fits in zip(self.members, self.fitting, strict=True) if fits]

    def prior(self, width: float) -> ExemplarDenoiser:
        """The denoiser that knows them, drawn with strokes of this width."""
        drawn = [replace(sketch, width=torch.full_like(sketch.width, width)) for sketch in self.members]

        def draw(cameras: Cameras) -> Float[Tensor, "M V H W 3"]:
            return torch.stack([seen.color for seen in render_batch(drawn, cameras)])

        return ExemplarDenoiser(draw, torch.tensor(self.fitting), SIZE, GROUP)


def exemplars_of(phrase: str | Request, seed: int) -> Exemplars:
    """Members for a phrase: some that it means, and some of everything else.

    Args:
        phrase: what is asked for, in words or understood already.
        seed: of the members' proportions.

    Raises:
        ValueError: the phrase is not understood (`diff3ds.library.phrase.parse`).
    """
    request = parse(phrase) if isinstance(phrase, str) else phrase
    generator = torch.Generator().manual_seed(seed)
    wanted = [requested(request, generator) for _ in range(FITTING)]
    known = _among_others(wanted, request.category, generator, request.color)
    return replace(known, ignored=request.ignored)


def exemplars_like(wanted: Sequence[Sketch], category: str, seed: int, color: Color | None = None) -> Exemplars:
    """Members that are given, of one category, and some of everything else.

    Args:
        seed: of the others' proportions.
        color: straight RGB of what is given, or None.
    """
    return _among_others(
        [painted(sketch, color) for sketch in wanted], category, torch.Generator().manual_seed(seed), color
    )


def exemplars_in(folder: SketchFolder, phrase: str) -> Exemplars:
    """The members of a folder that a phrase means, and all others there.

    Raises:
        ValueError: the phrase is not understood (`diff3ds.tasks.exact_prior.folder_phrase.asked_of`).
    """
    request = asked_of(folder.names, phrase, str(folder.path))
    chosen = [i for i, name in enumerate(folder.names) if fits(name, request)]
    wanted = {i: arranged(folder.members[i].sketch, request) for i in chosen}
    return replace(exemplars_among(folder, wanted, request.color), ignored=request.ignored)


def exemplars_among(folder: SketchFolder, wanted: Mapping[int, Sketch], color: Color | None = None) -> Exemplars:
    """Members that are given, by their places in a folder, and all others there.

    Args:
        color: straight RGB of what is given, or None.
    """
    given = [painted(sketch, color) for sketch in wanted.values()]
    others = [member.sketch for i, member in enumerate(folder.members) if i not in wanted]
    return Exemplars((*given, *others), (True,) * len(given) + (False,) * len(others), color)


def _among_others(
    wanted: Sequence[Sketch], category: str, generator: torch.Generator, color: Color | None
) -> Exemplars:
    others = [member(name, generator).sketch for name in OTHER_KINDS if name != category]
    fitting = (True,) * len(wanted) + (False,) * len(others)
    return Exemplars((*wanted, *others), fitting, color, mirrored=CATEGORIES[category].mirror == "y")


def requested(request: Request, generator: torch.Generator) -> Sketch:
    """A sketch of what a phrase asks for, in the unit ball."""
    return arranged(member(request.category, generator, request.attributes).sketch, request)


def arranged(sketch: Sketch, request: Request) -> Sketch:
    """A member in the proportions, number and colour that a phrase asks for, in the unit ball."""
    several = _in_a_row(_stretched(sketch, request.stretch), request.count)
    return painted(in_ball(Sketch.concatenate(several)), request.color)


def painted(sketch: Sketch, color: Color | None) -> Sketch:
    """Gives all strokes this colour, straight RGB; None leaves them as they are."""
    if color is None:
        return sketch
    return replace(sketch, color=sketch.color.new_tensor(color).expand(len(sketch), 3).contiguous())


def _stretched(sketch: Sketch, factors: tuple[float, float, float]) -> Sketch:
    """Affine maps of control points are those of the curves."""
    return replace(sketch, points=sketch.points * sketch.points.new_tensor(factors))


def _in_a_row(sketch: Sketch, count: int) -> list[Sketch]:
    """Copies from left to right."""
    across = evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, SAMPLES))[..., 1]
    low, high = across.min(), across.max()
    step = (1 + GAP) * (high - low).clamp(min=GAP)
    offsets = [(i - (count - 1) / 2) * step * sketch.points.new_tensor([0.0, 1.0, 0.0]) for i in range(count)]
    return [replace(sketch, points=sketch.points + offset) for offset in offsets]
