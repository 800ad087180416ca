"""What strokes are worth: closed forms, greedy choice by its definition, and levels that lie in each other."""

import itertools

import numpy as np
import pytest
import torch
from sweep import sweep

import diff3ds as ds
from diff3ds.curves import importance
from diff3ds.curves.importance import BESIDE, PEN, ranked


def lines(*ends, **more):
    return ds.Sketch(torch.tensor(ends, dtype=torch.float64), **more)


def random(count, seed=0, **more):
    return ds.Sketch(torch.randn(count, 4, 3, generator=torch.Generator().manual_seed(seed)), **more)


# Far apart: none of them is beside another one.
LONG = [[0.0, 0, 0], [8, 0, 0]]
SHORT = [[0.0, 4, 0], [2, 4, 0]]
HIGH = [[0.0, 0, 4], [4, 0, 4]]
PENS = PEN * (8**2 + 4**2 + 4**2) ** 0.5


def test_a_long_line_comes_before_a_short_one():
    """Each is worth its length and its round ends, a pen's width; the box of the three says how wide that is."""
    found = ranked(lines(SHORT, LONG, HIGH))
    assert found.strokes == [1, 2, 0]
    worth = np.array([8, 4, 2]) + PENS
    np.testing.assert_allclose(found.sketch.importance, worth / worth.sum(), rtol=1e-9)


def test_a_doubled_line_adds_nothing():
    half = [[8.0, 0.5 * PENS, 0], [4, 0.5 * PENS, 0]]
    found = ranked(lines(half, SHORT, LONG, HIGH))
    assert found.strokes == [2, 3, 1, 0]
    assert found.sketch.importance[3] == 0
    assert found.sketch.importance.sum().item() == pytest.approx(1, abs=1e-3)


@sweep("share", [0.1, 0.5, 0.9, 1.1])
def test_beside_a_line_another_one_is_worth_the_less_the_nearer_it_is(share):
    """The other, as long, draws so much of it as it is near; nothing from 6 % of the box on."""
    corners = [[[-5.0, -5, -5]] * 2, [[15.0, 5, 5]] * 2]
    size = (20**2 + 10**2 + 10**2) ** 0.5
    away = (PEN + share * (BESIDE - PEN)) * size
    sketch = lines([[0.0, 0, 0], [8, 0, 0]], [[0.0, away, 0], [8, away, 0]], *corners)
    one, other = ranked(sketch).sketch.importance[:2].tolist()
    assert other / one == pytest.approx(min(share, 1), rel=0.02)


def test_across_it_and_in_another_colour_it_is_worth_all_of_its_ink():
    """But for where they meet."""
    red = torch.tensor([[0.0, 0, 0], [1, 0, 0]], dtype=torch.float64)
    along, across = [[0.0, 0, 0], [8, 0, 0]], [[4.0, -4, 1], [4, 4, 1]]
    assert ranked(lines(along, across)).sketch.importance.tolist() == pytest.approx([0.5, 0.5], abs=1e-3)
    away = [[0.0, 0, 0.001], [8, 0, 0.001]]
    assert ranked(lines(along, away, color=red)).sketch.importance.tolist() == pytest.approx([0.5, 0.5])


def test_ink_counts_by_opacity_and_width():
    opacity = torch.tensor([1.0, 0.5, 0], dtype=torch.float64)
    width = torch.tensor([0.01, 0.01, 0.01], dtype=torch.float64)
    one = [[0.0, 0, 0], [8, 0, 0]], [[0.0, 4, 0], [8, 4, 0]], [[0.0, 0, 4], [8, 0, 4]]
    assert ranked(lines(*one, opacity=opacity)).sketch.importance.tolist() == pytest.approx([2 / 3, 1 / 3, 0])
    assert ranked(lines(*one, width=width * opacity)).sketch.importance.tolist() == pytest.approx([2 / 3, 1 / 3, 0])


def test_of_strokes_that_are_worth_about_the_same_what_hangs_together_comes_first():
    """A square and a fifth line as long, anywhere; the square is closed before that is drawn, wherever it stands."""
    corners = [[0.0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]]
    sides = [[corners[i], corners[(i + 1) % 4]] for i in range(4)]
    apart = [[0.0, 0, 9], [4.1, 0, 9]]
    for place in range(1, 5):
        found = ranked(lines(*sides[:place], apart, *sides[place:]))
        # The longest is first.
        assert found.strokes[0] == place
        longer = [[0.0, 0, 0], [5, 0, 0]]
        found = ranked(lines(longer, *sides[1:3], apart, sides[3]))
        assert found.strokes[-1] == 3


@pytest.mark.parametrize(("together", "order"), [(1.0, [0, 1, 3, 2]), (4.0, [0, 2, 1, 3])])
def test_the_more_hanging_together_counts_the_shorter_a_stroke_that_joins_two(together, order):
    """One of 3 joins lines of 9 and 8 and closes two gaps with the first, four with both; one of 7 hangs on nothing."""
    long = [[0.0, 0, 0], [9, 0, 0]], [[0.0, 3, 0], [8, 3, 0]]
    found = ranked(lines(*long, [[0.0, 0, 0], [0, 3, 0]], [[0.0, 0, 30], [7, 0, 30]]), together=together)
    assert found.strokes == order


def test_strokes_are_taken_by_their_gain():
    """As the definition says, with all points compared with all, where nothing counts but the gain."""
    sketch = random(25, seed=3).to(torch.float64)
    samples = importance.samples_of(sketch)
    away = np.linalg.norm(samples.place[:, None] - samples.place, axis=-1)
    along = np.abs(samples.tangent @ samples.tangent.T)
    fading = (samples.beside - away) / (samples.beside - samples.pen)
    cover = np.where(away <= samples.pen, 1, np.where(away < samples.beside, along * fading, 0))
    of = np.stack([np.where(samples.stroke == i, cover, 0).max(1) for i in range(25)], 1)
    order, drawn = [], np.zeros(len(of))
    for _ in range(25):
        gains = [-1 if i in order else ((1 - drawn) * samples.ink)[samples.stroke == i].sum() for i in range(25)]
        order.append(int(np.argmax(gains)))
        drawn = np.maximum(drawn, of[:, order[-1]])
    assert ranked(sketch, together=0.0).strokes == order


@sweep("seed", range(4))
def test_importance_falls_and_adds_up_to_all(seed):
    worth = ranked(random(60, seed)).sketch.importance
    assert bool((worth[1:] <= worth[:-1]).all())
    assert bool((worth >= 0).all())
    assert worth.sum().item() == pytest.approx(1, abs=2e-3)


@sweep("seed", range(3))
def test_a_lower_level_is_a_part_of_a_higher_one(seed):
    sketch = ds.by_importance(random(40, seed, names=[str(i) for i in range(40)]))
    levels = [set(sketch.at_detail(detail / 50).names) for detail in range(51)]
    assert all(low <= high for low, high in itertools.pairwise(levels))
    assert len(levels[0]) >= 1
    assert len(levels[50]) == 40
    assert len(levels[10]) < len(levels[25]) < 40
    few = [set(sketch.at_detail(strokes=count).names) for count in (1, 7, 40, 99)]
    assert [len(some) for some in few] == [1, 7, 40, 40]
    assert few[0] < few[1] < few[2]


def test_a_level_has_the_share_that_belongs_to_it():
    """Of ten strokes alike but in what they are worth, as few as have together 1 - (1 - detail)^3."""
    sketch = random(10, importance=torch.arange(10, 0, -1) / 55)
    assert [len(sketch.at_detail(detail)) for detail in (0, 0.06, 0.07, 0.5, 0.99, 1)] == [1, 1, 2, 7, 10, 10]
    # What is worth the same is there together.
    assert len(random(10, importance=torch.full((10,), 0.1)).at_detail(0)) == 10
    assert len(random(10, importance=torch.full((10,), 0.1)).at_detail(0, strokes=3)) == 3


def test_of_many_strokes_that_are_alike_there_are_levels_all_the_same():
    """A grid of lines as long as each other, four of which come together."""
    grid = [[[0.0, 5.0 * i, 5.0 * j], [1, 5.0 * i, 5.0 * j]] for i in range(4) for j in range(4)]
    sketch = ds.by_importance(lines(*grid))
    assert {len(sketch.at_detail(detail / 20)) for detail in range(21)} == {4, 8, 12, 16}
    assert sketch.importance.tolist() == pytest.approx([1 / 16] * 16, rel=1e-3)


def test_levels_do_not_depend_on_the_order_of_the_strokes():
    sketch = ds.by_importance(random(20, names=[str(i) for i in range(20)]))
    turned = sketch[torch.arange(19, -1, -1)]
    assert set(turned.at_detail(0.4).names) == set(sketch.at_detail(0.4).names)
    assert turned.at_detail(0.4).names == sketch.at_detail(0.4).names[::-1]


def test_all_of_a_stroke_comes_along():
    """Two segments a stroke, of which the second has a colour, a mark and a name of its own."""
    points = torch.tensor(
        [[[0.0, 0, 0], [1, 0, 0]], [[1, 0, 0], [1, 1, 0]], [[0, 0, 5], [9, 0, 5]], [[9, 0, 5], [9, 1, 5]]]
    )
    sketch = ds.Sketch(
        points,
        chains=ds.Chains.of([2, 2], False),
        color=torch.tensor([[0.0, 0, 0], [1, 0, 0]]),
        fixed=torch.tensor([False, True]),
        names=["short", "long"],
    )
    found = ds.by_importance(sketch)
    assert found.names == ("long", "short")
    assert found.fixed.tolist() == [True, False]
    assert found.color[0].tolist() == [1, 0, 0]
    assert torch.equal(found.points, points[[2, 3, 0, 1]])


def test_in_a_painting_later_strokes_stay_on_top():
    color = torch.tensor([[1.0, 0, 0], [0, 0, 1]])
    flat = torch.tensor([[[0.0, 0, 0], [1, 0, 0]], [[0.5, -4, 0], [0.5, 4, 0]]])
    painted = ds.by_importance(ds.Sketch(flat, color=color))
    assert torch.equal(painted.points, flat)
    assert painted.importance[1] > painted.importance[0]
    assert torch.equal(painted.at_detail(0).color, color[1:])
    # In one colour the order does not show.
    assert torch.equal(ds.by_importance(ds.Sketch(flat)).points, flat.flip(0))


def test_what_a_surface_hides_from_everywhere_is_worth_nothing():
    cube = ds.TriangleMesh(*cube_of())
    sketch = lines([[-0.9, 0, 0], [0.9, 0, 0]], [[1.0, 1, -1], [1, 1, 1]], [[1.5, 1.5, -1], [1.5, 1.5, 1]])
    found = ds.by_importance(sketch, cube)
    # What stands free is seen from more sides than an edge.
    assert found.importance[2] == 0
    assert torch.equal(found.points[:, 0, 0], sketch.points[[2, 1, 0], 0, 0])
    assert found.importance[0] > 1.1 * found.importance[1]


def cube_of():
    vertices = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    squares = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return np.array(vertices, float), np.array([t for a, b, c, d in squares for t in ((a, b, c), (a, c, d))])


@pytest.mark.slow
def test_the_number_of_threads_changes_nothing():
    sketch, before = random(200), torch.get_num_threads()
    try:
        found = []
        for threads in (1, 3):
            torch.set_num_threads(threads)
            found.append(ds.by_importance(sketch))
    finally:
        torch.set_num_threads(before)
    assert torch.equal(found[0].points, found[1].points)
    assert torch.equal(found[0].importance, found[1].importance)


def test_dots_nothing_and_no_strokes():
    dot = lines([[1.0, 0, 0], [1, 0, 0]])
    assert ds.by_importance(dot).importance.tolist() == [1]
    unseen = ds.by_importance(random(3, opacity=0.0))
    assert unseen.importance.tolist() == [0, 0, 0]
    assert len(unseen.at_detail(0.5)) == 3
    assert len(ds.by_importance(random(1)[:0]).at_detail(0.3)) == 0


@sweep(
    ("call", "error", "message"),
    [
        (lambda: random(2).at_detail(0.5), ValueError, "importance of the strokes: give ds.by_importance"),
        (lambda: ds.by_importance(random(2)).at_detail(1.5), ValueError, r"detail must be from 0 .* got 1.5"),
        (lambda: ds.by_importance(random(2)).at_detail(strokes=0), ValueError, "strokes must be a whole number"),
        (lambda: random(2, importance=torch.ones(3)), ValueError, r"importance must have shape \(2,\)"),
        (
            lambda: random(2, importance=torch.tensor([1.0, -1])),
            ValueError,
            "importance of stroke 1 must be finite and",
        ),
    ],
)
def test_wrong_values_are_refused(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_importance_is_kept_by_what_keeps_strokes():
    worth = torch.tensor([0.5, 0.3, 0.2])
    sketch = random(3, importance=worth)
    assert torch.equal(sketch[[2, 0]].importance, worth[[2, 0]])
    assert torch.equal(sketch.with_color(0, (1, 0, 0)).elevate().importance, worth)
    assert sketch.to(torch.float64).importance.dtype == torch.float64
    both = ds.Sketch.concatenate([sketch, sketch[1:]])
    assert torch.equal(both.importance, worth[[0, 1, 2, 1, 2]])
    assert ds.Sketch.concatenate([sketch, random(1)]).importance is None
