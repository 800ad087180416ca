"""`diff3ds points`: a cloud of a box to its edges, in the units of the file; what is refused."""

import json

import numpy as np
import pytest
import torch

import diff3ds as ds


def _box(count: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, (count, 3))
    side = rng.choice(3, count)
    x[np.arange(count), side] = rng.choice([-1.0, 1.0], count)
    return x


def test_a_box_far_from_the_origin_has_twelve_edges_where_it_is(tmp_path):
    place, half = np.array([5e5, 4e6, 100.0]), np.array([30.0, 20.0, 10.0])
    np.save(tmp_path / "box.npy", _box(3000) * half + place)
    sketch = ds.points_to_sketch(tmp_path / "box.npy", tmp_path / "run")
    assert len(sketch) == 12
    ends = np.abs(sketch.points[:, [0, -1]].reshape(-1, 3).numpy() - place)
    assert np.abs(ends - half).max() < 1e-4
    told = json.loads((tmp_path / "run" / "run.json").read_text())
    assert [one["kind"] for one in told["forms"]] == ["plane"] * 6
    assert told["explained"] > 0.95
    for name in ("sketch.json", "sketch.step", "sketch.svg", "preview.png"):
        assert (tmp_path / "run" / name).is_file()
    assert bool((sketch.importance[1:] <= sketch.importance[:-1]).all())
    few = ds.points_to_sketch(tmp_path / "box.npy", tmp_path / "few", strokes=4)
    assert torch.equal(few.points, sketch.points[:4])
    low = ds.points_to_sketch(tmp_path / "box.npy", detail=0.3)
    assert 1 < len(low) < 12
    assert torch.equal(low.points, sketch.at_detail(0.3).points)
    with pytest.raises(ValueError, match="holds a run"):
        ds.points_to_sketch(tmp_path / "box.npy", tmp_path / "run")


@pytest.mark.slow
def test_rounded_edges_are_named_by_their_radius_and_drawn_once_or_by_tangent_lines(tmp_path):
    inner = np.clip(x := _box(5000) * [30, 20, 10], -np.array([28.5, 18.5, 8.5]), [28.5, 18.5, 8.5])
    np.save(tmp_path / "box.npy", inner + 1.5 * (x - inner) / np.linalg.norm(x - inner, axis=1, keepdims=True))
    sketch = ds.points_to_sketch(tmp_path / "box.npy", tmp_path / "run")
    told = json.loads((tmp_path / "run" / "run.json").read_text())["edges"]
    assert [one["radius"] for one in told] == pytest.approx([1.5] * 12, rel=0.1)
    assert sorted(sketch.names) == sorted(f"edge {k}, radius {one['radius']:.4g}" for k, one in enumerate(told))
    lines = ds.points_to_sketch(tmp_path / "box.npy", tmp_path / "lines", rounded="tangents")
    assert len(lines) == 24
    assert lines.width.tolist() == pytest.approx([0.5 * float(sketch.width[0])] * 24)
    assert "'tangent'" in (tmp_path / "lines" / "sketch.step").read_text()
    with pytest.raises(ValueError, match="all its 12 edges are rounded"):
        ds.points_to_sketch(tmp_path / "box.npy", rounded="tangents", tangent="hidden")


def test_a_cloud_without_edges_says_what_it_is(tmp_path):
    x = np.random.default_rng(0).normal(size=(1000, 3))
    np.save(tmp_path / "ball.npy", 7 * x / np.linalg.norm(x, axis=1, keepdims=True))
    with pytest.raises(ValueError, match=r"no edge was found: 100% of it is 1 sphere"):
        ds.points_to_sketch(tmp_path / "ball.npy")
    np.save(tmp_path / "few.npy", x[:50])
    with pytest.raises(ValueError, match="50 points are too few"):
        ds.points_to_sketch(tmp_path / "few.npy")
    np.save(tmp_path / "mist.npy", x)
    with pytest.raises(ValueError, match="no edge was found"):
        ds.points_to_sketch(tmp_path / "mist.npy")


def test_options_out_of_range_are_refused(tmp_path):
    with pytest.raises(ValueError, match="seed must not be negative"):
        ds.points_to_sketch(tmp_path / "a.npy", seed=-1)
    with pytest.raises(ValueError, match="strokes must be a whole number, at least 1"):
        ds.points_to_sketch(tmp_path / "a.npy", strokes=0)
    with pytest.raises(ValueError, match="detail must be from 0"):
        ds.points_to_sketch(tmp_path / "a.npy", detail=2.0)
    with pytest.raises(ValueError, match="size must be from 1"):
        ds.points_to_sketch(tmp_path / "a.npy", size=0)
