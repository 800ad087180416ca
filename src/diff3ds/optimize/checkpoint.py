"""The state of a fit, and the file that keeps it: safetensors, so that reading one runs no code."""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds._tensor_files import write_tensors
from diff3ds.optimize.strokes import Edit
from diff3ds.sketch import NUMBERS, Sketch, of_parts, parts_of

VERSION = 1
SKETCH = "sketch."
# Before the names of what learns beside the sketch; files have had it from the start.
STATEFUL = "companion."
# 100,000 strokes with their moments take 40 MB.
MAX_BYTES = 1 << 30


@dataclass(frozen=True, eq=False)
class State:
    """A fit between two steps; never changed in place.

    Attributes:
        index: of the next step.
        sketch: detached.
        first, second: Adam's moments of every field of the sketch.
        age: steps that each stroke has seen.
        random: state of the generator, bytes.
        losses: of all steps so far, but for the last ones on a GPU.
        stateful: what else learns beside the sketch, by name.
        unseen: losses of the last steps on a GPU, which nobody has waited for.
    """

    index: int
    sketch: Sketch
    first: dict[str, Tensor]
    second: dict[str, Tensor]
    age: Float[Tensor, " N"]
    random: Tensor
    losses: tuple[float, ...]
    stateful: dict[str, Tensor] = field(default_factory=dict)
    unseen: tuple[Tensor, ...] = ()

    def all_losses(self) -> tuple[float, ...]:
        """The losses of all steps; waits once for those that are unseen."""
        return (*self.losses, *(torch.stack(self.unseen).tolist() if self.unseen else ()))

    def generator(self) -> torch.Generator:
        """A generator in the state of this moment."""
        generator = torch.Generator()
        generator.set_state(self.random)
        return generator

    def to(self, device: torch.device) -> "State":
        """The same state with the strokes and what belongs to them on another device."""
        first, second = ({k: v.to(device) for k, v in part.items()} for part in (self.first, self.second))
        return replace(self, sketch=self.sketch.to(device), first=first, second=second, age=self.age.to(device))

    def edited(self, edit: Edit) -> "State":
        """The state after strokes were dropped and added; new ones start without moments."""
        parts = [self.sketch[edit.kept], *([edit.added] if edit.added is not None else [])]
        sketch = Sketch.concatenate(parts)
        chains = self.sketch.chains
        segments = edit.kept if chains is None else chains.select(edit.kept)[0]

        def grown(values: Tensor, rows: Tensor, count: int) -> Tensor:
            kept = values[rows]
            return torch.cat([kept, kept.new_zeros(count - len(kept), *kept.shape[1:])])

        def of_field(name: str, values: Tensor) -> Tensor:
            rows = segments if name in self.sketch.segment_fields else edit.kept
            return grown(values, rows, len(sketch.tensors()[name]))

        moments = [{name: of_field(name, value) for name, value in part.items()} for part in (self.first, self.second)]
        return replace(
            self, sketch=sketch, first=moments[0], second=moments[1], age=grown(self.age, edit.kept, len(sketch))
        )


def start(sketch: Sketch, seed: int) -> State:
    """The state before the first step."""
    zeros = {name: torch.zeros_like(value) for name, value in sketch.tensors().items()}
    random = torch.Generator().manual_seed(seed).get_state()
    return State(0, sketch, zeros, zeros, torch.zeros_like(sketch.opacity), random, ())


def write_checkpoint(path: Path, state: State, settings: dict[str, Any]) -> None:
    """Writes a state, whole or not at all; `settings` are what a resumed run must share."""
    strokes, rest = parts_of(state.sketch)
    tensors = {
        **{f"{SKETCH}{name}": value for name, value in strokes.items()},
        **{f"first.{name}": value for name, value in state.first.items()},
        **{f"second.{name}": value for name, value in state.second.items()},
        "age": state.age,
        "random": state.random,
        "losses": torch.tensor(state.all_losses(), dtype=torch.float64),
        **{f"{STATEFUL}{name}": value for name, value in state.stateful.items()},
    }
    about = {"version": VERSION, "index": state.index, "settings": settings, **rest}
    write_tensors(path, tensors, {"diff3ds": json.dumps(about)})


def read_checkpoint(path: Path, settings: dict[str, Any] | None = None) -> State:
    """The state in a checkpoint.

    Args:
        settings: if given, they must be those of the checkpoint.

    Raises:
        FileNotFoundError: it is missing.
        ValueError: it is no checkpoint of this version, is damaged, or belongs to a run with other settings.
    """
    tensors, about = _read(path)
    different = {k: (about["settings"].get(k), v) for k, v in (settings or {}).items() if about["settings"].get(k) != v}
    if different:
        name, (was, now) = next(iter(different.items()))
        raise ValueError(f"{path}: the run to resume had {name}={was}, not {now}: give the same, or start a new run")
    try:
        sketch = of_parts(_under(SKETCH, tensors), about)
        first, second = ({name: tensors[f"{part}.{name}"] for name in NUMBERS} for part in ("first", "second"))
        for moments in (first, second):
            if any(moments[name].shape != value.shape for name, value in sketch.tensors().items()):
                raise ValueError("moments and strokes do not fit")
        losses = tuple(tensors["losses"].tolist())
        beside = _under(STATEFUL, tensors)
        state = State(int(about["index"]), sketch, first, second, tensors["age"], tensors["random"], losses, beside)
        state.generator()
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise ValueError(f"{path}: damaged checkpoint ({error}); delete it to start anew") from error
    return state


def _under(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}


def _read(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    from safetensors import SafetensorError, safe_open

    if path.stat().st_size > MAX_BYTES:
        raise ValueError(f"{path}: larger than any checkpoint ({MAX_BYTES} bytes)")
    try:
        with safe_open(path, "pt") as file:
            about = json.loads((file.metadata() or {})["diff3ds"])
            # Copies: what the library gives is the file itself in memory, which a system may then refuse to replace.
            tensors = {name: file.get_tensor(name).clone() for name in file.keys()}  # noqa: SIM118 (not a dict)
    except (SafetensorError, KeyError, json.JSONDecodeError) as error:
        raise ValueError(f"{path}: not a checkpoint of diff3ds ({error}); delete it to start anew") from error
    if not isinstance(about, dict) or about.get("version") != VERSION or not isinstance(about.get("settings"), dict):
        raise ValueError(f"{path}: not a checkpoint of this version of diff3ds; delete it to start anew")
    return tensors, about
