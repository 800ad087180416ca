"""What is the CUDA kernels' own of filled and stroked layers, emulated: order of work, lists that grow, many layers."""

from dataclasses import replace
from importlib import import_module

import pytest
import torch
from area_scenes import NO_CPU, VALUES, box, gradients, layers, rich_scene, whole
from cuda_backends import NO_COMPILER, use_emulation
from emulated import Emulated, compiler
from gpu_promise import lack

from diff3ds.render.areas import NONZERO, STROKE, draw_layers

if compiler() is None:
    lack(NO_COMPILER)


@pytest.fixture
def device(monkeypatch) -> Emulated:
    """One that draws layers, and remembers nothing."""
    one = Emulated("float", name="emulate_areas")
    use_emulation(monkeypatch)
    module = import_module("diff3ds.render.areas.on_cuda")
    monkeypatch.setattr(module, "device_for", lambda *_: one)
    monkeypatch.setattr(module, "_needs", {})
    return one


def crowd(count: int, size: float, dtype=torch.float32):
    """Blobs and strokes, of which fills and strokes share contours."""
    g = torch.Generator().manual_seed(2)
    groups, rules = [], []
    for k in range(count):
        spread = torch.rand(6, 2, generator=g) * size / 2
        group = [((torch.rand(2, generator=g) * size + spread - size / 4).tolist(), [2, 2], True)]
        groups.append(group)
        rules.append(STROKE if k % 2 else NONZERO)
    scene = layers(groups, rules, 0.8, torch.rand(count, 4, generator=g).tolist(), dtype)
    # Each stroke goes around the blob below it.
    rows = [[k - k % 2, 1, rule, 0, k] for k, rule in enumerate(rules)]
    return replace(scene, layers=whole(rows))


def test_order_of_threads_and_blocks_does_not_matter(device):
    """To the bit: where lists lie changes no result, and sums have an order."""
    scene, background = rich_scene(torch.float32), torch.rand(30, 32, 4)
    expected_image, expected = gradients(scene, (32, 30), background=background, backend="cuda")
    device.backwards = True
    image, found = gradients(scene, (32, 30), background=background, backend="cuda")
    assert torch.equal(image, expected_image)
    for name, value in expected.items():
        assert torch.equal(found[name], value), name


@NO_CPU
@pytest.mark.parametrize("count", [2, 24])
def test_layers_that_share_contours_are_drawn_as_on_the_cpu(device, count):
    """And lists that were too short for them have grown."""
    scene = crowd(count, 40.0)
    (image, found), (expected_image, expected) = (gradients(scene, (40, 36), backend=b) for b in ("cuda", "cpu"))
    assert torch.allclose(image, expected_image, atol=1e-6)
    for name in VALUES:
        assert torch.allclose(found[name], expected[name], atol=1e-5 * (1 + float(expected[name].abs().max()))), name


@NO_CPU
def test_lists_grow_until_they_fit(device, monkeypatch):
    """From next to nothing; the next drawing of this size finds them long enough."""
    module, scene = import_module("diff3ds.render.areas.on_cuda"), crowd(6, 30.0)
    monkeypatch.setattr(module, "LEAST", 1)
    tries = []
    launch = device.launch
    monkeypatch.setattr(device, "launch", lambda launches, job: (tries.append(list(job.limit)), launch(launches, job)))
    image = draw_layers(scene, 30, 30, backend="cuda")
    assert len(tries) > 2
    assert tries[0] == [1] * 6
    assert torch.allclose(image, draw_layers(scene, 30, 30, backend="cpu"), atol=1e-6)
    tries.clear()
    assert torch.equal(draw_layers(scene, 30, 30, backend="cuda"), image)
    assert len(tries) == 1


def test_backward_twice(device):
    """The backward leaves what the forward kept as it is."""
    scene = rich_scene(torch.float32)
    points = scene.points.requires_grad_()
    loss = draw_layers(scene, 32, 32, backend="cuda").square().sum()
    first, second = (torch.autograd.grad(loss, points, retain_graph=True)[0] for _ in range(2))
    assert torch.equal(first, second)


def test_a_captured_graph_is_refused(device):
    device.recording = True
    with pytest.raises(RuntimeError, match="draw them outside of a captured graph"):
        draw_layers(layers([[box(1, 1, 3, 3)]], [NONZERO], dtype=torch.float32), 8, 8, backend="cuda")


def test_more_than_indices_count_is_refused(device, monkeypatch):
    monkeypatch.setattr(import_module("diff3ds.render.areas.on_cuda"), "MOST", 100)
    with pytest.raises(MemoryError, match="at most 100 are possible"):
        draw_layers(crowd(6, 30.0), 30, 30, backend="cuda")
