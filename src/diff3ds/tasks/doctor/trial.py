"""Whether the weights of a prior do what a prior must, on drawings whose answer is known: `diff3ds doctor --try`."""

import importlib
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras, orbit
from diff3ds.guidance.denoiser import gaussian
from diff3ds.guidance.methods import ScoreQuery, score
from diff3ds.guidance.networks.zero123 import ReferencePose
from diff3ds.guidance.objective import ScoreDistillation
from diff3ds.guidance.orbits import Orbits
from diff3ds.library.members import member
from diff3ds.render import Analytic, render
from diff3ds.sketch import Sketch
from diff3ds.tasks.doctor.trial_options import TrialOptions
from diff3ds.tasks.doctor.tried_prior import THING, TriedPrior, drawn_width, load_tried
from diff3ds.tasks.text_image.distillation import place_of, placed

# Seconds after which no further check begins, so that all ends within two minutes.
PATIENCE = 100.0
# From where the thing is seen: quarter turns, which priors of four views were trained with.
AZIMUTHS, ELEVATION, DISTANCE, FOV = (20.0, 110.0, 200.0, 290.0), 15.0, 2.0, 60.0
# From the least noise that a run draws to where the large areas of a drawing still show through it.
TIMESTEPS = (100, 250, 400, 550, 700)
# Those at which cameras tell more than the noisy pictures do: with wrong ones the small prior errs by 1.2 times as much
# at 250, by 2.2 to 2.6 times from 400 on.
BLIND = TIMESTEPS[2:]
# Of the error of the best multiple of the noisy pictures: a network that has learned nothing comes to 1, the small
# prior to .06 to .27. Empirical.
BETTER = 0.9
# Of the error with their own cameras: more than the last bits of a GPU's sums.
WORSE = 1.01
# Of a drawing's variance that comes back from its latents. Empirical: what has learned nothing keeps none.
KEPT = 0.5
# Standard deviation of the blur, as a fraction of the image's height. Empirical: at 2 of 64 pixels the pull of the
# small prior has a cosine of .37 to .5.
BLUR = 1 / 32
# Timesteps of the pull, and its guidance: that of a picture, for every prior.
PULLS, GUIDANCE = (300, 500, 700), 7.5
# A direction that knows nothing has with any other, in D dimensions, a cosine of standard deviation 1 / √D.
DEVIATIONS = 3
# Steps of a run that are made, of which the first, where kernels are chosen, does not count.
STEPS = 3


@dataclass(frozen=True)
class Check:
    """One thing that a sound prior does.

    Attributes:
        name: of it.
        wanted: of the figure.
        found: the figure.
        sound: whether it is so; None if there was no time left to try.
    """

    name: str
    wanted: str
    found: str = "not tried"
    sound: bool | None = None


@dataclass(frozen=True)
class Cost:
    """What a run takes.

    Attributes:
        step: seconds.
        steps: of a run with the preset that the prior has by default.
        memory: bytes, the most that were held: of a GPU, else of the process; None if the system does not say.
    """

    step: float
    steps: int
    memory: int | None


@dataclass(frozen=True)
class Trial:
    """What trying a prior has shown.

    Attributes:
        prior: its name.
        network: where its weights came from, and how it computes.
        loading: seconds.
        cost: of a run.
        checks: in the order in which they were made.
    """

    prior: str
    network: dict[str, object]
    loading: float
    cost: Cost
    checks: tuple[Check, ...]

    @property
    def sound(self) -> bool | None:
        """Whether all checks say so; None if none says no, but some could not be made."""
        said = [check.sound for check in self.checks]
        return False if False in said else None if None in said else True


@dataclass(frozen=True, eq=False)
class Scene:
    """The thing as a prior sees it.

    Attributes:
        prior: the prior.
        sketch: of the thing.
        cameras: of the pictures.
        pictures: of the thing, sharp.
        latents: of the pictures.
        generator: of all noise.
    """

    prior: TriedPrior
    sketch: Sketch
    cameras: Cameras
    pictures: Float[Tensor, "V H W 3"]
    latents: Float[Tensor, "V C h w"]
    generator: torch.Generator

    @classmethod
    def of(cls, prior: TriedPrior, sketch: Sketch) -> "Scene":
        """The pictures that a prior is tried with."""
        generator = torch.Generator().manual_seed(0)
        cameras = orbit(AZIMUTHS, ELEVATION, DISTANCE, fov=FOV, size=prior.denoiser.size)
        pictures = render(sketch, cameras).color
        with torch.no_grad():
            latents = prior.denoiser.encode(pictures, generator)
        return cls(prior, sketch, cameras, pictures, latents, generator)


# What is found, and whether a sound prior has it.
Answer = Callable[[], tuple[str, bool]]


def try_prior(options: TrialOptions, say: Callable[[str], None] = lambda line: None) -> Trial:
    """Tries a prior on drawings of a thing of the library.

    Args:
        options: which prior, and where it computes.
        say: told what is tried next.

    Raises:
        ValueError, ImportError, FileNotFoundError: as `load_tried`.
    """
    begun = time.perf_counter()
    sketch = _thing(drawn_width(options.prior or ""))

    def shown(size: int, pose: ReferencePose) -> Float[Tensor, "S S 3"]:
        camera = orbit(pose.azimuth, pose.elevation, pose.distance, fov=FOV, size=size)
        return render(sketch, camera).color[0]

    say(f"loading {options.prior}")
    prior = load_tried(options, shown)
    loading = time.perf_counter() - begun
    scene = Scene.of(prior, sketch)
    say("a step of a run")
    cost, checks = _cost(scene, begun + PATIENCE), []
    for check, answer in _checks(scene):
        if time.perf_counter() < begun + PATIENCE:
            say(check.name)
            found, sound = answer()
            check = replace(check, found=found, sound=sound)
        checks.append(check)
    return Trial(prior.name, prior.network.record, loading, cost, tuple(checks))


def _thing(width: float) -> Sketch:
    sketch = member(THING, torch.Generator().manual_seed(0)).sketch
    return sketch.replace(width=width)


def _checks(scene: Scene) -> Iterator[tuple[Check, Answer]]:
    """All checks, the quick ones first."""
    errors = _Errors(scene)
    yield Check("drawings come back", f"> {KEPT:.0%} of them"), partial(_decoded, scene)
    for timestep in TIMESTEPS:
        yield Check(f"noise is found, t = {timestep}", f"< {BETTER:.0%} of a guess"), partial(errors.told, timestep)
    chance = DEVIATIONS / scene.latents.numel() ** 0.5
    yield Check("a blurred chair is sharpened", f"> {chance:.3f}"), partial(_pulled, scene, chance)
    if scene.prior.sees_poses:
        yield Check("views agree with cameras", f"> {WORSE} times"), errors.of_wrong_cameras


def _decoded(scene: Scene) -> tuple[str, bool]:
    """How much of the drawings' variance is in them when they come back."""
    error = (scene.prior.denoiser.decode(scene.latents) - scene.pictures).square().mean()
    kept = 1 - float(error / scene.pictures.var())
    return f"{kept:.0%} of them", kept > KEPT


class _Errors:
    """How far predictions of the noise are off: kept, for two checks ask."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._known: dict[int, float] = {}

    def told(self, timestep: int) -> tuple[str, bool]:
        """The error, in fractions of that of the best guess without a network."""
        self._known[timestep] = self._error(timestep, self.scene.cameras)
        kept = float(self.scene.prior.denoiser.schedule.alpha_bars[timestep])
        power = kept * float(self.scene.latents.square().mean())
        # c z_t with the least mean square |c z_t - ε|² leaves so much: noise has variance 1, and z_t has all of its
        # covariance with ε from √(1 - ᾱ) ε.
        ratio = self._known[timestep] * (power + 1 - kept) / power
        return f"{ratio:.0%} of a guess", ratio < BETTER

    def of_wrong_cameras(self) -> tuple[str, bool]:
        """The error where each picture is told the camera of the next, against that with its own."""
        wrong = self.scene.cameras[[*range(1, len(AZIMUTHS)), 0]]
        own = [self._known[t] for t in BLIND]
        ratio = sum(self._error(t, wrong) / known for t, known in zip(BLIND, own, strict=True)) / len(BLIND)
        return f"{ratio:.2f} times", ratio > WORSE

    def _error(self, timestep: int, cameras: Cameras) -> float:
        """Mean square of ε predicted less ε; the same noise for the same timestep."""
        scene, generator = self.scene, torch.Generator().manual_seed(timestep)
        timesteps = torch.full((len(cameras),), timestep)
        noise = gaussian(scene.latents, generator)
        noisy = scene.prior.denoiser.schedule.add_noise(scene.latents, noise, timesteps)
        (found,) = scene.prior.denoiser.predict(noisy, timesteps, cameras, ["conditional"])
        return float((found - noise).square().mean())


def _pulled(scene: Scene, chance: float) -> tuple[str, bool]:
    """The cosine between where the prior pulls blurred drawings and where the sharp ones lie, in latents."""
    denoiser = scene.prior.denoiser
    blur = Analytic(blur=BLUR * denoiser.size)
    with torch.no_grad():
        blurred = denoiser.encode(render(scene.sketch, scene.cameras, antialiasing=blur).color, scene.generator)
        pull = torch.zeros_like(blurred)
        for timestep in PULLS:
            timesteps = torch.full((len(blurred),), timestep)
            query = ScoreQuery(denoiser, blurred, timesteps, min(PULLS), scene.cameras, GUIDANCE, 0.0, scene.generator)
            pull -= score(scene.prior.recipe.method, query).gradient
    cosine = float(torch.nn.functional.cosine_similarity(pull.flatten(), (scene.latents - blurred).flatten(), dim=0))
    return f"{cosine:.2f}", cosine > chance


def _cost(scene: Scene, end: float) -> Cost:
    """Makes steps of a run as they are in runs, until the end (of time.perf_counter) at most."""
    prior = scene.prior
    place, size = place_of(prior.network), prior.denoiser.size
    orbits = Orbits(group=prior.denoiser.group, size=size)
    objective, cameras = placed(ScoreDistillation(prior.denoiser, prior.recipe, prior.steps), orbits, place)
    sketch, seconds = scene.sketch.to(place), []
    for step in range(STEPS):
        begun = time.perf_counter()
        points = sketch.points.detach().requires_grad_()
        views = cameras(step, scene.generator)
        loss = objective(render(sketch.replace(points=points), views), views, step)
        loss.backward()  # type: ignore[no-untyped-call]
        # Read, so that a GPU has come to its end.
        assert points.grad is not None
        float(points.grad.norm())
        seconds.append(time.perf_counter() - begun)
        if time.perf_counter() > end:
            break
    counted = seconds[1:] or seconds
    return Cost(sum(counted) / len(counted), prior.steps, _most_memory(prior.network.device))


def _most_memory(device: torch.device) -> int | None:
    """Bytes that were held at most, of a GPU or by this process."""
    if device.type == "cuda":
        return torch.cuda.max_memory_allocated(device)
    if device.type != "cpu" or sys.platform == "win32":
        return None
    resource = importlib.import_module("resource")
    most: int = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else 1024 * most
