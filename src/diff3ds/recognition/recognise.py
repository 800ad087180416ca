"""What a picture shows: the kinds that a network names, each with attributes and the side that it is seen from."""

from dataclasses import asdict, dataclass

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.library.categories import CATEGORIES
from diff3ds.recognition.network import Opinion, trained
from diff3ds.recognition.picture_lines import Lines
from diff3ds.recognition.side_seen import (
    LEAST_CONFIDENCE,
    Match,
    cameras_at,
    confidence,
    described,
    gap_to,
    member_drawn,
    seen_from,
    shows_attributes,
)
from diff3ds.render import render
from diff3ds.render.backends import torch_on_one_thread

# Guesses that are offered.
GUESSES = 3
# Confidence says no more than this: it was fitted to some two hundred pictures, which cannot tell more apart.
MOST = 0.99
# A pose that the network takes for so many times less likely than the likeliest one scores 1 / e of this less, where
# the likenesses of a kind's views to a picture are dot products of unit vectors. Empirical.
OF_NETWORK = 0.002
# [nats] What the network takes for unlikelier than that is unlikely enough.
LEAST_LIKELY = -4.0


@dataclass(frozen=True)
class Guess:
    """What a picture may show.

    Attributes:
        kind: name of a category of the library, such as "hot-air balloon".
        attributes: of it, names as in the library.
        azimuth, elevation: of the camera, degrees: 0 is in front, 90 at its left hand, 180 behind.
        confidence: in [0, 1]: so many of such pictures show this kind.
        caption: such as "a chair with armrests"; `diff3ds image --shows` takes it.
    """

    kind: str
    attributes: tuple[str, ...]
    azimuth: float
    elevation: float
    confidence: float
    caption: str

    @property
    def camera(self) -> Cameras:
        """The camera that took the picture, as far as its lines tell."""
        return cameras_at([(self.azimuth, self.elevation)])

    def picture(self, size: int = 200) -> Float[Tensor, "S S 3"]:
        """A member of the kind as this camera sees it, black on white.

        Args:
            size: height and width, pixels.
        """
        sketch = member_drawn(self.kind, self.attributes, 0)
        return render(sketch, self.camera.resize(size)).color[0]

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
        return {**asdict(self), "attributes": list(self.attributes)}


@dataclass(frozen=True)
class Recognition:
    """What a picture may show.

    Attributes:
        guesses: the best first.
        taken: whether the first is sure enough to be drawn.
    """

    guesses: tuple[Guess, ...]
    taken: bool

    def __str__(self) -> str:
        """Lists the guesses, each with the option that says it is right."""
        lines = [f'{i}. {guess}\n   --shows "{guess.caption}"' for i, guess in enumerate(self.guesses, 1)]
        return "\n".join(lines)


class NotRecognised(ValueError):  # noqa: N818 (what came of it, not a fault)
    """A picture may show one of several things, or none of them.

    Attributes:
        recognition: what it may show.
    """

    def __init__(self, recognition: Recognition, message: str) -> None:
        """Takes what it may show and what is said of it."""
        super().__init__(message)
        self.recognition = recognition


@torch_on_one_thread()
def recognise(lines: Lines) -> Recognition:
    """Finds what lines show.

    The network names the kinds. Its best one is taken if it is sure, or if the lines lie on those of a member: then
    they are a picture of the library's, whichever side the network has seen too little of.
    """
    wanted, network = described(lines), trained()
    opinion = network.opinion(lines)
    best = opinion.kinds[:-1].topk(GUESSES)
    kinds, sure = [network.kinds[place] for place in best.indices.tolist()], best.values.tolist()
    found = [_match(wanted, kind, opinion) for kind in kinds]
    next_best = max(match.score for match in found[1:])
    on_lines = confidence(found[0].score, next_best, gap_to(lines, kinds[0], found[0]))
    taken = sure[0] >= network.threshold or on_lines >= LEAST_CONFIDENCE
    first = min(max(sure[0], on_lines), MOST)
    # What the first gains the others lose.
    left = (1 - first) / max(1 - sure[0], 1 - MOST)
    confidences = (first, *(min(left, 1.0) * share for share in sure[1:]))
    guesses = [_guess(lines, *three) for three in zip(kinds, found, confidences, strict=True)]
    return Recognition(tuple(guesses), taken)


def recognised(lines: Lines) -> Guess:
    """What lines show.

    Raises:
        NotRecognised: no guess is sure enough.
    """
    found = recognise(lines)
    if not found.taken:
        raise NotRecognised(
            found,
            f"the built-in prior does not recognise the {lines.kind}: it may be one of these, or none of the "
            f"{len(trained().kinds)} kinds of things that it recognises. If it is one of the library's "
            f"{len(CATEGORIES)}, say so with --shows:\n{found}\n"
            "For any picture use Zero-1-to-3, on a GPU: diff3ds fetch zero123, then --prior zero123",
        )
    return found.guesses[0]


@torch_on_one_thread()
def seen_as(lines: Lines, kind: str, attributes: tuple[str, ...] = ()) -> Guess:
    """From where lines show a thing that is known.

    Args:
        attributes: of the thing; if none are named, those that the lines show are found.
    """
    return _guess(lines, kind, _match(described(lines), kind, trained().opinion(lines), attributes), 1.0, attributes)


def _match(wanted: Float[Tensor, " D"], kind: str, opinion: Opinion, attributes: tuple[str, ...] = ()) -> Match:
    likely = opinion.azimuths[:, None] + opinion.elevations
    return seen_from(wanted, kind, attributes, OF_NETWORK * (likely - likely.max()).clamp(min=LEAST_LIKELY))


def _guess(lines: Lines, kind: str, best: Match, sure: float, named: tuple[str, ...] = ()) -> Guess:
    """The guess of a match, whose attributes are those that are named, or that the lines show."""
    shown = best.attributes if named or shows_attributes(lines, kind, best) else ()
    return Guess(kind, shown, best.azimuth, best.elevation, sure, CATEGORIES[kind].captions(shown)[0])
