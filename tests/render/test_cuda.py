"""What is the CUDA kernels' own, emulated: order of work, memory that must grow, long lists, calls that do not wait."""

import gc
import weakref
from importlib import import_module

import pytest
import torch
from cuda_backends import NO_COMPILER, use_emulation
from emulated import Emulated, compiler
from gpu_promise import lack
from scenes import TENSORS, draw, strokes_at, tracked

import diff3ds as ds
from diff3ds.render import available_backends, rasterize
from diff3ds.render.cuda.job import BAD, COUNTERS, Arrays, Shape

if compiler() is None:
    lack(NO_COMPILER)

limits = import_module("diff3ds.render.cuda.limits")


@pytest.fixture
def memories(monkeypatch) -> dict:
    """What is remembered of earlier drawings, empty."""
    monkeypatch.setattr(import_module("diff3ds.render.cuda.rasterize"), "_limits", {})
    return import_module("diff3ds.render.cuda.rasterize")._limits


@pytest.fixture
def device(monkeypatch, memories) -> Emulated:
    """A device without a past."""
    one = Emulated("float")
    use_emulation(monkeypatch, lambda *_: one)
    return one


def crowd(count: int = 40, size: int = 30, seed: int = 0, **options):
    """Bent strokes over each other, in float32."""
    g = torch.Generator().manual_seed(seed)
    points = size / 2 + size / 4 * torch.randn(count, 4, 2, generator=g)
    looks = {
        "depth": 1 + torch.rand(count, 4, generator=g),
        "half_width": 2 * torch.rand(count, generator=g),
        "color": torch.rand(count, 3, generator=g),
        "opacity": torch.rand(count, generator=g),
    }
    return strokes_at(points, dtype=torch.float32, **{**looks, **options})


def results(strokes, size, antialiasing="analytic", backend="cuda", **options) -> list[torch.Tensor]:
    """Images, and gradients of all tensors and the background."""
    tensors = tracked(strokes)
    background = torch.full((3,), 0.4, requires_grad=True)
    options = {"samples": 4, **options} if antialiasing == "montecarlo" else options
    image = draw(strokes, size, backend, antialiasing, background=background, **options)
    loss = image.color.square().sum() + image.alpha.sum() + image.depth.sum()
    return [image.color, image.alpha, image.depth, *torch.autograd.grad(loss, [*tensors, background])]


class Dirty(Arrays):
    """Memory that nobody wrote holds anything."""

    def __init__(self, *args, zeros=False):
        super().__init__(*args, zeros=zeros)
        if not zeros:
            self.memory.random_()


def of_a_sketch(antialiasing: str, width_space: str, backend: str = "cuda") -> list[torch.Tensor]:
    """Images, and gradients of strokes in space and of their cameras; more strokes than a block has threads."""
    g = torch.Generator().manual_seed(0)
    tensors = {name: t.detach().clone() for name, t in ds.Sketch.random(150, generator=g, width=0.1).tensors().items()}
    cameras = ds.orbit([0.0, 130.0, 220.0], 20.0, 4.0, size=(20, 30))
    inputs = [*tensors.values(), cameras.world_to_camera, cameras.intrinsics]
    for tensor in inputs:
        tensor.requires_grad_()
    options = {"samples": 4, "generator": g} if antialiasing == "montecarlo" else {}
    sketch = ds.Sketch(**tensors, width_space=width_space)
    image = ds.render(sketch, cameras, antialiasing=antialiasing, backend=backend, **options)
    loss = image.color.square().sum() + image.alpha.sum() + image.depth.sum()
    return [image.color, image.alpha, image.depth, *torch.autograd.grad(loss, inputs)]


def assert_same(got, expected) -> None:
    for a, b in zip(got, expected, strict=True):
        assert torch.equal(a, b)


@pytest.mark.parametrize("width_space", ["image", "world"])
def test_order_of_threads_and_blocks_does_not_matter(device, antialiasing, width_space):
    """To the bit, whichever thread or block comes first: sums have an order, and no thread reads too early."""
    strokes = crowd(width_space=width_space)
    expected = results(strokes, (40, 50), antialiasing)
    device.backwards = True
    assert_same(results(strokes, (40, 50), antialiasing), expected)
    assert any(x.abs().sum() > 0 for x in expected[3:])


@pytest.mark.parametrize("width_space", ["image", "world"])
def test_sums_over_views_and_strokes_have_an_order(device, antialiasing, width_space):
    """Also those of the strokes in space and of the cameras; and they are the CPU kernels'."""
    expected = of_a_sketch(antialiasing, width_space)
    device.backwards = True
    assert_same(of_a_sketch(antialiasing, width_space), expected)
    if "cpu" in available_backends():
        for got, known in zip(expected[3:], of_a_sketch(antialiasing, width_space, "cpu")[3:], strict=True):
            assert (got - known).norm() < 1e-2 * known.norm()


def test_memory_that_nobody_wrote_may_hold_anything(device, antialiasing, monkeypatch):
    strokes = crowd(20)
    expected = results(strokes, (40, 50), antialiasing), of_a_sketch(antialiasing, "image")
    monkeypatch.setattr(import_module("diff3ds.render.cuda.rasterize"), "Arrays", Dirty)
    assert_same(results(strokes, (40, 50), antialiasing), expected[0])
    assert_same(of_a_sketch(antialiasing, "image"), expected[1])


@pytest.mark.skipif("cpu" not in available_backends(), reason="installed without compiled kernels")
def test_more_strokes_than_a_block_adds_up_at_a_time(device):
    g = torch.Generator().manual_seed(0)
    points = 48 * torch.rand(9000, 1, 2, generator=g) + 2 * torch.randn(9000, 4, 2, generator=g)
    looks = {"half_width": 0.1, "opacity": 0.2, "color": torch.rand(9000, 3, generator=g), "dtype": torch.float32}
    strokes = strokes_at(points, depth=1 + torch.rand(9000, 4, generator=g), **looks)
    expected, got = (draw(strokes, 48, backend) for backend in ("cpu", "cuda"))
    assert ((got.color - expected.color).abs() < 1e-4).double().mean() > 0.999


def test_backward_twice(device, antialiasing):
    """The backward leaves what the forward kept as it is."""
    strokes = crowd(12)
    tensors = tracked(strokes)
    image = (
        draw(strokes, 30, "cuda", antialiasing, samples=4)
        if antialiasing == "montecarlo"
        else draw(strokes, 30, "cuda")
    )
    first, second = (torch.autograd.grad(image.color.square().sum(), tensors, retain_graph=True) for _ in range(2))
    assert_same(first, second)


def test_images_are_freed_with_their_last_name(device):
    """What the backward needs must not hold the images that hold it."""
    strokes = crowd(5)
    tracked(strokes)
    gc.disable()
    try:
        image = rasterize(strokes, 20, backend="cuda")
        image.color.sum().backward()
        gone = weakref.ref(image.color)
        del image
        assert gone() is None
    finally:
        gc.enable()


def test_too_little_memory_is_found_out(device, memories, antialiasing, monkeypatch):
    """Every list begins far too short: the first call grows them, and draws what it always draws."""
    expected = results(crowd(), 40, antialiasing)
    monkeypatch.setattr(import_module("diff3ds.render.cuda.rasterize"), "_limits", {})
    monkeypatch.setattr(
        limits.Limits, "guess", lambda self, shape: [self.length.setdefault(n, 1) for n in limits.LISTS]
    )
    before = device.waits
    assert_same(results(crowd(), 40, antialiasing), expected)
    assert device.waits - before > len(limits.LISTS[:5])


def test_proven_calls_do_not_wait(device, antialiasing):
    results(crowd(), 40, antialiasing)
    before = device.waits
    results(crowd(seed=1), 40, antialiasing)
    results(crowd(30), 40, antialiasing)
    assert device.waits == before
    results(crowd(41), 40, antialiasing)
    assert device.waits > before, "more strokes than were ever drawn"


def test_pictures_alone_are_never_spoilt(device, memories, monkeypatch):
    """Without gradients every call waits: who draws a picture looks at it, and there may be no next call."""
    monkeypatch.setattr(limits, "LEAST", dict.fromkeys(limits.LISTS, 1024))
    thin, thick = crowd(20, half_width=0.01), crowd(20, half_width=60.0)
    expected = rasterize(thick, (60, 80), backend="cpu").color
    rasterize(thin, (60, 80), backend="cuda")
    torch.testing.assert_close(rasterize(thick, (60, 80), backend="cuda").color, expected, rtol=0, atol=1e-4)


def test_the_least_memory_does_not_grow_with_samples(device):
    """Of small drawings, that of a run is a multiple of it."""
    for strata in (0, 2, 8, 64):
        shape, bounds = Shape(1, 10, 16, 16, strata, 4, True), limits.Limits(torch.zeros(COUNTERS, dtype=torch.int64))
        bounds.guess(shape)
        room = sum(shape.forward(bounds.length).values()) / 1e6
        assert room < 70 + 1.5 * shape.samples * 0.3, (strata, room)


def test_small_drawings_never_outgrow_their_memory(device, antialiasing):
    """A sketch of hair lines, and then one whose every stroke fills the picture."""
    expected = results(crowd(20, half_width=60.0), (60, 80), antialiasing, "cpu")
    results(crowd(20, half_width=0.01), (60, 80), antialiasing)
    for got, known in zip(results(crowd(20, half_width=60.0), (60, 80), antialiasing), expected, strict=True):
        assert torch.allclose(got, known, rtol=1e-3, atol=1e-3)


def test_a_drawing_that_outgrows_its_memory_is_spoilt_never_wrong(device, memories, antialiasing, monkeypatch):
    """Strokes that turn from thin to thick in one step: NaN and gradients of 0, and a call later all is well."""
    monkeypatch.setattr(limits, "LEAST", dict.fromkeys(limits.LISTS, 1024))
    thin, thick = crowd(20, half_width=0.01), crowd(20, half_width=60.0)
    expected = results(thick, (60, 80), antialiasing)
    memories.clear()
    results(thin, (60, 80), antialiasing)
    with pytest.warns(RuntimeWarning, match="an earlier drawing needed more memory than foreseen"):
        spoilt, again = (results(thick, (60, 80), antialiasing) for _ in range(2))
    assert all(x.isnan().all() for x in spoilt[:3])
    assert all((x == 0).all() for x in spoilt[3:])
    assert_same(again, expected)


def test_large_drawings_wait_and_take_little_more_than_they_need(device, memories, antialiasing, monkeypatch):
    """What spoils a smaller drawing only makes a large one wait; and a captured one cannot."""
    thin, thick = crowd(20, half_width=0.01), crowd(20, half_width=60.0)
    expected = results(thick, (60, 80), antialiasing)
    memories.clear()
    monkeypatch.setattr(limits, "LEAST", dict.fromkeys(limits.LISTS, 1024))
    monkeypatch.setattr(limits, "LARGE", 256)
    monkeypatch.setattr(limits.Limits, "guess", lambda self, _: [self.length.setdefault(n, 8) for n in limits.LISTS])
    results(thin, (60, 80), antialiasing)
    assert_same(results(thick, (60, 80), antialiasing), expected)
    (known,) = memories.values()
    need = known.needs()["fragments"]
    assert limits.LARGE < need <= known.length["fragments"] <= limits.LARGE_MARGIN * need
    before = device.waits
    results(thick, (60, 80), antialiasing)
    assert device.waits > before
    before, device.recording = device.waits, True
    assert_same(results(thick, (60, 80), antialiasing), expected)
    assert device.waits == before


@pytest.mark.parametrize("name", limits.LISTS[:5])
def test_whichever_list_is_too_short_nothing_is_read_behind_it(device, memories, antialiasing, name, monkeypatch):
    """Also in calls that do not wait, and if memory that nobody wrote holds anything."""
    rasterizing = import_module("diff3ds.render.cuda.rasterize")
    results(crowd(6), 20, antialiasing)
    (only,) = memories.values()
    needs = only.needs()

    monkeypatch.setattr(rasterizing, "Arrays", Dirty)
    monkeypatch.setattr(limits.Limits, "guess", lambda *_: None)
    monkeypatch.setattr(limits.Limits, "may_skip_waiting", lambda *_: True)
    only.length[name] = 1
    spoilt = results(crowd(6), 20, antialiasing)
    assert all(x.isnan().all() for x in spoilt[:3])
    assert all((x == 0).all() for x in spoilt[3:])
    assert only.needs() == needs


@pytest.mark.parametrize(
    ("kernel", "places", "sizes"),
    [
        ("write_pieces", "piece_first", {"pieces": 96, "piece_info": 168, "arcs": 80}),
        ("write_chords", "chord_first", {"chords": 36, "chord_info": 12, "tangents": 16}),
    ],
)
def test_what_was_not_counted_is_not_written(device, memories, monkeypatch, kernel, places, sizes):
    """The last place is taken away between counting and writing: what lies there stays as it is."""
    rasterizing = import_module("diff3ds.render.cuda.rasterize")
    launch, memory = device.launch, {}

    class Kept(Arrays):
        def __init__(self, sizes, *args, **options):
            super().__init__(sizes, *args, **options)
            memory.update({name: self[name] for name, size in sizes.items() if size})

    def shortened(launches, job):
        at = [name for name, _ in launches].index(kernel)
        launch(launches[:at], job)
        count = int(memory["counters"].view(torch.int64)[limits.LISTS.index(next(iter(sizes)))])
        memory[places].view(torch.int32).clamp_(max=count - 1)
        for array in sizes:
            memory[array].fill_(0xAB)
        memory["last"] = torch.tensor(count - 1)
        launch([launches[at]], job)
        raise InterruptedError

    monkeypatch.setattr(rasterizing, "Arrays", Kept)
    monkeypatch.setattr(device, "launch", shortened)
    with pytest.raises(InterruptedError):
        rasterize(crowd(6), 20, backend="cuda")
    for array, size in sizes.items():
        last = size * int(memory["last"])
        assert (memory[array][last:] == 0xAB).all(), array
        assert not (memory[array][last - size : last] == 0xAB).all(), array


def test_bad_strokes_are_named(device):
    bad = crowd(5)
    bad.opacity[3] = 2.0
    with pytest.raises(ValueError, match=r"opacity of stroke 3 \(view 0\) must be in \[0, 1\], got 2.0"):
        rasterize(bad, 20, backend="cuda")


def test_bad_strokes_of_earlier_calls_are_reported_once(device, memories):
    """A call that does not wait may end before its kernels begin: the next one hears of them."""
    good = crowd(5)
    expected = rasterize(good, 20, backend="cuda").color
    (only,) = memories.values()
    only.report[BAD] = 3
    with pytest.raises(ValueError, match="a stroke of this drawing, or of one before it, cannot be drawn"):
        rasterize(good, 20, backend="cuda")
    assert torch.equal(rasterize(good, 20, backend="cuda").color, expected)


def test_capture_needs_a_call_before(device):
    device.recording = True
    with pytest.raises(RuntimeError, match="draw a picture of this kind with 5 strokes or more"):
        rasterize(crowd(5), 20, backend="cuda")
    device.recording = False
    expected = rasterize(crowd(5), 20, backend="cuda").color
    before = device.waits
    device.recording = True
    assert torch.equal(rasterize(crowd(5), 20, backend="cuda").color, expected)
    assert device.waits == before
    with pytest.raises(RuntimeError, match="draw a picture of this kind with 6 strokes or more"):
        rasterize(crowd(6), 20, backend="cuda")


def test_capture_of_gradients_needs_one_of_gradients_before(device, memories):
    """Of Monte Carlo, whose outlines only the backward pass counts; the forward pass says so, before it is recorded."""
    strokes = crowd(5)
    tracked(strokes)

    def drawn():
        return draw(strokes, 20, "cuda", "montecarlo", samples=4)

    image = drawn()
    device.recording = True
    for fails in (image.color.sum().backward, drawn):
        with pytest.raises(RuntimeError, match="and its backward if one is wanted, once before the capture"):
            fails()
    device.recording = False
    expected = results(strokes, 20, "montecarlo")
    device.recording = True
    assert_same(results(strokes, 20, "montecarlo"), expected)


@pytest.mark.filterwarnings("ignore:an earlier drawing needed more memory")
def test_a_drawing_too_large_for_the_memory_is_not_remembered(device, memories, antialiasing, monkeypatch):
    """It is an error, in the forward or the backward pass; a smaller one of its kind then finds its room."""
    small, large = crowd(20, half_width=0.01), crowd(20, half_width=60.0)
    rasterizing, room, scarce = import_module("diff3ds.render.cuda.rasterize"), {}, set()

    class Scarce(Arrays):
        def __init__(self, sizes, *args, **options):
            kind, total = list(sizes)[1], sum(sizes.values())
            if kind in scarce and total > room[kind]:
                raise torch.OutOfMemoryError
            room.setdefault(kind, total)
            room[kind] = max(room[kind], total) if not scarce else room[kind]
            super().__init__(sizes, *args, **options)

    monkeypatch.setattr(limits, "LEAST", dict.fromkeys(limits.LISTS, 1024))
    monkeypatch.setattr(rasterizing, "Arrays", Scarce)
    expected = results(small, (60, 80), antialiasing)
    for kind in ("reach", "g_fragment"):
        scarce = {kind}
        with pytest.raises(torch.OutOfMemoryError):
            # The first is spoilt, the second has what it needs, or would.
            [results(large, (60, 80), antialiasing) for _ in range(2)]
        assert_same(results(small, (60, 80), antialiasing), expected)


def test_lists_that_were_too_short_are_freed_before_longer_ones_are_made(device, antialiasing, monkeypatch):
    rasterizing = import_module("diff3ds.render.cuda.rasterize")
    monkeypatch.setattr(
        limits.Limits, "guess", lambda self, shape: [self.length.setdefault(n, 1) for n in limits.LISTS]
    )
    made = {}

    class Watched(Arrays):
        def __init__(self, sizes, *args, **options):
            name = next(iter(sizes))
            assert name not in made or made[name]() is None, name
            super().__init__(sizes, *args, **options)
            made[name] = weakref.ref(self.memory)

    monkeypatch.setattr(rasterizing, "Arrays", Watched)
    results(crowd(5), 20, antialiasing)


def test_strokes_that_cannot_be_drawn_are_left_out_of_a_captured_drawing(device):
    without, bad = crowd(5), crowd(5)
    without.opacity[3], bad.opacity[3] = 0.0, 2.0
    expected = rasterize(without, 20, backend="cuda").color
    device.recording = True
    assert torch.equal(rasterize(bad, 20, backend="cuda").color, expected)


@pytest.mark.skipif("cpu" not in available_backends(), reason="installed without compiled kernels")
def test_crowded_tiles(device):
    """More chords in a tile than shared memory holds, and more strokes over a pixel than a short list."""
    g = torch.Generator().manual_seed(0)
    points = 8 + 6 * torch.randn(1100, 1, 2, generator=g) + torch.randn(1100, 4, 2, generator=g)
    looks = {"opacity": 0.02, "color": torch.rand(1100, 3, generator=g), "depth": 1 + torch.rand(1100, 1, generator=g)}
    got, expected = (
        results(strokes_at(points, half_width=1.0, dtype=torch.float32, **looks), 17, backend=b)
        for b in ("cuda", "cpu")
    )
    for name, a, b in zip(("color", "alpha", "depth"), got[:3], expected[:3], strict=True):
        torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-4, msg=name)
    for name, a, b in zip(TENSORS, got[3:], expected[3:], strict=False):
        assert (a - b).norm() < 1e-3 * b.norm(), name
