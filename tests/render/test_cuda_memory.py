"""Memory of the CUDA kernels, emulated: lists that must grow, calls that do not wait, what is read and written."""

import gc
import re
import weakref
from importlib import import_module

import pytest
import torch
from cuda_backends import NO_COMPILER
from cuda_scenes import assert_same, crowd, of_a_sketch, results
from emulated import compiler
from gpu_promise import lack
from scenes import tracked

from diff3ds.render import rasterize
from diff3ds.render.cuda.job import COUNTERS, WARPS, Arrays, Shape
from diff3ds.render.cuda.sources import source_folder

if compiler() is None:
    lack(NO_COMPILER)

limits = import_module("diff3ds.render.cuda.limits")


@pytest.mark.parametrize("real", [4, 8])
def test_lists_have_room_for_what_they_hold(real):
    """As many bytes as the sources assert of their structures."""
    text = (source_folder() / "cuda" / "job.cuh").read_text(encoding="utf-8")
    asserted = re.findall(r"sizeof\((\w+)(?:<\w+>)?\) == (\d+)( \* sizeof\(real\))?", text)
    size = {name: int(number) * (real if reals else 1) for name, number, reals in asserted}
    shape, lengths = Shape(2, 10, 10, 30, 40, 0, real, save=True), dict.fromkeys(limits.LISTS, 1000)
    lists = {
        "pieces": size["Piece"],
        "piece_info": size["PieceInfo"],
        "arcs": size["Arc"],
        "chords": size["Chord"],
        "chord_info": size["ChordInfo"],
        "tangents": size["Tangents"],
        "tile_pieces": size["TilePiece"],
        "warp_fragments": WARPS * size["WarpFragments"],
        "fragments": size["Cover"],
    }
    room = shape.forward(lengths)
    assert {name: room[name] for name in lists} == {name: 1000 * bytes_ for name, bytes_ in lists.items()}


# With samples the emulated kernels take three times as long.
ANALYTIC = ["analytic", pytest.param("montecarlo", marks=pytest.mark.slow)]


class Dirty(Arrays):
    """Memory that nobody wrote holds anything."""

    def __init__(self, *args):
        super().__init__(*args)
        self.memory.random_()


@pytest.mark.parametrize("antialiasing", ANALYTIC)
def test_memory_that_nobody_wrote_may_hold_anything(device, antialiasing, monkeypatch):
    strokes = crowd(8)
    expected = results(strokes, (24, 30), antialiasing), of_a_sketch(antialiasing, "image")
    monkeypatch.setattr(import_module("diff3ds.render.cuda.rasterize"), "Arrays", Dirty)
    assert_same(results(strokes, (24, 30), antialiasing), expected[0])
    assert_same(of_a_sketch(antialiasing, "image"), expected[1])


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


@pytest.mark.parametrize("antialiasing", ANALYTIC)
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


@pytest.mark.parametrize("antialiasing", ANALYTIC)
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
    thin, thick = crowd(8, half_width=0.01), crowd(8, half_width=60.0)
    expected = rasterize(thick, (60, 80), backend="cpu").color
    rasterize(thin, (60, 80), backend="cuda")
    torch.testing.assert_close(rasterize(thick, (60, 80), backend="cuda").color, expected, rtol=0, atol=1e-4)


def test_the_least_memory_does_not_grow_with_samples(device):
    """Of small drawings, that of a run is a multiple of it."""
    for strata in (0, 2, 8, 64):
        shape = Shape(1, 10, 10, 16, 16, strata, 4, True)
        bounds = limits.Limits(torch.zeros(COUNTERS, dtype=torch.int64))
        bounds.guess(shape)
        room = sum(shape.forward(bounds.length).values()) / 1e6
        assert room < 70 + 1.5 * shape.samples * 0.3, (strata, room)


@pytest.mark.parametrize("antialiasing", ANALYTIC)
def test_small_drawings_never_outgrow_their_memory(device, antialiasing):
    """A sketch of hair lines, and then one whose every stroke fills the picture."""
    expected = results(crowd(20, half_width=60.0), (60, 80), antialiasing, "cpu")
    results(crowd(20, half_width=0.01), (60, 80), antialiasing)
    for got, known in zip(results(crowd(20, half_width=60.0), (60, 80), antialiasing), expected, strict=True):
        assert torch.allclose(got, known, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("antialiasing", ANALYTIC)
def test_a_drawing_that_outgrows_its_memory_is_spoilt_never_wrong(device, memories, antialiasing, monkeypatch):
    """Strokes that turn from thin to thick in one step: NaN and gradients of 0, and a call later all is well."""
    monkeypatch.setattr(limits, "LEAST", dict.fromkeys(limits.LISTS, 1024))
    thin, thick = crowd(8, half_width=0.01), crowd(8, half_width=60.0)
    expected = results(thick, (30, 40), antialiasing)
    memories.clear()
    results(thin, (30, 40), antialiasing)
    with pytest.warns(RuntimeWarning, match="an earlier drawing needed more memory than foreseen"):
        spoilt, again = (results(thick, (30, 40), antialiasing) for _ in range(2))
    assert all(x.isnan().all() for x in spoilt[:3])
    assert all((x == 0).all() for x in spoilt[3:])
    assert_same(again, expected)


@pytest.mark.parametrize("antialiasing", ANALYTIC)
def test_large_drawings_wait_and_take_little_more_than_they_need(device, memories, antialiasing, monkeypatch):
    """What spoils a smaller drawing only makes a large one wait; and a captured one cannot."""
    thin, thick = crowd(8, half_width=0.01), crowd(8, half_width=60.0)
    expected = results(thick, (30, 40), antialiasing)
    memories.clear()
    monkeypatch.setattr(limits, "LEAST", dict.fromkeys(limits.LISTS, 1024))
    monkeypatch.setattr(limits, "LARGE", 256)
    monkeypatch.setattr(limits.Limits, "guess", lambda self, _: [self.length.setdefault(n, 8) for n in limits.LISTS])
    results(thin, (30, 40), antialiasing)
    assert_same(results(thick, (30, 40), antialiasing), expected)
    (known,) = memories.values()
    need = known.needs()["fragments"]
    assert limits.LARGE < need <= known.length["fragments"] <= limits.LARGE_MARGIN * need
    before = device.waits
    results(thick, (30, 40), antialiasing)
    assert device.waits > before
    before, device.recording = device.waits, True
    assert_same(results(thick, (30, 40), antialiasing), expected)
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
        ("write_pieces", "piece_first", {"pieces": 132, "piece_info": 176, "arcs": 80}),
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


@pytest.mark.slow
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
    expected = results(small, (30, 40), antialiasing)
    for kind in ("reach", "g_fragment"):
        scarce = {kind}
        with pytest.raises(torch.OutOfMemoryError):
            # The first is spoilt, the second has what it needs, or would.
            [results(large, (30, 40), antialiasing) for _ in range(2)]
        assert_same(results(small, (30, 40), antialiasing), expected)


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
