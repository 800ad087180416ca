"""How `fit` runs: learning rates, and all other settings of an optimisation."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from os import PathLike
from pathlib import Path
from typing import Protocol, runtime_checkable

from diff3ds._settings import check_seed
from diff3ds._shapes import Tensor
from diff3ds.camera import Cameras
from diff3ds.constraints import Constraint
from diff3ds.optimize.strokes import Refinement
from diff3ds.project import Strokes2D
from diff3ds.render.antialiasing import Analytic, Antialiasing, MonteCarlo, antialiasing_from
from diff3ds.render.checks import Background
from diff3ds.sketch import Sketch

Rate = float | Callable[[int], float]

# Maps a sketch, the cameras of a step and its index to what is drawn.
Projection = Callable[[Sketch, Cameras, int], Strokes2D]


@runtime_checkable
class Stateful(Protocol):
    """What learns beside the sketch, inside the objective, and must be in the checkpoint for a run to go on from it."""

    def state(self) -> dict[str, Tensor]:
        """A copy of all that has changed, by name, on its own device: it is asked for in every step."""
        ...

    def restore(self, state: dict[str, Tensor]) -> None:
        """Goes on from what `state` gave, which may come from the CPU."""
        ...


@dataclass(frozen=True)
class Rates:
    """Adam's learning rates at the first step; fields with rate 0 stay as they are.

    A rate may be a function of the step's index that gives the rate of that step; then `FitConfig.final_rate` has no
    part in it.

    Attributes:
        points: world units a step.
        weights: of the weights' logarithms, so that they stay positive.
        width: of the widths' logarithms, so that thin and thick strokes change alike and none vanishes for good; widths
            stay within `FitConfig.width_range`.
        color: colours stay in [0, 1].
        opacity: opacities stay in [0, 1].
    """

    points: Rate = 0.01
    weights: Rate = 0.0
    width: Rate = 0.0
    color: Rate = 0.0
    opacity: Rate = 0.0


@dataclass(frozen=True)
class FitConfig:
    """How `fit` runs.

    Attributes:
        steps: gradient steps.
        rates: learning rates at the first step.
        final_rate: learning rates fall exponentially, to this fraction of their start.
        width_range: least and greatest width, in units of `Sketch.width`, if widths have a rate.
        background: of the renderings, as for `render`.
        antialiasing: as for `render`, or a function of the step's index that gives it; a `MonteCarlo` without a
            generator, since samples are drawn by `seed`.
        project: what is drawn in a step, a function of the sketch, the cameras and the step's index; by default all
            strokes as `render` draws them. Hides strokes in some views, or draws them as something else.
        constraints: what strokes must keep to (`diff3ds.constraints`), applied in this order before a step is drawn and
            after it; not together with refinements, which renumber strokes.
        refinements: called after every step, in this order; they may drop and add strokes.
        seed: of all random draws; a CPU run repeats bit for bit, whatever the number of threads.
        checkpoint: file that keeps the state, written every `checkpoint_every` steps, at the end, and when the run is
            left early by an exception, Ctrl-C included.
        checkpoint_every: steps.
        resume: go on from the checkpoint if it exists; the run continues as if it had never stopped.
        identity: what else a run must share to go on from a checkpoint, as JSON knows it.
        stateful: what learns in the objective; it is kept in the checkpoint and restored from it.
    """

    steps: int = 1000
    rates: Rates = field(default_factory=Rates)
    final_rate: float = 0.1
    width_range: tuple[float, float] = (0.0, math.inf)
    background: Background = 1.0
    antialiasing: Antialiasing | Callable[[int], Antialiasing] = "analytic"
    project: Projection | None = None
    constraints: Sequence[Constraint] = ()
    refinements: Sequence[Refinement] = ()
    seed: int = 0
    checkpoint: Path | None = None
    checkpoint_every: int = 100
    resume: bool = False
    identity: Mapping[str, object] = field(default_factory=dict)
    stateful: Stateful | None = None

    def __post_init__(self) -> None:
        self._check_kinds()
        if self.checkpoint is not None:
            object.__setattr__(self, "checkpoint", Path(self.checkpoint))
        check_seed(self.seed)
        for name in ("steps", "checkpoint_every"):
            if not isinstance(getattr(self, name), int) or getattr(self, name) < 1:
                raise ValueError(f"{name} must be a positive integer, got {getattr(self, name)!r}")
        for name, rate in {**asdict(self.rates), "final_rate": self.final_rate}.items():
            if callable(rate) and name != "final_rate":
                continue
            if not (isinstance(rate, int | float) and 0 <= rate < math.inf) or (name == "final_rate" and rate == 0):
                raise ValueError(f"{name} must be a finite rate, not negative, got {rate}")
        if not any(asdict(self.rates).values()):
            raise ValueError("all learning rates are 0: nothing would change")
        if not (isinstance(self.width_range, Sequence) and len(self.width_range) == 2):
            raise ValueError(f"width_range must be (least, greatest), got {self.width_range!r}")
        least, most = self.width_range
        if not 0 <= least <= most:
            raise ValueError(f"width_range must be (least, greatest), not negative, got {self.width_range}")
        if self.constraints and self.refinements:
            raise ValueError("constraints and refinements cannot be combined: refinements renumber the strokes")
        if self.resume and self.checkpoint is None:
            raise ValueError("resume needs a checkpoint file: give checkpoint=")
        # What a function gives is known when its steps come.
        if not callable(self.antialiasing):
            self.antialiasing_at(0)

    def antialiasing_at(self, step: int) -> Analytic | MonteCarlo:
        """That of a step.

        Raises:
            ValueError: no antialiasing, or a `MonteCarlo` with a generator.
        """
        how = antialiasing_from(self.antialiasing(step) if callable(self.antialiasing) else self.antialiasing)
        if isinstance(how, MonteCarlo) and how.generator is not None:
            raise ValueError(
                "antialiasing must be a MonteCarlo without a generator in FitConfig, got one with a generator: its "
                "samples are drawn by FitConfig(seed=...)"
            )
        return how

    def _check_kinds(self) -> None:
        """Raises TypeError for the first field of another kind; names it."""
        functions = isinstance(self.refinements, Sequence) and all(callable(r) for r in self.refinements)
        learns = self.stateful is None or isinstance(self.stateful, Stateful)
        rules = {
            "rates": (isinstance(self.rates, Rates), "Rates(points=..., ...)"),
            "project": (self.project is None or callable(self.project), "a function of sketch, cameras and step"),
            "constraints": (
                isinstance(self.constraints, Sequence) and all(callable(c) for c in self.constraints),
                "a sequence of functions from a sketch to a sketch",
            ),
            "refinements": (functions, "a sequence of functions"),
            "checkpoint": (isinstance(self.checkpoint, str | PathLike | None), "a path or None"),
            "identity": (isinstance(self.identity, Mapping), "a mapping from names to what JSON knows"),
            "stateful": (learns, "an object with the methods state and restore"),
        }
        for name, (holds, expected) in rules.items():
            if not holds:
                raise TypeError(f"{name} must be {expected}, got {getattr(self, name)!r}")
