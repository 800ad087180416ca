"""On a device only: graphs, streams, several GPUs, steps that wait for nothing. All else runs as it does emulated."""

import math
import subprocess
import sys
import threading
from dataclasses import replace
from types import SimpleNamespace

import pytest
import torch
from area_scenes import VALUES, gradients, rich_scene
from gpu_promise import lack, promised
from scenes import seeded

import diff3ds as ds
from diff3ds._settings import with_options
from diff3ds.guidance.built_in.small import SmallDenoiser, Vocabulary
from diff3ds.guidance.built_in.small_network import SmallNetwork
from diff3ds.guidance.built_in.small_shape import Shape
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.render.cuda.gpu import Gpu
from diff3ds.tasks.text_image.conditioned_prior import ConditionedPrior, Network
from diff3ds.tasks.text_image.distillation import distill
from diff3ds.tasks.text_image.reference_view import Reference
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase

if not promised() and not torch.cuda.is_available():
    pytest.skip("no GPU here, and none promised by DIFF3DS_GPU", allow_module_level=True)

pytestmark = pytest.mark.gpu

SPEC = with_options(RunSpec(Phrase("a thing")), strokes=8, width=0.05)
THERE = Network({}, torch.device("cuda"), "float32")


@pytest.fixture
def gpu() -> torch.device:
    assert "cuda" in ds.available_backends(), "a GPU is here or promised, and the CUDA kernels do not run"
    return torch.device("cuda")


def scene(device, seed: int = 0, dtype=torch.float32, **options) -> tuple[ds.Sketch, ds.Cameras]:
    """Strokes with gradients, and two views."""
    g = torch.Generator().manual_seed(seed)
    sketch = ds.Sketch.random(40, generator=g, radius=0.8, width=0.02).to(device)
    tensors = {name: t.detach().to(dtype, copy=True).requires_grad_() for name, t in sketch.tensors().items()}
    return ds.Sketch(**tensors, **options), ds.orbit([10.0, 100.0], 20.0, 2.0, size=96).to(device)


def drawn(sketch: ds.Sketch, cameras: ds.Cameras, antialiasing="analytic", **options) -> list[torch.Tensor]:
    """Colour and gradients; those of Monte Carlo have the same samples in all calls."""
    color = ds.render(sketch, cameras, antialiasing=seeded(antialiasing), **options).color
    gradients = torch.autograd.grad(color.square().sum(), list(sketch.tensors().values()))
    # Without its graph, whose nodes belong to one stream: a capture, or what comes after one, is on another.
    return [color.detach(), *gradients]


def assert_same(got, expected) -> None:
    for a, b in zip(got, expected, strict=True):
        assert torch.equal(a, b)


def test_kernels_are_chosen_and_agree_with_the_cpu(gpu):
    sketch, cameras = scene(gpu)
    on_cpu = ds.render(sketch.to("cpu"), cameras.to("cpu")).color
    torch.testing.assert_close(ds.render(sketch, cameras).color.cpu(), on_cpu, rtol=0, atol=1e-4)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("width_space", ["image", "world"])
def test_repeats_to_the_bit(gpu, antialiasing, width_space, dtype):
    sketch, cameras = scene(gpu, dtype=dtype, width_space=width_space)
    expected = drawn(sketch, cameras, antialiasing)
    assert all(x.abs().sum() > 0 for x in expected)
    for _ in range(20):
        assert_same(drawn(sketch, cameras, antialiasing), expected)


def test_graphs(gpu, antialiasing):
    """A captured call draws what is in the strokes when it is replayed, with the samples of its capture."""
    sketch, cameras = scene(gpu)
    way = {"antialiasing": antialiasing, "background": (0.9, 0.5, 0.1)}
    stream = torch.cuda.Stream()
    stream.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(stream):
        for _ in range(3):
            drawn(sketch, cameras, **way)
    torch.cuda.current_stream().wait_stream(stream)
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph):
        captured = drawn(sketch, cameras, **way)
    other, _ = scene(gpu, seed=1)
    with torch.no_grad():
        for name, tensor in sketch.tensors().items():
            tensor.copy_(other.tensors()[name])
    graph.replay()
    torch.cuda.synchronize()
    assert_same(captured, drawn(other, cameras, **way))


def test_cameras_first_seen_by_a_capture(gpu):
    """They can be drawn with before the graph is replayed."""
    sketch, cameras = scene(gpu)
    expected = drawn(sketch, cameras)
    fresh = ds.Cameras(cameras.world_to_camera, cameras.intrinsics, cameras.size)
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph):
        captured = drawn(sketch, fresh)
    assert_same(drawn(sketch, fresh), expected)
    graph.replay()
    torch.cuda.synchronize()
    assert_same(captured, expected)


def test_other_streams(gpu):
    """Strokes that are still being written on a side stream."""
    sketch, cameras = scene(gpu)
    expected = drawn(sketch, cameras)
    stream = torch.cuda.Stream()
    stream.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(stream):
        torch.cuda._sleep(50_000_000)
        late = ds.Sketch(**{name: (t * 1).detach().requires_grad_() for name, t in sketch.tensors().items()})
        got = drawn(late, cameras)
    stream.synchronize()
    assert_same(got, expected)


# All memory comes from torch's cache, and no kernel of torch runs in autograd's thread before ours.
FIRST_BACKWARD = """
import torch, diff3ds as ds
room = torch.empty(1 << 30, dtype=torch.uint8, device="cuda")
del room
sketch = ds.Sketch.random(20, generator=torch.Generator().manual_seed(0)).to("cuda")
points = sketch.points.clone().requires_grad_()
image = ds.render(ds.Sketch(points, width=0.02), ds.orbit(20.0, size=64).to("cuda"))
torch.autograd.backward(image.color, torch.ones_like(image.color))
assert points.grad.abs().sum() > 0
"""


def test_the_first_backward_of_a_process_binds_its_thread(gpu):
    run = subprocess.run([sys.executable, "-c", FIRST_BACKWARD], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_several_devices(gpu):
    if torch.cuda.device_count() < 2:
        lack("there are no two GPUs", gpus=2)
    first, second = (drawn(*scene(torch.device("cuda", k))) for k in (0, 1))
    assert_same([t.cpu() for t in second], [t.cpu() for t in first])


@pytest.mark.filterwarnings("ignore:Synchronization debug mode")
def test_a_step_of_fit_waits_for_nothing(gpu, monkeypatch):
    """Once memory is known; torch raises where anything copies to the host, but not where we wait for a stream."""
    sketch, cameras = scene(gpu)
    target = torch.zeros(2, 96, 96, 3, device=gpu)
    rates = ds.Rates(points=0.01, weights=0.01, width=0.01, color=0.01, opacity=0.01)
    config = ds.FitConfig(steps=20, rates=rates)
    steps = ds.fit(sketch.detach(), lambda r, c, i: (r.color - target).square().mean(), cameras, config)
    for _ in range(5):
        next(steps)
    waits, wait = [], Gpu.wait
    monkeypatch.setattr(Gpu, "wait", lambda self: waits.append(1) or wait(self))
    torch.cuda.set_sync_debug_mode("error")
    try:
        for _ in range(10):
            next(steps)
    finally:
        torch.cuda.set_sync_debug_mode("default")
    assert not waits
    assert math.isfinite(next(steps).loss)


def test_a_step_of_fit_wakes_no_thread_of_autograd(gpu):
    sketch, cameras = scene(gpu)
    threads = []

    def objective(rendering, cameras, step):
        rendering.color.register_hook(lambda _: threads.append(threading.get_ident()))
        return rendering.color.square().mean()

    next(iter(ds.fit(sketch.detach(), objective, cameras, ds.FitConfig(steps=1))))
    assert threads == [threading.get_ident()]


def small_prior(device: torch.device) -> SmallDenoiser:
    torch.manual_seed(0)
    network = SmallNetwork(Shape(1, patch=16, width=16, depth=1))
    return SmallDenoiser(network, Vocabulary(("thing",), 0.2, 0.4), torch.ones(1), device=device)


def tiny_mvdream(device: torch.device):
    pytest.importorskip("diffusers")
    pytest.importorskip("peft")
    import tiny

    from diff3ds.guidance.networks.latent import Autoencoder
    from diff3ds.guidance.networks.mvdream import MVDream

    torch.manual_seed(0)
    unet, autoencoder = tiny.make_mvdream_unet().to(device), Autoencoder(tiny.make_vae().to(device), 64)
    return MVDream(unet, autoencoder, torch.randn(3, 7, 32), NoiseSchedule.scaled_linear())


@pytest.mark.filterwarnings("ignore:Synchronization debug mode")
@pytest.mark.parametrize(
    ("prior", "method"), [(small_prior, "reconstruction"), (tiny_mvdream, "nfsd"), (tiny_mvdream, "vsd")]
)
def test_a_step_of_a_distillation_waits_for_nothing(gpu, prior, method, tmp_path, monkeypatch):
    """With a known view, once memory is known and a loss has been shown."""
    monkeypatch.setattr("diff3ds.tasks.progress.time", SimpleNamespace(monotonic=lambda: 0.0))
    spec = with_options(SPEC, steps=20, method=method, sheet_every=0, delete_length=0.0)
    reference = Reference(torch.full((64, 64, 3), 0.5), ds.orbit(0.0, size=64), 1.0)
    watched = []

    def report(progress) -> None:
        watch = 8 <= progress.done < 18
        watched.append(watch)
        torch.cuda.set_sync_debug_mode("error" if watch else "default")

    try:
        distill(ConditionedPrior("watched", prior(gpu), network=THERE, reference=reference), spec, tmp_path, report)
    finally:
        torch.cuda.set_sync_debug_mode("default")
    assert sum(watched) == 10


def test_a_prior_on_the_device_has_its_strokes_drawn_there(gpu, tmp_path, monkeypatch):
    """And the sketch is the one that strokes drawn on the CPU become, to rounding."""
    denoiser = small_prior(gpu)
    spec, seen, encode = with_options(SPEC, steps=4, sheet_every=2), [], denoiser.encode

    def watched(images, generator):
        seen.append(images.device.type)
        return encode(images, generator)

    monkeypatch.setattr(denoiser, "encode", watched)
    there, here = (
        distill(ConditionedPrior("watched", denoiser, network=network), spec, tmp_path / name)
        for name, network in (("there", THERE), ("here", None))
    )
    assert seen == ["cuda"] * 4 + ["cpu"] * 4
    assert there.points.device.type == "cpu"
    torch.testing.assert_close(there.points, here.points, rtol=0, atol=1e-3)


def test_layers_are_drawn_on_the_device(gpu, monkeypatch):
    """Their whole numbers may be on the CPU; the same bytes twice, and on the CPU the same to rounding."""
    scene, background = rich_scene(torch.float32), torch.rand(30, 32, 4)
    expected = gradients(scene, (32, 30), background=background, backend="cpu")
    monkeypatch.setattr("diff3ds.render.areas.on_cpu.draw", lambda *_: pytest.fail("the CPU draws"))
    there = replace(scene, **{name: getattr(scene, name).to(gpu) for name in VALUES})
    (image, found), (again, found_again) = (gradients(there, (32, 30), background=background.to(gpu)) for _ in range(2))
    assert image.device.type == found["points"].device.type == "cuda"
    assert_same([image, *found.values()], [again, *found_again.values()])
    torch.testing.assert_close(image.cpu(), expected[0], rtol=0, atol=1e-5)
    for name, value in expected[1].items():
        assert (found[name].cpu() - value).norm() <= 1e-4 * value.norm(), name
