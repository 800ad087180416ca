"""What the recogniser is trained on (benchmarks/hand_drawn.py, doodles.py, symbols): cameras, parts, pictures."""

import itertools
import json
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

import diff3ds as ds
from diff3ds.recognition.network import LINE, SIZE, THING, DrawingNetwork, Trained, trained
from diff3ds.recognition.picture_lines import Lines

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
from doodles import DOODLES, FOR_TEST, FOR_VALIDATION
from drawn_words import UNCERTAIN, kind_of, nothings
from hand_drawn import moved, picture_of, read_drawings, read_nothings, seen_from, without_hidden, worn
from symbols_wishes import KINDS, SHOWN, SYMBOLS, is_doodle


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


def test_words_mean_what_phrases_mean_by_them():
    words = {"coffee cup": "mug", "cruise ship": "ship", "alarm clock": "clock", "cat": "cat", "anvil": None}
    assert {word: kind_of(word) for word in words} == words
    assert all(kind_of(word) is None for word in UNCERTAIN)
    parts = nothings(["anvil", "cat", "barn", *(f"thing {i}" for i in range(11))])
    assert sorted(word for part in parts.values() for word in part) == [
        "anvil",
        *sorted(f"thing {i}" for i in range(11)),
    ]
    assert (len(parts["test"]), len(parts["validation"]), len(parts["train"])) == (2, 2, 8)


def test_drawings_are_of_kinds_or_of_nothing_by_their_words(tmp_path):
    entry = {"recognized": True, "strokes": [[[0, 9], [0, 9]]]}
    for word in ("coffee_cup", "anvil", "barn", "ant"):
        (tmp_path / f"{word}.json").write_text(json.dumps([entry] * 26))
    kinds = read_drawings(tmp_path)
    assert {part: [d.kind for d in drawings] for part, drawings in kinds.items()} == {
        "test": ["mug"] * 6, "validation": ["mug"] * 4, "train": ["mug"] * 16,
    }  # fmt: skip
    others = read_nothings(tmp_path)
    assert {part: {d.kind for d in drawings} for part, drawings in others.items()} == {
        "test": {"ant"}, "validation": {"anvil"}, "train": set(),
    }  # fmt: skip


def test_classes_that_are_no_kind_count_together():
    network = DrawingNetwork(4).eval()
    with torch.no_grad():
        network.kind.weight.zero_()
        network.kind.bias.copy_(torch.tensor([0.5, 0.2, 0.1, 0.2]).log())
    kinds, _, _ = Trained(network, ("cat", "dog"), 1.0, 0.5).logits(torch.zeros(1, 1, SIZE, SIZE))
    torch.testing.assert_close(kinds.exp(), torch.tensor([[0.5, 0.2, 0.3]]))


def test_kinds_symbols_and_doodles_draw():
    assert {*SYMBOLS} <= {*KINDS}
    assert {*trained().kinds} <= {*KINDS}
    assert {*SHOWN} <= {*DOODLES}
    assert {*SHOWN.values()} <= {*KINDS}
    assert not is_doodle("cat's head", ("cat",))
    assert is_doodle("cat's head", ("dog",))
    assert not {*FOR_TEST} & {*FOR_VALIDATION}
    chance = np.random.default_rng(0)
    for draw in (*SYMBOLS.values(), *DOODLES.values()):
        for _ in range(5):
            picture = picture_of(worn(moved(draw(chance), chance), chance) or draw(chance), chance)
            assert picture.shape == (SIZE, SIZE)
            assert 0 < picture.mean() < 0.6
