"""Adam for strokes: what it moves of a sketch, one step of it, and the sketch that comes of it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from diff3ds._shapes import Tensor
from diff3ds.constraints import Constraint
from diff3ds.optimize.checkpoint import State
from diff3ds.optimize.config import FitConfig, Rates
from diff3ds.sketch import Sketch

# Adam's usual constants (Kingma and Ba 2015).
BETA1, BETA2, EPSILON = 0.9, 0.999, 1e-8

# Fields that Adam moves as logarithms, because they are positive.
LOGARITHMIC = ("weights", "width")


def leaves_of(sketch: Sketch, rates: Rates) -> dict[str, Tensor]:
    """The values that Adam moves, by field."""
    moved = {name: value for name, value in sketch.tensors().items() if getattr(rates, name)}
    values = {name: value.log() if name in LOGARITHMIC else value for name, value in moved.items()}
    return {name: value.detach().clone().requires_grad_() for name, value in values.items()}


def assembled(sketch: Sketch, leaves: dict[str, Tensor], constraints: Sequence[Constraint]) -> Sketch:
    """A sketch with the values that Adam has moved, joints joined and constraints kept."""
    moved = {name: value.exp() if name in LOGARITHMIC else value for name, value in leaves.items()}
    tensors = {**sketch.tensors(), **moved}
    if sketch.chains is not None:
        # A joint is one point, with one width.
        shared = [name for name in sketch.segment_fields if name != "weights"]
        tensors |= {name: sketch.chains.joined(tensors[name]) for name in shared}
    moved_sketch = sketch.replace(**tensors)
    for constrained in constraints:
        moved_sketch = constrained(moved_sketch)
        if not isinstance(moved_sketch, Sketch):
            raise TypeError(f"a constraint must return a Sketch, got {type(moved_sketch).__name__}")
    return moved_sketch


def descended(
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
        state, sketch=assembled(state.sketch, kept_in, config.constraints), first=first, second=second, age=age
    )


def _scheduled(name: str, rate: Callable[[int], float], step: int) -> float:
    """The rate of a step.

    Raises:
        ValueError: the function gives no finite rate, not negative.
    """
    value = rate(step)
    if not isinstance(value, int | float) or not 0 <= value < math.inf:
        raise ValueError(f"the rate of {name} in step {step} must be a finite number, not negative, got {value!r}")
    return value
