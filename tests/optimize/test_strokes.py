"""Noise deletion and support: which strokes a fit keeps."""

import math

import pytest
import torch

import diff3ds as ds
from diff3ds.optimize.strokes import CHORDS, NoiseDeletion, SupportPruning, chord_lengths, long_enough, support


def line(*ends, **fields):
    return ds.Sketch(torch.tensor([ends], dtype=torch.float32), **fields)


def test_chord_lengths_of_a_line_and_of_a_circle():
    straight = line((0.0, 0.0, 0.0), (3.0, 4.0, 0.0))
    torch.testing.assert_close(chord_lengths(straight), torch.tensor([5.0]))
    arc = ds.Sketch(*ds.bezier.circle((0.0, 0.0, 0.0), 2.0, stop=90.0))
    length = float(chord_lengths(arc))
    # 20 chords that are nearly equal fall short of the arc by the factor 1 - angle^2 / 24 each.
    assert math.pi * (1 - (math.pi / 2 / CHORDS) ** 2 / 12) < length < math.pi


def test_deletion_follows_the_papers_schedule():
    """From 2,000 of 4,000 steps on, every 100."""
    due = [step + 1 for step in range(4000) if NoiseDeletion().due(step, 4000)]
    assert due == list(range(2000, 4001, 100))


def test_deletion_drops_short_strokes_only(generator):
    sketch = ds.Sketch.concatenate([line((0.0, 0.0, 0.0), (x, 0.0, 0.0)) for x in (0.05, 0.2, 0.099, 0.101)])
    edit = NoiseDeletion(length=0.1)(99, 100, sketch, generator)
    assert edit.kept.tolist() == [1, 3]
    assert edit.added is None
    assert NoiseDeletion(length=0.1)(10, 100, sketch, generator) is None
    assert NoiseDeletion(length=0.01)(99, 100, sketch, generator) is None


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("bad", [math.nan, -1.0, "x"])
@pytest.mark.parametrize("name", ["length", "start", "every"])
def test_deletion_wants_numbers(name, bad):
    """Nothing is as long as NaN: every stroke would go."""
    with pytest.raises(ValueError, match=f"{name} must be a number, finite and not negative, got {bad!r}"):
        NoiseDeletion(**{name: bad})


def test_the_longest_stroke_always_stays():
    sketch = ds.Sketch.concatenate([line((0.0, 0.0, 0.0), (x, 0.0, 0.0)) for x in (0.01, 0.02)])
    assert long_enough(sketch, 1.0).tolist() == [False, True]
    assert long_enough(sketch[[]], 1.0).tolist() == []


@pytest.fixture(params=[{}, {"height": 3.4}], ids=["perspective", "orthographic"])
def scene(request):
    """A drawn stroke, one that nothing shows, and one behind all cameras' images."""
    cameras = ds.orbit([0, 60, 120, 180], 20, 3.0, size=64, **request.param)
    drawn = line((-0.5, 0.0, 0.0), (0.5, 0.2, 0.0), width=0.05)
    absent = line((-0.5, 0.0, 0.6), (0.5, 0.2, 0.6), width=0.05)
    outside = line((90.0, 0.0, 0.0), (91.0, 0.0, 0.0))
    return ds.Sketch.concatenate([drawn, absent, outside]), cameras, ds.render(drawn, cameras).alpha


def test_support_is_the_share_of_views_with_ink(scene):
    sketch, cameras, ink = scene
    found = support(sketch, cameras, ink)
    assert found[0].min() > 0.99
    assert found[1].max() < 0.3  # the drawn stroke crosses it in some views
    assert found[2].max() == 0
    blank = ink.clone()
    blank[1:] = 0
    torch.testing.assert_close(support(sketch[0], cameras, blank), found[:1] / 4, rtol=0.02, atol=0)


def test_pruning_replaces_first_and_drops_later(scene, generator):
    sketch, cameras, ink = scene

    def fresh(count, generator):
        return ds.Sketch.random(count, generator=generator)

    pruning = SupportPruning(cameras, ink, 0.5, 0.05, (0.5,), (1.0,), fresh, count=5)
    assert pruning(0, 100, sketch, generator) is None
    edit = pruning(49, 100, sketch, generator)
    assert edit.kept.tolist() == [0]
    assert len(edit.added) == 4
    edit = pruning(99, 100, sketch, generator)
    assert edit.kept.tolist() == [0]
    assert edit.added is None


def test_pruning_never_empties_a_sketch(scene, generator):
    sketch, cameras, ink = scene
    pruning = SupportPruning(cameras, torch.zeros_like(ink), 0.5, 0.05, (), (1.0,), lambda n, g: sketch, count=3)
    assert len(pruning(9, 10, sketch, generator).kept) > 0
