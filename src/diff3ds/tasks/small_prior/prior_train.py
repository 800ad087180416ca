"""Training of the small prior: what `diff3ds prior train` does."""

import copy
import json
import math
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from torch.utils.data import DataLoader

from diff3ds._files import write_text
from diff3ds._shapes import Tensor
from diff3ds._tensor_files import write_tensors
from diff3ds.guidance.built_in.small import SCHEDULE, Vocabulary, half_is_fast, write_network
from diff3ds.guidance.built_in.small_network import SmallNetwork
from diff3ds.guidance.device_choice import pick_device
from diff3ds.guidance.objective import step_generator
from diff3ds.guidance.recipe import TIMESTEPS
from diff3ds.render.backends import torch_on_one_thread
from diff3ds.tasks.exact_prior.sketch_folder import read_sketches
from diff3ds.tasks.progress import Progress, Report, Stopped
from diff3ds.tasks.results import ROOM_FOR_NETWORKS, check_output_folder
from diff3ds.tasks.small_prior.prior_data import BuiltIn, Examples, OwnSketches, Subjects, single_thread, typical_ink
from diff3ds.tasks.small_prior.prior_samples import sample_sheet
from diff3ds.tasks.small_prior.train_options import TrainOptions

CHECKPOINT, NETWORK, SHEETS, LOG = "training.safetensors", "small.safetensors", "samples", "training.json"
# Steps over which the learning rate rises, and the fraction of the steps over which it falls to 0 at the end.
# Empirical.
WARM_UP, COOL_DOWN = 50, 0.4
# Timesteps are drawn evenly between these; at others there is nothing to learn, or nothing to see.
FIRST, LAST = 20, 980
# So many steps know a reference view; what else they know is then left out half of the time, in other steps seldom.
WITH_REFERENCE, WITHOUT_WORDS = 0.35, (0.12, 0.5)
# The mean of the weights over steps that ships looks back by a fraction of all steps so far, and by no more than so
# many.
MEMORY = 500
# Matrices of the blocks are moved by Muon (Jordan et al. 2024), all else by AdamW; rates share a scale.
MUON_DECAY, ADAM_BETAS = 0.01, (0.9, 0.98)
CLIP = 1.0
# Batches that each process draws ahead.
AHEAD = 8
# On a CPU a batch is learned in parts of so many objects, one thread each: sums are then the same for any number of
# threads. Parts of 2 cost a thread a quarter more, parts of 16 a tenth (measured).
PART = 4


class Training:
    """A network, the mean of its weights over the steps, and its optimisers."""

    def __init__(self, options: TrainOptions, subjects: Subjects, device: torch.device) -> None:
        if not hasattr(torch.optim, "Muon"):
            raise ImportError(f"training needs torch 2.9 or later, this is {torch.__version__}: pip install -U torch")
        torch.manual_seed(options.seed)
        self.options, self.subjects, self.device = options, subjects, device
        self.vocabulary = Vocabulary(subjects.words, *typical_ink(subjects))  # type: ignore[arg-type] # a protocol
        self.network = SmallNetwork(options.shape(len(subjects.words))).to(device)
        self.mean = copy.deepcopy(self.network).requires_grad_(False)
        named = dict(self.network.named_parameters())
        inner = {name for name, p in named.items() if name.startswith("blocks.") and name.endswith(".weight")}
        matrices = [p for name, p in named.items() if name in inner]
        others = [p for name, p in named.items() if name not in inner]
        self.optimisers: tuple[torch.optim.Optimizer, ...] = (
            torch.optim.Muon(matrices, options.rate, MUON_DECAY, adjust_lr_fn="match_rms_adamw"),
            torch.optim.AdamW(others, options.rate, ADAM_BETAS, weight_decay=0.0),
        )
        self._pool = ThreadPoolExecutor(options.threads or os.cpu_count() or 1)
        self.step = 0
        self.losses: list[float] = []

    def identity(self) -> dict[str, Any]:
        """Names what a resumed run must share."""
        own = {name: getattr(self.options, name) for name in ("batch", "rate", "seed")}
        own |= self.subjects.folder.identity if isinstance(self.subjects, OwnSketches) else {}
        return own | asdict(self.network.shape)

    def learn(self, batch: dict[str, Tensor]) -> float:
        """One step; returns the loss."""
        generator = step_generator(self.options.seed, self.step)
        for optimiser in self.optimisers:
            for group in optimiser.param_groups:
                group["lr"] = self.options.rate * rate_fraction(self.step, self.options.steps)
        loss = self._descend(self._task(batch, generator))
        norm = float(torch.nn.utils.clip_grad_norm_(self.network.parameters(), CLIP))
        if not math.isfinite(loss + norm):
            # Before it is in the weights, and they are in the checkpoint.
            raise FloatingPointError(f"the loss of step {self.step}, or a gradient, is not finite: try a lower --rate")
        with _whole():
            for optimiser in self.optimisers:
                optimiser.step()
                optimiser.zero_grad()
            fraction = 1 / min(MEMORY, 1 + self.step / 5)
            with torch.no_grad():
                for kept, new in zip(self.mean.parameters(), self.network.parameters(), strict=True):
                    kept.lerp_(new, fraction)
            self.step += 1
            self.losses.append(loss)
        return self.losses[-1]

    def _task(self, batch: dict[str, Tensor], generator: torch.Generator) -> list[Tensor]:
        """The v that is wanted, and what the network is given to find it."""
        clean = (batch["views"] - self.vocabulary.mean) / self.vocabulary.spread
        steps = torch.randint(FIRST, LAST + 1, (len(clean),), generator=generator)
        noise = torch.randn(clean.shape, generator=generator)
        kept = SCHEDULE.alpha_bars[steps][:, None, None, None]
        noisy = kept.sqrt() * clean + (1 - kept).sqrt() * noise
        wanted = kept.sqrt() * noise - (1 - kept).sqrt() * clean
        sees = float(torch.rand((), generator=generator)) < WITH_REFERENCE
        told = torch.rand(len(clean), 1, generator=generator) >= WITHOUT_WORDS[sees]
        task = [wanted, noisy, steps / TIMESTEPS, batch["cameras"], batch["words"] * told]
        if sees:
            standard = (batch["reference"] - self.vocabulary.mean) / self.vocabulary.spread
            task += [standard, batch["reference_camera"]]
        return [x.to(self.device) for x in task]

    def _descend(self, task: list[Tensor]) -> float:
        """Sets the gradients of the mean loss of a batch, and returns it."""
        objects = len(task[0])
        size = PART if self.device.type == "cpu" else objects
        parts = [[x[i : i + size] for x in task] for i in range(0, objects, size)]
        # On a GPU there is one part, for the caller's own stream.
        found = list(self._pool.map(self._gradients, parts) if len(parts) > 1 else map(self._gradients, parts))
        for parameter, *gradients in zip(self.network.parameters(), *(g for g, _ in found), strict=True):
            # Layers of the reference view have no part in steps without one, and stay.
            if gradients[0] is not None:
                parameter.grad = torch.stack(gradients).sum(0) / task[0].numel()
        return sum(loss for _, loss in found) / task[0].numel()

    def _gradients(self, part: list[Tensor]) -> tuple[tuple[Tensor | None, ...], float]:
        """Computes the gradients of the sum of squared errors in some objects of a batch, and this sum."""
        wanted, *given = part
        # The cache of a network in half precision is one for all threads.
        half = half_is_fast(self.device)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=half, cache_enabled=False):
            predicted = self.network(*given)
        loss = (predicted.float() - wanted).square().sum()
        return torch.autograd.grad(loss, [*self.network.parameters()], allow_unused=True), loss.item()

    def save(self, path: Path) -> None:
        """Writes all of it, whole or not at all."""
        tensors = {f"network.{k}": v for k, v in self.network.state_dict().items()}
        tensors |= {f"mean.{k}": v for k, v in self.mean.state_dict().items()}
        for i, optimiser in enumerate(self.optimisers):
            for j, state in optimiser.state_dict()["state"].items():
                tensors |= {f"optimiser.{i}.{j}.{k}": torch.as_tensor(v) for k, v in state.items()}
        tensors["losses"] = torch.tensor(self.losses, dtype=torch.float64)
        about = {"identity": self.identity(), "step": self.step, "words": list(self.vocabulary.words)}
        write_tensors(path, tensors, {"diff3ds": json.dumps(about)})

    def load(self, path: Path) -> None:
        """Goes on from a checkpoint.

        Raises:
            ValueError: it is no checkpoint of such a training, or of one that went further.
        """
        from safetensors import SafetensorError, safe_open

        wrong = (SafetensorError, AttributeError, KeyError, TypeError, ValueError, OverflowError, RuntimeError)
        try:
            with safe_open(path, "pt") as file:
                about = json.loads((file.metadata() or {})["diff3ds"])
                tensors = {name: file.get_tensor(name).clone() for name in file.keys()}  # noqa: SIM118 (not a dict)
            was, step, known = dict(about["identity"]), int(about["step"]), list(about["words"])
        except wrong as error:
            raise ValueError(f"{path}: not a checkpoint of this training ({str(error)[:200]})") from error
        different = [name for name, value in self.identity().items() if was.get(name) != value]
        if known != list(self.vocabulary.words):
            different = ["library"]
        if different:
            raise ValueError(f"the training to resume had another {different[0]}: give the same, or start a new one")
        if step > self.options.steps:
            raise ValueError(f"{step} steps are done, more than the {self.options.steps} asked for")
        try:
            self._adopt(step, tensors)
        except wrong as error:
            raise ValueError(f"{path}: not a checkpoint of this training ({str(error)[:200]})") from error

    def _adopt(self, step: int, tensors: dict[str, Tensor]) -> None:
        for part, network in (("network.", self.network), ("mean.", self.mean)):
            network.load_state_dict({k.removeprefix(part): v for k, v in tensors.items() if k.startswith(part)})
        for i, optimiser in enumerate(self.optimisers):
            self._restore(optimiser, f"optimiser.{i}.", tensors)
        self.step, self.losses = step, tensors["losses"].tolist()

    @staticmethod
    def _restore(optimiser: torch.optim.Optimizer, part: str, tensors: dict[str, Tensor]) -> None:
        state: dict[int, dict[str, Tensor]] = {}
        for name, value in tensors.items():
            if name.startswith(part):
                index, key = name.removeprefix(part).split(".")
                state.setdefault(int(index), {})[key] = value
        optimiser.load_state_dict({"state": state, "param_groups": optimiser.state_dict()["param_groups"]})


@contextmanager
def _whole() -> Iterator[None]:
    """Ctrl-C waits for the end of this block: half a step would be in the checkpoint, and done again after it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    asked: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: asked.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if asked:
        signal.raise_signal(signal.SIGINT)


def rate_fraction(step: int, steps: int) -> float:
    """The fraction of the full learning rate: it rises, stays, and falls to 0 over the last steps."""
    left = (steps - step) / (COOL_DOWN * steps)
    return min((step + 1) / WARM_UP, 1.0, max(left, 0.0))


def train_prior(
    out: Path,
    options: TrainOptions | None = None,
    report: Report = lambda progress: None,
    say: Callable[[str], None] = lambda line: None,
) -> Path:
    """Trains a small prior and writes it; Ctrl-C keeps a checkpoint, then `Stopped` is raised.

    Args:
        out: folder of the network, checkpoint, samples and log.
        report: called after every step.
        say: told where it computes.

    Returns:
        The file of the network.

    Raises:
        ValueError, OSError: as `check_output_folder` and `read_sketches`; the folder holds another training than that
            to be resumed.
        ImportError: torch is older than 2.9.
        FloatingPointError: a loss is not finite.
    """
    options = options or TrainOptions()
    checkpoint = out / CHECKPOINT
    check_output_folder(out, checkpoint, options.resume, options.overwrite, ROOM_FOR_NETWORKS)
    if (out / NETWORK).exists() and not options.resume and not options.overwrite:
        raise ValueError(f"{out} holds {NETWORK}: give another folder (-o), or --overwrite")
    device = pick_device(options.device)
    subjects: BuiltIn | OwnSketches = BuiltIn()
    if options.library is not None:
        folder = read_sketches(options.library, options.up)
        for warning in folder.warnings:
            say(warning)
        subjects = OwnSketches(folder)
    with torch_on_one_thread():
        training = Training(options, subjects, device)
        if options.resume:
            training.load(checkpoint)
        else:
            # Of a training that is overwritten.
            for sheet in (out / SHEETS).glob("step_*.png"):
                sheet.unlink()
        million = sum(p.numel() for p in training.network.parameters()) / 1e6
        say(f"training on {device} with {million:.1f} M parameters")
        try:
            _run(training, out, report)
        except KeyboardInterrupt:
            _write(training, out)
            raise Stopped from None
        return _write(training, out)


def _run(training: Training, out: Path, report: Report) -> None:
    options = training.options
    for batch in _batches(training):
        training.learn(batch)
        latest = training.losses[-50:]
        report(Progress("training", training.step, options.steps, sum(latest) / len(latest), 0))
        if training.step % options.checkpoint_every == 0:
            _write(training, out)
            sheet = out / SHEETS / f"step_{training.step:06d}.png"
            sample_sheet(sheet, training.mean, training.vocabulary, training.subjects.shown, training.device)


def _batches(training: Training) -> Iterator[dict[str, Tensor]]:
    """Batches from the next step on, drawn ahead by processes of their own."""
    options = training.options
    examples = Examples(options.seed, options.steps * options.batch, training.subjects)
    return iter(
        DataLoader(
            examples,
            options.batch,
            sampler=range(training.step * options.batch, len(examples)),
            num_workers=options.workers,
            worker_init_fn=single_thread,
            prefetch_factor=AHEAD if options.workers else None,
            multiprocessing_context="spawn" if options.workers else None,
        )
    )


def _write(training: Training, out: Path) -> Path:
    training.save(out / CHECKPOINT)
    options = {k: str(v) if isinstance(v, Path) else v for k, v in asdict(training.options).items()}
    about = {"options": options, "steps": training.step}
    write_network(out / NETWORK, training.mean, training.vocabulary, about)
    every = 10
    means = [sum(held) / len(held) for held in (training.losses[i : i + every] for i in range(0, training.step, every))]
    write_text(out / LOG, json.dumps({**about, "loss": {"every": every, "values": means}}, indent=1))
    return out / NETWORK
