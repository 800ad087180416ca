"""What the recogniser is trained on (benchmarks/hand_drawn.py, doodles.py, symbols): cameras, parts, pictures."""

import itertools
import json
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

import diff3ds as ds
from diff3ds.tasks.recognition.lines import Lines
from diff3ds.tasks.recognition.network import LINE, SIZE, THING, trained

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
from doodles import DOODLES, FOR_TEST, FOR_VALIDATION
from hand_drawn import moved, picture_of, read_drawings, seen_from, without_hidden, worn
from symbols_outdoors import KINDS, SYMBOLS


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 0.0), (40.0, 20.0), (250.0, 32.0)])
def test_members_are_seen_as_by_cameras(azimuth, elevation):
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (3, 4, 3))
    flat, depth = seen_from(points, azimuth, elevation, 1.9)
    camera = ds.orbit(azimuth, elevation, 1.9, fov=90.0, size=2)
    seen = ds.project(ds.Sketch(torch.from_numpy(points)), camera).cubics[0].numpy()
    np.testing.assert_allclose(depth, seen[..., 2], atol=1e-6)
    np.testing.assert_allclose(flat, seen[..., :2] / seen[..., 2:3] - 1, atol=1e-6)


def test_what_lies_behind_is_left_out():
    """Of two crosses, one behind the other, in a frame that is in front: the far one's middle is hidden."""
    frame = np.array([[[-1, -1], [1, -1]], [[-1, 1], [1, 1]]], float)
    cross = np.array([[[-0.2, 0], [0.2, 0]]], float)
    flat = np.concatenate([frame, cross, cross + np.array([0, 0.1])])
    depth = np.array([[1, 1], [1, 1], [0.5, 0.5], [3, 3]], float)
    lines = without_hidden(flat, depth, np.random.default_rng(0))
    assert len(lines) == 3
    assert not any(np.array_equal(line, flat[3]) for line in lines)


def test_training_sees_what_the_recogniser_makes_of_lines():
    corners = np.array([[0, 0], [3, 0], [3, 1], [0, 1], [0, 0]], float)
    steps = np.linspace(0, 1, 200)[:, None]
    dense = np.concatenate([a + steps * (b - a) for a, b in itertools.pairwise(corners)])
    found = Lines((dense - [1.5, 0.5]) / 3, np.zeros_like(dense)).ink(SIZE, LINE, THING)
    drawn = picture_of([corners])
    # Even widths of pillow lie half a fine pixel beside the line: a quarter of one here, of a width of two.
    assert np.abs(found - drawn).mean() < 0.3 * found.mean()


def test_parts_are_apart_and_always_the_same(tmp_path):
    for kind in ("mug", "wine_glass"):
        entries = [{"recognized": True, "strokes": [[[i, 9], [0, 9]]]} for i in range(13)]
        (tmp_path / f"{kind}.json").write_text(json.dumps(entries))
    parts, again = read_drawings(tmp_path), read_drawings(tmp_path)
    assert [len(parts[part]) for part in ("train", "validation", "test")] == [16, 4, 6]
    assert {drawing.kind for drawing in parts["test"]} == {"mug", "wine glass"}
    seen = [(d.kind, d.lines[0][0, 0]) for part in parts.values() for d in part]
    assert len({*seen}) == 26
    assert seen == [(d.kind, d.lines[0][0, 0]) for part in again.values() for d in part]


def test_every_kind_has_a_symbol_and_every_doodle_draws():
    assert {*KINDS} == {*SYMBOLS}
    assert trained().kinds == KINDS
    assert not {*FOR_TEST} & {*FOR_VALIDATION}
    chance = np.random.default_rng(0)
    for draw in (*SYMBOLS.values(), *DOODLES.values()):
        for _ in range(5):
            picture = picture_of(worn(moved(draw(chance), chance), chance) or draw(chance), chance)
            assert picture.shape == (SIZE, SIZE)
            assert 0 < picture.mean() < 0.6
