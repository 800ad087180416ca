"""How a prior moves a sketch: what can be chosen, and the checks of it. Needs no torch, so that options can use it."""

from dataclasses import dataclass, field
from typing import Literal, get_args

# Ways of score distillation (`methods`), weights w(t) of their gradients (`formulas.weighted`), and number formats of
# networks (`device.pick_dtype`).
Method = Literal["sds", "reconstruction", "csd", "nfsd", "asd", "ism", "sdi", "vsd"]
Weighting = Literal["sds", "uniform", "fantasia3d", "ratio"]
Precision = Literal["auto", "float16", "bfloat16", "float32"]

# Timesteps of all models here.
TIMESTEPS = 1000


@dataclass(frozen=True)
class Work:
    """What a prior does in a step, as far as its memory goes.

    Attributes:
        views: images.
        conditions: under which its network looks at each of them at once.
        trained: whether a network is trained on them too, as vsd does.
    """

    views: int = 4
    conditions: int = 2
    trained: bool = False


# The paper's step.
USUAL = Work()


def conditions(method: Method) -> int:
    """Branches that a method asks for at once, at most."""
    return 3 if method == "nfsd" else 2


@dataclass(frozen=True)
class TimeAnnealing:
    """Timesteps that a step draws from: from high noise, which settles the shape, to low noise, which settles details.

    The paper: 0.85 at first; over 3,600 of 4,000 steps down to between 0.10 and 0.30; then constant.

    Attributes:
        low, high: fraction of all timesteps between which the first step draws.
        final_low, final_high: the same after the annealing.
        share: fraction of the steps that the annealing takes; 0 has the final bounds from the start.
    """

    low: float = 0.85
    high: float = 0.85
    final_low: float = 0.10
    final_high: float = 0.30
    share: float = 0.9

    def __post_init__(self) -> None:
        for low, high in ((self.low, self.high), (self.final_low, self.final_high)):
            if not 0 < low <= high < 1:
                raise ValueError(f"timesteps must be drawn between fractions 0 < low <= high < 1, got {low} and {high}")
        if not 0 <= self.share <= 1:
            raise ValueError(f"share must lie in [0, 1], got {self.share}")

    @property
    def lowest(self) -> int:
        """The lowest timestep of the whole run."""
        return round(TIMESTEPS * min(self.low, self.final_low))

    def bounds(self, step: int, steps: int) -> tuple[int, int]:
        """Lowest and highest timestep of this step (counted from 0) of so many, both inclusive.

        Rounded, twice so that the error of the interpolation does not count: 0.10 comes as 0.0999..., of which
        truncation would make 99.
        """
        done = min(1.0, step / (self.share * steps)) if self.share else 1.0
        ends = ((self.low, self.final_low), (self.high, self.final_high))
        low, high = (round(round(TIMESTEPS * (first + (last - first) * done), 6)) for first, last in ends)
        return low, high


@dataclass(frozen=True)
class Recipe:
    """How a prior moves a sketch.

    Attributes:
        method: reconstruction (MVDream's form of SDS), sds, or a later one: csd, nfsd, asd, ism, sdi, vsd.
        guidance: weight λ of classifier-free guidance. The paper: 50 for a phrase, 7.5 for a picture.
        rescale: fraction of the contrast that reconstruction restores, in [0, 1].
        weighting: w(t) of the methods that have one: sds is 1 - ᾱ.
        clip: entries of the gradient with respect to the latents are limited to ± this; None does not limit them.
        annealing: timesteps that are drawn.
    """

    method: Method = "reconstruction"
    guidance: float = 50.0
    rescale: float = 0.5
    weighting: Weighting = "sds"
    clip: float | None = None
    annealing: TimeAnnealing = field(default_factory=TimeAnnealing)

    def __post_init__(self) -> None:
        for name, allowed in (("method", get_args(Method)), ("weighting", get_args(Weighting))):
            if getattr(self, name) not in allowed:
                raise ValueError(f"{name} must be one of {', '.join(allowed)}, got {getattr(self, name)!r}")
        if not 0 <= self.rescale <= 1:
            raise ValueError(f"rescale must lie in [0, 1], got {self.rescale}")
        if self.clip is not None and not self.clip > 0:
            raise ValueError(f"clip must be positive, got {self.clip}")
        if not abs(self.guidance) < float("inf"):
            raise ValueError(f"guidance must be finite, got {self.guidance}")


def check_orbits(batch: int, group: int, distance: tuple[float, float], elevation: tuple[float, float]) -> None:
    """Raises ValueError for numbers that no `Orbits` can have; what they are is said there."""
    if batch < 1 or batch % group:
        raise ValueError(f"batch must be a multiple of {group}, the views of this prior, got {batch}")
    for name, (low, high) in (("distance", distance), ("elevation", elevation)):
        if not low <= high:
            raise ValueError(f"{name} must be (lowest, highest), got {low} and {high}")
    if not distance[0] > 0 or not (elevation[0] > -90 and elevation[1] < 90):
        raise ValueError(
            f"distance must be positive and elevation in (-90, 90) degrees, got {distance} and {elevation}"
        )
