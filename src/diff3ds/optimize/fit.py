"""The optimisation loop: a sketch follows the gradient of any objective through the renderer."""

import inspect
import math
from collections.abc import Callable, Generator, Iterator
from dataclasses import asdict, dataclass, replace

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.optimize.adam import assembled, descended, leaves_of
from diff3ds.optimize.checkpoint import State, read_checkpoint, start, write_checkpoint
from diff3ds.optimize.config import FitConfig, Rate
from diff3ds.render import Rendering, rasterize, render
from diff3ds.render.antialiasing import MonteCarlo
from diff3ds.render.backends import torch_on_one_thread
from diff3ds.sketch import Sketch

# Losses on a GPU are looked at every so many steps: a look waits for the device (empirical).
LOOK_EVERY = 100


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
# The loss of a sketch in a step, and what was seen of the sketch.
Look = Callable[[Sketch, int, torch.Generator], tuple[Tensor, Rendering]]


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
    state = replace(start(sketch.detach().replace(importance=None), config.seed), stateful=stateful)
    if config.resume and config.checkpoint is not None and config.checkpoint.exists():
        state = read_checkpoint(config.checkpoint, _settings(config)).to(sketch.points.device)
        if config.stateful is not None:
            config.stateful.restore(state.stateful)
    return _run(state, _through_renderer(objective, sampler, config), config)


def descend(sketch: Sketch, loss: Callable[[Sketch, int], Tensor], config: FitConfig) -> Iterator[Sketch]:
    """As `fit`, of a loss of the strokes themselves and the step's index, for which nothing is rendered."""
    nothing = Rendering(torch.empty(0, 0, 0, 3), *(torch.empty(0, 0, 0),) * 2)
    return (
        step.sketch for step in _run(start(sketch.detach(), config.seed), lambda s, i, _: (loss(s, i), nothing), config)
    )


def _through_renderer(objective: Objective, cameras: CameraSampler, config: FitConfig) -> Look:
    """The loss of what is rendered of a sketch."""
    of_sketches = _looks_at_sketches(objective)

    def look(sketch: Sketch, index: int, generator: torch.Generator) -> tuple[Tensor, Rendering]:
        views = _checked(cameras(index, generator), index)
        rendering = _drawn(sketch, views, index, config, generator)
        return objective(rendering, views, index, **({"sketch": sketch} if of_sketches else {})), rendering

    return look


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
    how = config.antialiasing_at(0)
    mode, samples = ("montecarlo", how.samples) if isinstance(how, MonteCarlo) else ("analytic", MonteCarlo().samples)
    # Named apart from what an identity may hold: a run has a width as well as a rate of widths.
    rates = {f"rate of {name}": _named(rate) for name, rate in asdict(config.rates).items()}
    chosen = {name: getattr(config, name) for name in names} | {"antialiasing": mode, "samples": samples}
    return {**rates, **chosen, **config.identity}


def _named(rate: Rate) -> object:
    """A rate as a checkpoint keeps it: functions by their names."""
    return f"function {getattr(rate, '__qualname__', type(rate).__name__)}" if callable(rate) else rate


def _run(state: State, look: Look, config: FitConfig) -> Generator[Step]:
    try:
        while state.index < config.steps:
            with torch_on_one_thread(), torch.enable_grad():
                state, step = _advance(state, look, config)
            if state.index % LOOK_EVERY == 0 or state.index == config.steps:
                state = _looked_at(state)
            if config.checkpoint is not None and state.index % config.checkpoint_every == 0:
                write_checkpoint(config.checkpoint, state, _settings(config))
            yield step
    finally:
        if config.checkpoint is not None:
            write_checkpoint(config.checkpoint, state, _settings(config))


def _advance(state: State, look: Look, config: FitConfig) -> tuple[State, Step]:
    """One step. The given state is left as it is, so that an interruption loses this step only."""
    generator = state.generator()
    leaves = leaves_of(state.sketch, config.rates)
    sketch = assembled(state.sketch, leaves, config.constraints)
    loss, rendering = look(sketch, state.index, generator)
    loss, gradients = _gradients(loss, leaves, state.index)
    decay = config.final_rate ** (state.index / config.steps)
    state = descended(state, leaves, gradients, config, decay)
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
    how = config.antialiasing_at(index)
    if isinstance(how, MonteCarlo):
        how = replace(how, generator=generator)
    if config.project is None:
        return render(sketch, views, background=config.background, antialiasing=how)
    strokes = config.project(sketch, views, index)
    return rasterize(strokes, views.size, background=config.background, antialiasing=how)


def _looks_at_sketches(objective: Objective) -> bool:
    try:
        return "sketch" in inspect.signature(objective).parameters
    except (TypeError, ValueError):
        # Some built-in functions say nothing of their parameters.
        return False


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
    # By this thread: autograd's own for a GPU may take longer to wake than a small drawing takes.
    with torch.autograd.set_multithreading_enabled(False):
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
