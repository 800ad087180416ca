"""A step of a distillation does not wait for the device that draws and predicts: the host goes ahead of it."""

from contextlib import nullcontext
from importlib import import_module
from types import SimpleNamespace

import pytest
import torch
from other_device import NAME
from queued_device import QueuedDevice

import diff3ds as ds
from diff3ds._settings import with_options
from diff3ds.guidance import upload
from diff3ds.guidance.built_in.small import SmallDenoiser, Vocabulary
from diff3ds.guidance.built_in.small_network import SmallNetwork
from diff3ds.guidance.built_in.small_shape import Shape
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.guidance.upload import uploaded
from diff3ds.render import Rendering
from diff3ds.tasks.text_image import distillation
from diff3ds.tasks.text_image.conditioned_prior import ConditionedPrior
from diff3ds.tasks.text_image.distillation import distill
from diff3ds.tasks.text_image.reference_view import Reference
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase

THERE = torch.device(NAME)
# Steps before the device is watched (a prior may keep things at first), and those that are.
BEFORE, WATCHED = 1, 2


class EnoughError(Exception):
    """Leaves a run."""


@pytest.fixture
def device(monkeypatch):
    """Where strokes and networks are."""
    monkeypatch.setattr(upload, "QUEUED", (NAME,))
    monkeypatch.setattr(distillation, "place_of", lambda wanted: THERE)
    loop = import_module("diff3ds.optimize.fit")
    monkeypatch.setattr(loop, "render", drawn)
    # Which waits, rightly: the run is left after a few steps.
    monkeypatch.setattr(loop, "write_checkpoint", lambda *arguments: None)
    # torch knows no automatic precision there, and the loss is shown once, whatever a step takes.
    monkeypatch.setattr(torch, "autocast", lambda *args, **kwargs: nullcontext())
    monkeypatch.setattr("diff3ds.tasks.progress.time", SimpleNamespace(monotonic=lambda: 0.0))
    with QueuedDevice() as queued:
        yield queued


def drawn(sketch: ds.Sketch, cameras: ds.Cameras, **options) -> Rendering:
    """Pictures that depend on strokes and cameras; `render` has its own tests of waiting, on a GPU."""
    shade = (sketch.points.mean((0, 1)) + cameras.world_to_camera.mean((1, 2))[:, None]).sigmoid()
    color = shade[:, None, None] * torch.linspace(0, 1, cameras.size[1], device=shade.device)[:, None]
    color = color.expand(-1, cameras.size[0], -1, -1)
    return Rendering(color, color[..., 0], color[..., 0])


def small() -> SmallDenoiser:
    network = SmallNetwork(Shape(1, size=16, patch=8, width=16, depth=1))
    return SmallDenoiser(network, Vocabulary(("thing",), 0.2, 0.4), torch.ones(1), device=THERE)


def latent(kind: str):
    """A tiny prior in latent space."""
    pytest.importorskip("diffusers")
    import tiny

    from diff3ds.guidance.networks.latent import Autoencoder
    from diff3ds.guidance.networks.mvdream import MVDream
    from diff3ds.guidance.networks.stable_diffusion import StableDiffusion
    from diff3ds.guidance.networks.zero123 import Condition, Projection, ReferencePose, Zero123

    schedule, autoencoder = NoiseSchedule.scaled_linear(), Autoencoder(tiny.make_vae().to(THERE), 64)
    if kind == "mvdream":
        return MVDream(tiny.make_mvdream_unet().to(THERE), autoencoder, torch.randn(3, 7, 32), schedule)
    if kind == "zero123":
        projection = Projection(torch.randn(32, 16).to(THERE), torch.randn(32).to(THERE))
        condition = Condition(torch.randn(12).to(THERE), torch.randn(1, 4, 8, 8).to(THERE), ReferencePose())
        return Zero123(tiny.make_unet(in_channels=8).to(THERE), autoencoder, projection, condition, schedule)
    texts = torch.randn(6, 7, 32)
    away = kind == "stable diffusion, turned away"
    return StableDiffusion(tiny.make_unet().to(THERE), autoencoder, texts, schedule, "v_prediction", perp_neg=away)


def watched(device: QueuedDevice, prior, method: str, out, reference: Reference | None = None) -> None:
    """Runs a distillation, some of whose steps must not wait."""
    spec = with_options(RunSpec(Phrase("a thing")), strokes=3, width=0.05, method=method, sheet_every=0)

    def report(progress) -> None:
        device.busy = progress.done < BEFORE + WATCHED
        if not device.busy:
            raise EnoughError

    with pytest.raises(EnoughError):
        distill(ConditionedPrior("watched", prior, reference=reference), spec, out, report)


@pytest.mark.parametrize("values", [torch.arange(6.0)[::2], torch.tensor([1, 2]).expand(3, 2), torch.tensor(0.1)])
def test_values_arrive_as_they_were(device, values):
    """Whatever their layout; those that are there stay, and so do those for the CPU."""
    device.busy = True
    there = uploaded(values, THERE)
    assert there.device == THERE
    assert there.dtype == values.dtype
    assert torch.equal(there.held, values)
    assert uploaded(there, THERE) is there
    assert uploaded(values, torch.device("cpu")) is values


def test_steps_with_the_small_prior_and_a_known_view(device, tmp_path):
    reference = Reference(torch.rand(20, 20, 3), ds.orbit(0.0, size=20), 1.0)
    watched(device, small(), "reconstruction", tmp_path, reference)
    # Two matrices of the cameras, noise, timesteps, poses, and values of the schedule.
    assert device.copies >= 6 * WATCHED


@pytest.mark.parametrize(
    ("kind", "method"),
    [
        ("mvdream", "reconstruction"),
        pytest.param("zero123", "sds", marks=pytest.mark.slow),
        pytest.param("stable diffusion, turned away", "nfsd", marks=pytest.mark.slow),
        pytest.param("stable diffusion, turned away", "sdi", marks=pytest.mark.slow),
        *(
            pytest.param("stable diffusion, turned away", method, marks=pytest.mark.slow)
            for method in ("csd", "asd", "ism")
        ),
        pytest.param("stable diffusion", "vsd", marks=pytest.mark.slow),
    ],
)
def test_steps_with_networks(device, kind, method, tmp_path):
    if method == "vsd":
        pytest.importorskip("peft")
    watched(device, latent(kind), method, tmp_path)
    assert device.copies >= 6 * WATCHED
