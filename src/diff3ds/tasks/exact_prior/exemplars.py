"""The built-in prior: it has seen members of a library, and knows which of them the phrase or picture means."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.bezier import evaluate
from diff3ds.camera import Cameras
from diff3ds.guidance.built_in.exemplar import ExemplarDenoiser
from diff3ds.library.categories import CATEGORIES
from diff3ds.library.faces import Faces
from diff3ds.library.layout import frame_of
from diff3ds.library.members import Member, member
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
        faces: of each member that the phrase means, the triangles of its solid parts in its frame, made when they are
            asked for; empty if nothing is known of any.
        details: of each of those members, which detail each stroke is of, as `Member` has it; empty like `faces`.
    """

    members: tuple[Sketch, ...]
    fitting: tuple[bool, ...]
    color: Color | None
    ignored: tuple[str, ...] = ()
    mirrored: bool = False
    faces: tuple[Callable[[], Faces], ...] = ()
    details: tuple[Int[Tensor, " N"], ...] = ()

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
    known = [member(request.category, generator, request.attributes) for _ in range(FITTING)]
    wanted = [arranged(one.sketch, request) for one in known]
    faces = tuple(partial(_arranged_faces, one, request) for one in known)
    found = _among_others(wanted, request.category, generator, request.color)
    return replace(found, ignored=request.ignored, faces=faces)


def exemplars_like(wanted: Sequence[Member], category: str, seed: int, color: Color | None = None) -> Exemplars:
    """Members that are given, of one category, and some of everything else.

    Args:
        seed: of the others' proportions.
        color: straight RGB of what is given, or None.
    """
    sketches = [painted(one.sketch, color) for one in wanted]
    found = _among_others(sketches, category, torch.Generator().manual_seed(seed), color)
    faces = tuple(partial(getattr, one, "faces") for one in wanted)
    return replace(found, faces=faces, details=tuple(one.details for one in wanted))


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
    several = [replace(sketch, points=placed(sketch.points)) for placed in _places(sketch, request)]
    return painted(Sketch.concatenate(several), request.color)


def _arranged_faces(one: Member, request: Request) -> Faces:
    """The faces of a member where `arranged` has its strokes."""
    return torch.cat([placed(one.faces) for placed in _places(one.sketch, request)])


def painted(sketch: Sketch, color: Color | None) -> Sketch:
    """Gives all strokes this colour, straight RGB; None leaves them as they are."""
    if color is None:
        return sketch
    return replace(sketch, color=sketch.color.new_tensor(color).expand(len(sketch), 3).contiguous())


def _places(sketch: Sketch, request: Request) -> list[Callable[[Tensor], Tensor]]:
    """The affine map of each of the things that a phrase asks for: stretched, from left to right, in the unit ball."""
    stretched = replace(sketch, points=sketch.points * sketch.points.new_tensor(request.stretch))
    offsets = _in_a_row(stretched, request.count)
    several = [replace(stretched, points=stretched.points + offset) for offset in offsets]
    middle, scale = frame_of(Sketch.concatenate(several))

    def place(offset: Tensor, points: Tensor) -> Tensor:
        return (points * points.new_tensor(request.stretch) + offset - middle) * scale

    return [partial(place, offset) for offset in offsets]


def _in_a_row(sketch: Sketch, count: int) -> list[Float[Tensor, " 3"]]:
    """Where copies go from left to right."""
    across = evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, SAMPLES))[..., 1]
    low, high = across.min(), across.max()
    step = (1 + GAP) * (high - low).clamp(min=GAP)
    return [(i - (count - 1) / 2) * step * sketch.points.new_tensor([0.0, 1.0, 0.0]) for i in range(count)]
