"""The optimisation loop: a sketch follows the gradient of any objective through the renderer."""

import inspect
import math
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Protocol, runtime_checkable

import torch

from diff3ds._settings import check_seed
from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.constraints import Constraint
from diff3ds.optimize.checkpoint import State, read_checkpoint, start, write_checkpoint
from diff3ds.optimize.strokes import Refinement
from diff3ds.project import Strokes2D
from diff3ds.render import Rendering, rasterize, render
from diff3ds.render.backends import torch_on_one_thread
from diff3ds.render.checks import Background
from diff3ds.render.options import Antialiasing, MonteCarlo, antialiasing_from
from diff3ds.sketch import Sketch

# Adam's usual constants (Kingma and Ba 2015).
BETA1, BETA2, EPSILON = 0.9, 0.999, 1e-8

# Losses on a GPU are looked at every so many steps: a look waits for the device (empirical).
LOOK_EVERY = 100

# Fields that Adam moves as logarithms, because they are positive.
LOGARITHMIC = ("weights", "width")

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
        blur: of the renderings, pixels: a number, or a function of the step's index; only where `antialiasing` is a
            name.
        width_range: least and greatest width, in units of `Sketch.width`, if widths have a rate.
        background: of the renderings, as for `render`.
        antialiasing: as for `render`; a `MonteCarlo` without a generator, since samples are drawn by `seed`.
        samples: as for `render`.
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
    blur: float | Callable[[int], float] | None = None
    width_range: tuple[float, float] = (0.0, math.inf)
    background: Background = 1.0
    antialiasing: Antialiasing = "analytic"
    samples: int | None = None
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
        how = antialiasing_from(self.antialiasing, 0.0 if callable(self.blur) else self.blur, self.samples)
        if isinstance(how, MonteCarlo) and how.generator is not None:
            raise ValueError(
                "antialiasing must be a MonteCarlo without a generator in FitConfig, got one with a generator: its "
                "samples are drawn by FitConfig(seed=...)"
            )

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


@dataclass(frozen=True, eq=False)
class Step:
    """What one step did.

    Attributes:
        index: 0 for the first.
        sketch: after the step, detached.
        loss_tensor: what the objective returned, detached; NaN on a GPU where a gradient was not finite.
        rendering: before it, what the objective saw, detached.
    """

    index: int
    sketch: Sketch
    loss_tensor: Float[Tensor, ""]
    rendering: Rendering

    @property
    def loss(self) -> float:
        """The loss before the step; on a GPU, reading it waits for the device."""
        return float(self.loss_tensor)


# Maps a rendering, its cameras and the index of the step to a scalar loss. One with a parameter called `sketch` is
# handed the sketch that was drawn as well, for regularisers.
Objective = Callable[..., Tensor]
CameraSampler = Callable[[int, torch.Generator], Cameras]


def fit(
    sketch: Sketch, objective: Objective, cameras: Cameras | CameraSampler, config: FitConfig | None = None
) -> Generator[Step]:
    """Optimises a sketch by gradient descent (Adam); yields after every step.

    Nothing is lost by leaving the loop: every yielded sketch is complete, and the checkpoint is written on the way out.
    (Who keeps the generator under a name of its own leaves it by its `close()`.)

    Args:
        sketch: where to start.
        objective: called with the rendering (gradients on), the cameras and the step's index; and, if it has a
            parameter of that name, `sketch=` what was drawn (gradients on), for regularisers such as
            `losses.bending_energy`.
        cameras: the same views in every step, or a function (step, generator) that gives those of a step.
        config: default `FitConfig()`.

    Raises:
        TypeError: a sketch, a config, an objective or cameras of another kind.
        ValueError: a sketch without strokes, cameras without views; a checkpoint of another run.
        FloatingPointError: in the loop, when a loss or a gradient is not finite; names the step. On a GPU, for which no
            step waits, up to `LOOK_EVERY` steps later; such a step has no gradient.
    """
    config = FitConfig() if config is None else config
    if not isinstance(config, FitConfig):
        raise TypeError(f"config must be FitConfig(...) or None, got {type(config).__name__}")
    if not isinstance(sketch, Sketch):
        raise TypeError(f"sketch must be a Sketch, got {type(sketch).__name__}")
    if not callable(objective):
        raise TypeError(f"objective must be a function of rendering, cameras and step, got {type(objective).__name__}")
    if not len(sketch):
        raise ValueError("the sketch has no strokes to fit")
    if config.rates.width and not bool((sketch.width > 0).all()):
        raise ValueError("a stroke of width 0 cannot grow: give all strokes a width to fit widths")
    sampler = _sampler(cameras)
    stateful = config.stateful.state() if config.stateful is not None else {}
    state = replace(start(sketch.detach(), config.seed), stateful=stateful)
    if config.resume and config.checkpoint is not None and config.checkpoint.exists():
        state = read_checkpoint(config.checkpoint, _settings(config)).to(sketch.points.device)
        if config.stateful is not None:
            config.stateful.restore(state.stateful)
    return _run(state, objective, sampler, config)


def _sampler(cameras: Cameras | CameraSampler) -> CameraSampler:
    """The views of a step, by its index."""
    if callable(cameras):
        return cameras
    if not isinstance(cameras, Cameras):
        raise TypeError(f"cameras must be Cameras or a function of step and generator, got {type(cameras).__name__}")
    if not len(cameras):
        raise ValueError("the cameras have no views to fit")
    return lambda step, generator: cameras


def _checked(views: Cameras, step: int) -> Cameras:
    """The views of a step that a user's function gave, if they are some."""
    if not isinstance(views, Cameras):
        raise TypeError(
            f"the function that gives cameras must return Cameras, got {type(views).__name__} in step {step}"
        )
    if not len(views):
        raise ValueError(f"the cameras of step {step} have no views to fit")
    return views


def _settings(config: FitConfig) -> dict[str, object]:
    """Names what must be the same for a run to go on from a checkpoint."""
    names = ("steps", "final_rate", "seed")
    how = antialiasing_from(config.antialiasing, samples=config.samples)
    mode, samples = ("montecarlo", how.samples) if isinstance(how, MonteCarlo) else ("analytic", MonteCarlo().samples)
    # Named apart from what an identity may hold: a run has a width as well as a rate of widths.
    rates = {f"rate of {name}": _named(rate) for name, rate in asdict(config.rates).items()}
    chosen = {name: getattr(config, name) for name in names} | {"antialiasing": mode, "samples": samples}
    return {**rates, **chosen, **config.identity}


def _scheduled(name: str, rate: Callable[[int], float], step: int) -> float:
    """The rate of a step.

    Raises:
        ValueError: the function gives no finite rate, not negative.
    """
    value = rate(step)
    if not isinstance(value, int | float) or not 0 <= value < math.inf:
        raise ValueError(f"the rate of {name} in step {step} must be a finite number, not negative, got {value!r}")
    return value


def _named(rate: Rate) -> object:
    """A rate as a checkpoint keeps it: functions by their names."""
    return f"function {getattr(rate, '__qualname__', type(rate).__name__)}" if callable(rate) else rate


def _run(state: State, objective: Objective, cameras: CameraSampler, config: FitConfig) -> Generator[Step]:
    try:
        while state.index < config.steps:
            with torch_on_one_thread(), torch.enable_grad():
                state, step = _advance(state, objective, cameras, config)
            if state.index % LOOK_EVERY == 0 or state.index == config.steps:
                state = _looked_at(state)
            if config.checkpoint is not None and state.index % config.checkpoint_every == 0:
                write_checkpoint(config.checkpoint, state, _settings(config))
            yield step
    finally:
        if config.checkpoint is not None:
            write_checkpoint(config.checkpoint, state, _settings(config))


def _advance(state: State, objective: Objective, cameras: CameraSampler, config: FitConfig) -> tuple[State, Step]:
    """One step. The given state is left as it is, so that an interruption loses this step only."""
    generator = state.generator()
    views = _checked(cameras(state.index, generator), state.index)
    leaves = _leaves(state.sketch, config.rates)
    sketch = _assembled(state.sketch, leaves, config.constraints)
    rendering = _drawn(sketch, views, state.index, config, generator)
    seen = {"sketch": sketch} if _looks_at_sketches(objective) else {}
    loss = objective(rendering, views, state.index, **seen)
    loss, gradients = _gradients(loss, leaves, state.index)
    decay = config.final_rate ** (state.index / config.steps)
    state = _descended(state, leaves, gradients, config, decay)
    for refine in config.refinements:
        edit = refine(state.index, config.steps, state.sketch, generator)
        if edit is not None:
            state = state.edited(edit)
    if config.stateful is not None:
        state = replace(state, stateful=config.stateful.state())
    step = Step(state.index, state.sketch, loss, Rendering(*(x.detach() for x in vars(rendering).values())))
    state = replace(state, index=state.index + 1, unseen=(*state.unseen, loss), random=generator.get_state())
    return (_looked_at(state) if _known_at_once(loss) else state), step


def _drawn(sketch: Sketch, views: Cameras, index: int, config: FitConfig, generator: torch.Generator) -> Rendering:
    blur = config.blur(index) if callable(config.blur) else config.blur
    how = antialiasing_from(config.antialiasing, blur, config.samples)
    if isinstance(how, MonteCarlo):
        how = replace(how, generator=generator)
    if config.project is None:
        return render(sketch, views, background=config.background, antialiasing=how)
    strokes = config.project(sketch, views, index)
    return rasterize(strokes, views.size, background=config.background, antialiasing=how)


def _leaves(sketch: Sketch, rates: Rates) -> dict[str, Tensor]:
    """The values that Adam moves, by field."""
    moved = {name: value for name, value in sketch.tensors().items() if getattr(rates, name)}
    values = {name: value.log() if name in LOGARITHMIC else value for name, value in moved.items()}
    return {name: value.detach().clone().requires_grad_() for name, value in values.items()}


def _looks_at_sketches(objective: Objective) -> bool:
    try:
        return "sketch" in inspect.signature(objective).parameters
    except (TypeError, ValueError):
        # Some built-in functions say nothing of their parameters.
        return False


def _assembled(sketch: Sketch, leaves: dict[str, Tensor], constraints: Sequence[Constraint]) -> Sketch:
    moved = {name: value.exp() if name in LOGARITHMIC else value for name, value in leaves.items()}
    tensors = {**sketch.tensors(), **moved}
    if sketch.chains is not None:
        # A joint is one point, with one width.
        shared = [name for name in sketch.segment_fields if name != "weights"]
        tensors |= {name: sketch.chains.joined(tensors[name]) for name in shared}
    moved_sketch = Sketch(**tensors, width_space=sketch.width_space, chains=sketch.chains, fixed=sketch.fixed)
    for constrained in constraints:
        moved_sketch = constrained(moved_sketch)
        if not isinstance(moved_sketch, Sketch):
            raise TypeError(f"a constraint must return a Sketch, got {type(moved_sketch).__name__}")
    return moved_sketch


def _gradients(loss: Tensor, leaves: dict[str, Tensor], index: int) -> tuple[Float[Tensor, ""], dict[str, Tensor]]:
    """The loss, detached, and the gradients. On a GPU, if not all is finite, NaN and zeros: nothing waits here."""
    if not isinstance(loss, Tensor) or loss.numel() != 1 or loss.is_complex():
        got = f"{loss.dtype} of shape {tuple(loss.shape)}" if isinstance(loss, Tensor) else type(loss).__name__
        raise ValueError(f"the objective must return a real scalar tensor, got {got}")
    if not loss.requires_grad:
        raise ValueError(
            "the objective's loss has no gradient: compute it from the rendering, not from detached tensors"
        )
    loss = loss.reshape(())
    at_once = _known_at_once(loss)
    if at_once and not bool(loss.isfinite()):
        raise FloatingPointError(f"the loss of step {index} is {loss.item()}")
    values = torch.autograd.grad(loss, list(leaves.values()), allow_unused=True)
    gradients = {}
    for (name, leaf), value in zip(leaves.items(), values, strict=True):
        gradients[name] = torch.zeros_like(leaf) if value is None else value
        if at_once and not bool(gradients[name].isfinite().all()):
            raise FloatingPointError(f"the gradient of {name} in step {index} is not finite")
    loss = loss.detach()
    if at_once:
        return loss, gradients
    good = torch.stack([loss.isfinite(), *(g.isfinite().all().to(loss.device) for g in gradients.values())]).all()
    kept = {name: torch.where(good.to(g.device), g, torch.zeros_like(g)) for name, g in gradients.items()}
    return torch.where(good, loss, torch.full_like(loss, math.nan)), kept


def _known_at_once(loss: Tensor) -> bool:
    """Whether a look at a value waits for nothing."""
    return loss.device.type == "cpu"


def _looked_at(state: State) -> State:
    """The state with all losses as numbers.

    Raises:
        FloatingPointError: one of them is not finite.
    """
    losses = state.all_losses()
    for step in range(len(state.losses), len(losses)):
        if not math.isfinite(losses[step]):
            raise FloatingPointError(f"the loss of step {step}, or a gradient in it, is not finite")
    return replace(state, losses=losses, unseen=())


def _descended(
    state: State, leaves: dict[str, Tensor], gradients: dict[str, Tensor], config: FitConfig, decay: float
) -> State:
    """Adam (Kingma and Ba 2015, algorithm 1) with an age for every stroke, because strokes come and go."""
    age, chains = state.age + 1, state.sketch.chains
    of_segments = age if chains is None else age[chains.stroke]
    first, second, moved = dict(state.first), dict(state.second), {}
    for name, gradient in gradients.items():
        first[name] = BETA1 * first[name] + (1 - BETA1) * gradient
        second[name] = BETA2 * second[name] + (1 - BETA2) * gradient.square()
        shape = (-1, *[1] * (gradient.ndim - 1))
        steps = of_segments if name in state.sketch.segment_fields else age
        mean = first[name] / (1 - BETA1**steps).reshape(shape)
        spread = (second[name] / (1 - BETA2**steps).reshape(shape)).sqrt()
        rate = getattr(config.rates, name)
        rate = _scheduled(name, rate, state.index) if callable(rate) else decay * rate
        moved[name] = leaves[name].detach() - rate * mean / (spread + EPSILON)
    # Of logarithms, for the widths.
    widths = [math.log(bound) if bound else -math.inf for bound in config.width_range]
    limits = {"width": widths, "color": (0.0, 1.0), "opacity": (0.0, 1.0)}
    kept_in = {name: value.clamp(*limits[name]) if name in limits else value for name, value in moved.items()}
    return replace(
        state, sketch=_assembled(state.sketch, kept_in, config.constraints), first=first, second=second, age=age
    )
