"""Strokes of several segments as data: how they are made, checked, selected, joined, kept in files and fitted."""

import json
import math

import pytest
import torch

import diff3ds as ds
from diff3ds import Chains, Sketch
from diff3ds.bezier import circle, evaluate
from diff3ds.optimize.checkpoint import read_checkpoint, start, write_checkpoint
from diff3ds.optimize.density import halves
from diff3ds.optimize.strokes import Edit, chord_lengths


def wavy(segments: int = 3, closed: bool = False) -> torch.Tensor:
    """Cubics that follow on each other around a circle, (segments, 4, 3)."""
    count = 3 * segments + 1
    angle = torch.arange(count, dtype=torch.float64) * (2 * math.pi / (count - 1)) * (1 if closed else 0.7)
    nodes = torch.stack([angle.cos(), angle.sin(), (3 * angle).sin() / 5], -1)
    nodes[-1] = nodes[0] if closed else nodes[-1]
    return torch.stack([nodes[3 * k : 3 * k + 4] for k in range(segments)])


def two_strokes(along: bool = False) -> Sketch:
    """An open stroke of three segments and a closed one of two."""
    points = torch.cat([wavy(3), 2 * wavy(2, closed=True)])
    width = (
        torch.linspace(0.01, 0.05, 20).reshape(5, 4).double()
        if along
        else torch.tensor([0.01, 0.02], dtype=torch.float64)
    )
    if along:
        width = Chains.of([3, 2], [False, True]).joined(width)
    color = torch.tensor([[1.0, 0.0, 0.0], [0.0, 0.5, 1.0]]).double()
    return Sketch(points, width=width, color=color, opacity=0.5, chains=Chains.of([3, 2], [False, True]))


# Making and checking


def test_chains_know_their_joints():
    chains = Chains.of([3, 1, 2], [False, True, True])
    assert chains.stroke.tolist() == [0, 0, 0, 1, 2, 2]
    assert chains.first.tolist() == [0, 3, 4, 6]
    assert sorted(zip(*(rows.tolist() for rows in chains.joints), strict=True)) == [
        (0, 1),
        (1, 2),
        (3, 3),
        (4, 5),
        (5, 4),
    ]
    assert chains.before.tolist() == [-1, 0, 1, 3, 5, 4]
    assert chains.after.tolist() == [1, 2, -1, 3, 5, 4]


def test_one_open_segment_each_is_the_plain_case():
    sketch = Sketch(wavy(3), chains=Chains.of([1, 1, 1]))
    assert sketch.chains is None
    assert len(sketch) == 3


def made_of(stroke: list, closed: list) -> Chains:
    return Chains(torch.tensor(stroke), torch.tensor(closed))


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Chains.of([2, 0]), ValueError, "stroke 1 must have at least one segment, got 0"),
        (lambda: Chains.of([1.5, 2]), TypeError, "stroke 0 must have a whole number of segments, got 1.5"),
        (lambda: Chains.of("12"), TypeError, "a whole number of segments, got '1'"),
        (lambda: Chains.of([2], [1]), TypeError, "closed must be true or false"),
        (lambda: Chains.of([2, 1], [True]), ValueError, "closed must have one value a stroke, 2, got 1"),
        (
            lambda: Chains(torch.tensor([0, 2]), torch.zeros(2, dtype=torch.bool)),
            ValueError,
            "from 0 to 1 without gaps",
        ),
        (lambda: made_of([1, 0], [True, False]), ValueError, "without gaps, in order"),
        (lambda: made_of([0.0], [True]), TypeError, "tensor of torch.int64"),
        (lambda: Sketch(wavy(3), chains=Chains.of([2])), ValueError, "of each of the 3 segments, got 2"),
        (lambda: Sketch(wavy(3), chains=[3]), TypeError, "chains must be Chains"),
        (lambda: Sketch(wavy(3), width=torch.ones(3).double(), chains=Chains.of([3])), ValueError, "for 1 strokes"),
        (lambda: Sketch(wavy(3), width=torch.ones(2, 4).double(), chains=Chains.of([3])), ValueError, "for 3 segments"),
    ],
)
def test_what_does_not_fit_is_refused(make, error, message):
    with pytest.raises(error, match=message):
        make()


def test_segments_that_do_not_meet_are_named():
    points = two_strokes().points.clone()
    points[4, 0, 1] += 0.25
    with pytest.raises(ValueError, match=r"stroke 1 has a gap of 0.25 between its segments 0 and 1"):
        Sketch(points, chains=Chains.of([3, 2], [False, True]))
    points = wavy(3)
    with pytest.raises(ValueError, match=r"stroke 0 has a gap of .* between its segments 2 and 0"):
        Sketch(points, chains=Chains.of([3], True))
    sketch = two_strokes(along=True)
    width = sketch.width.clone()
    width[1, 0] += 0.5
    with pytest.raises(ValueError, match=r"stroke 0 changes its width of 0.5 between its segments 0 and 1"):
        Sketch(sketch.points, width=width, chains=sketch.chains)


def test_bad_values_name_the_stroke_and_the_segment():
    sketch = two_strokes(along=True)
    for name, value in (("points", math.nan), ("weights", -1.0), ("width", -0.25)):
        tensors = {k: v.clone() for k, v in sketch.tensors().items()}
        tensors[name][4, 1] = value
        with pytest.raises(ValueError, match=rf"{name} of stroke 1 \(segment 1\) must be .*, got {value}"):
            Sketch(**tensors, chains=sketch.chains)


# Taking apart and putting together


def test_strokes_are_selected_with_their_segments():
    sketch = two_strokes(along=True)
    for picked in (sketch[1], sketch[[1]], sketch[torch.tensor([False, True])], sketch[1:]):
        assert len(picked) == 1
        assert torch.equal(picked.points, sketch.points[3:])
        assert torch.equal(picked.width, sketch.width[3:])
        assert picked.chains.closed.tolist() == [True]
    swapped = sketch[[1, 0, 1]]
    assert swapped.chains.counts.tolist() == [2, 3, 2]
    assert torch.equal(swapped.points[2:5], sketch.points[:3])
    assert torch.equal(swapped.color[1], sketch.color[0])


def test_sketches_are_concatenated_by_strokes():
    plain = Sketch(wavy(3)[:, [0, 3]].float().double(), width=0.3, color=(0.0, 1.0, 0.0))
    both = Sketch.concatenate([plain, two_strokes(), two_strokes(along=True)])
    assert both.chains.counts.tolist() == [1, 1, 1, 3, 2, 3, 2]
    assert both.chains.closed.tolist() == [False] * 4 + [True, False, True]
    assert both.width.shape == (13, 4)
    assert torch.equal(both.width[:3], torch.full((3, 4), 0.3, dtype=torch.float64))
    assert torch.equal(both.width[8:], two_strokes(along=True).width)
    assert len(both) == 7


def test_segments_are_strokes_of_their_own():
    parts = two_strokes().segments()
    assert parts.chains is None
    assert len(parts) == 5
    assert parts.width.tolist() == [0.01] * 3 + [0.02] * 2
    assert torch.equal(parts.color[3], two_strokes().color[1])


def test_raising_the_degree_keeps_widths_along_strokes():
    quadratic = Sketch(wavy(3)[:, :3], width=torch.tensor([[0.1, 0.5, 0.2]] * 3).double())
    t = torch.linspace(0, 1, 9).double()
    before, after = (evaluate(s.width[..., None], None, t) for s in (quadratic, quadratic.elevate()))
    assert torch.allclose(before, after, atol=1e-15)


def test_transforms_scale_world_widths_along_strokes():
    sketch = two_strokes(along=True)
    world = Sketch(**sketch.tensors(), width_space="world", chains=sketch.chains)
    moved = world.transform(2 * torch.diag(torch.tensor([1.0, 1.0, 1.0, 0.5])).double())
    assert torch.allclose(moved.width, 2 * sketch.width)
    assert moved.chains is sketch.chains


def test_joined_values_agree_and_their_gradients_add_up():
    chains = Chains.of([3, 2], [False, True])
    values = torch.randn(5, 4, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64).requires_grad_()
    joined = chains.joined(values)
    ends, starts = chains.joints
    assert torch.equal(joined[ends, -1], joined[starts, 0])
    assert torch.equal(joined[:, 1:-1], values[:, 1:-1])
    joined.sum().backward()
    assert values.grad[0, 3].tolist() == [2.0] * 3
    assert values.grad[1, 0].tolist() == [0.0] * 3
    assert values.grad[3, 0].tolist() == [2.0] * 3
    assert values.grad[4, 3].tolist() == [0.0] * 3


def test_a_closed_stroke_of_one_segment():
    loop = torch.tensor([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0]]])
    sketch = Sketch(loop, chains=Chains.of([1], True))
    assert sketch.chains.closed.tolist() == [True]
    joined = sketch.chains.joined(loop + torch.rand(1, 4, 3, generator=torch.Generator().manual_seed(0)))
    assert torch.equal(joined[0, 3], joined[0, 0])


# Files


@pytest.mark.parametrize("along", [False, True])
def test_json_keeps_every_bit(tmp_path, along):
    sketch = two_strokes(along)
    ds.save(tmp_path / "a.json", sketch)
    read = ds.load(tmp_path / "a.json")
    assert all(torch.equal(value, read.tensors()[name]) for name, value in sketch.tensors().items())
    assert torch.equal(read.chains.stroke, sketch.chains.stroke)
    assert torch.equal(read.chains.closed, sketch.chains.closed)
    ds.save(tmp_path / "b.json", read)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def test_plain_files_stay_as_they_were(tmp_path):
    ds.save(tmp_path / "plain.json", two_strokes().segments())
    text = (tmp_path / "plain.json").read_text()
    assert '"version": 1,' in text
    assert "segments" not in text


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("segments", [3, 1], "segments must add up to the 5 items of points, got 4"),
        ("segments", [5, 0], "segments must be a list of whole numbers, at least 1"),
        ("segments", [2.5, 2.5], "segments must be a list of whole numbers"),
        ("segments", "3 2", "segments must be a list of whole numbers"),
        ("closed", [True], "closed must be a list of true or false, 2"),
        ("closed", [1, 0], "closed must be a list of true or false"),
        ("closed", [True, True], "stroke 0 has a gap"),
    ],
)
def test_bad_files_are_refused(tmp_path, key, value, message):
    ds.save(tmp_path / "a.json", two_strokes())
    data = json.loads((tmp_path / "a.json").read_text()) | {key: value}
    (tmp_path / "a.json").write_text(json.dumps(data))
    with pytest.raises(ValueError, match=message):
        ds.load(tmp_path / "a.json")


def test_svg_has_one_path_a_stroke_and_closes_it(tmp_path):
    points, weights = circle((0.0, 0.0, 0.0), 1.0)
    ring = Sketch(points, weights, width=0.02, chains=Chains.of([4], True))
    ds.save(tmp_path / "a.svg", ring, ds.orbit(20, 50, 4, size=64))
    text = (tmp_path / "a.svg").read_text()
    assert text.count("<path") == 1
    assert text.count("M") == 1
    assert 'Z" fill="none"' in text


# Fits


def square_loss(image, cameras, step):
    return (image.alpha - 0.3).square().mean()


def test_a_fit_keeps_joints_one_point_and_closed_strokes_closed():
    sketch = two_strokes(along=True)
    config = ds.FitConfig(steps=5, rates=ds.Rates(points=0.02, width=0.05))
    *_, last = ds.fit(sketch, square_loss, ds.orbit([0, 90], 30, 6, size=32), config)
    ends, starts = sketch.chains.joints
    assert torch.equal(last.sketch.points[ends, -1], last.sketch.points[starts, 0])
    assert torch.equal(last.sketch.width[ends, -1], last.sketch.width[starts, 0])
    assert (last.sketch.points - sketch.points).abs().amax((1, 2)).min() > 0.01
    assert (last.sketch.width - sketch.width).abs().amax(1).min() > 1e-4


def test_a_fit_of_chains_goes_on_from_its_checkpoint(tmp_path):
    cameras = ds.orbit([0, 90], 30, 6, size=32)

    def run(steps: int, **options) -> Sketch:
        config = ds.FitConfig(steps=6, rates=ds.Rates(points=0.02), checkpoint=tmp_path / "c", **options)
        for step in ds.fit(two_strokes(), square_loss, cameras, config):
            if step.index + 1 == steps:
                break
        return step.sketch

    whole = run(6)
    run(3)
    again = run(6, resume=True)
    assert torch.equal(whole.points, again.points)
    assert again.chains.counts.tolist() == [3, 2]


def test_deletion_counts_strokes(tmp_path):
    sketch = two_strokes(along=True)
    assert chord_lengths(sketch).shape == (2,)
    assert chord_lengths(sketch)[1] == pytest.approx(float(chord_lengths(sketch.segments())[3:].sum()))
    state = start(sketch, 0).edited(Edit(torch.tensor([1]), two_strokes(along=True)[0]))
    assert state.sketch.chains.counts.tolist() == [2, 3]
    assert state.first["points"].shape == (5, 4, 3)
    assert state.first["color"].shape == (2, 3)
    write_checkpoint(tmp_path / "c", state, {})
    assert torch.equal(read_checkpoint(tmp_path / "c").sketch.width, state.sketch.width)


def test_halves_of_chains_are_the_same_drawing():
    plain = Sketch(wavy(1), width=torch.rand(1, 4, generator=torch.Generator().manual_seed(0)).double() / 10)
    cameras = ds.orbit(20, 50, 4, size=48)
    for sketch in (two_strokes(along=True), two_strokes(), plain):
        cut = halves(sketch, torch.arange(len(sketch)))
        assert len(cut) == 2 * len(sketch)
        assert cut.chains is None or not cut.chains.closed.any()
        one, two = (ds.render(s, cameras, backend="reference").alpha for s in (sketch, cut))
        assert ((one > 0) == (two > 0)).all()
