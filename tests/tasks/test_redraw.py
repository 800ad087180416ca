"""The end of a run with the exact prior: what was found, in the strokes of the library's drawing that it has become."""

import json
from dataclasses import replace

import pytest
import torch

import diff3ds as ds
from diff3ds._settings import with_options
from diff3ds.bezier import split
from diff3ds.cli import main
from diff3ds.curves.join import join_smooth
from diff3ds.library import member
from diff3ds.optimize.strokes import chord_lengths
from diff3ds.tasks.exact_prior.exemplars import exemplars_of
from diff3ds.tasks.text_image.conditioned_prior import ConditionedPrior
from diff3ds.tasks.text_image.redraw import Redrawing, nearest_member, shown_by
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase
from diff3ds.tasks.text_image.text import run_text

PLAIN = RunSpec(Phrase("a house"))


def drawn(name: str, seed: int = 0) -> ds.Sketch:
    return member(name, torch.Generator().manual_seed(seed)).sketch


def torn(sketch: ds.Sketch, amount: float) -> ds.Sketch:
    """As a descent leaves it: strokes in pieces, shaken and thick."""
    (a, u), (b, v) = split(sketch.points, sketch.weights, torch.full((len(sketch),), 0.4))
    points, weights = torch.cat([a, b]), torch.cat([u, v])
    noise = amount * torch.randn(points.shape, generator=torch.Generator().manual_seed(1))
    return ds.Sketch(points + noise, weights, width=0.05)


def test_it_becomes_the_member_that_it_is_most_like():
    members = [drawn("chair", seed) for seed in range(5)]
    found = torn(members[3], 0.01)
    assert nearest_member(found, members) == 3
    clean, wanted = Redrawing(members)(found, 200), join_smooth(members[3]).sketch
    assert torch.equal(clean.points, wanted.points)
    assert torch.equal(clean.weights, wanted.weights)
    assert len(clean) == len(wanted) < len(members[3])
    assert bool((clean.width == ds.Sketch(wanted.points).width[0]).all())


def test_strokes_that_were_not_found_are_left_out():
    house = drawn("house")
    some = torch.arange(len(house)) % 2 == 0
    found = torn(house[some], 0.01)
    shown = shown_by(found, house)
    assert bool(shown[some].all())
    # The others lie along none of these, but for short ones beside them.
    far = ~some & (chord_lengths(house) > 0.5)
    assert int(far.sum()) > 4
    assert not bool(shown[far].any())
    assert not len(Redrawing([house])(replace(found, points=found.points + 5), 200))


def test_near_lines_hide_what_most_of_it_shows():
    house = drawn("house")
    kept = chord_lengths(house).argsort(descending=True)[: round(0.8 * len(house))]
    assert bool(shown_by(torn(house[kept], 0.01), house).all())


def test_there_are_no_more_strokes_than_one_asks_for_the_longest_ones():
    house = drawn("house")
    few = Redrawing([house])(torn(house, 0.01), 9)
    lengths = chord_lengths(house).sort(descending=True).values
    assert len(few) == 9
    assert torch.allclose(chord_lengths(few).sort(descending=True).values, lengths[:9])


def test_colours_and_opacities_are_those_that_were_found():
    house = drawn("house")
    found = torn(house, 0.0)
    front = evaluate_middle(found)[:, 0] > 0.2
    color = torch.where(front[:, None], torch.tensor([1.0, 0, 0]), torch.tensor([0.0, 0, 1]))
    clean = Redrawing([house])(replace(found, color=color, opacity=torch.full_like(found.opacity, 0.5)), 200)
    assert torch.allclose(clean.opacity, torch.tensor(0.5))
    middle = evaluate_middle(clean.segments())[:, 0]
    assert bool((clean.segments().color[middle > 0.5, 0] > 0.9).all())
    assert bool((clean.segments().color[middle < -0.2, 2] > 0.9).all())


def evaluate_middle(sketch: ds.Sketch) -> torch.Tensor:
    return ds.bezier.evaluate(sketch.points, sketch.weights, torch.tensor([0.5]))[:, 0]


@pytest.mark.parametrize(
    ("given", "redraws"),
    [
        ({}, True),
        ({"optimize": ("position", "color")}, True),
        ({"redraw": False}, False),
        ({"width": 0.05}, False),
        ({"optimize": ("position", "width")}, False),
        ({"optimize": ("color",)}, False),
    ],
)
def test_widths_that_the_user_chose_and_positions_that_stay_are_left_alone(given, redraws):
    assert with_options(PLAIN, **given).redraws is redraws


def test_fewer_steps_do_where_the_end_is_drawn_again():
    found = []
    for spec in (PLAIN, with_options(PLAIN, redraw=False), with_options(PLAIN, preset="paper")):
        prior = ConditionedPrior.of_exemplars(exemplars_of("a house", 0), None, spec)
        found.append((prior.preset(spec), spec.values(prior.preset(spec)).steps))
    assert found == [("brief", 150), ("swift", 400), ("brief", 4000)]


def test_all_is_found_where_a_member_is_there_and_little_else():
    house = drawn("house")
    scribbles = ds.Sketch.random(60, radius=0.8, width=0.05, generator=torch.Generator().manual_seed(0))
    redrawing = Redrawing([drawn("chair"), house])
    assert redrawing.is_found(torn(house, 0.01))
    assert not redrawing.is_found(torn(house[: len(house) // 2], 0.01))
    assert not redrawing.is_found(ds.Sketch.concatenate([torn(house, 0.01), scribbles]))
    assert not redrawing.is_found(scribbles)


@pytest.mark.slow
@pytest.mark.usefixtures("few_members")
def test_the_descent_ends_there_unless_its_steps_were_asked_for(tmp_path):
    done = []
    for name, steps in (("a", None), ("b", 105)):
        told = []
        spec = with_options(RunSpec(Phrase("an apple")), sheet_every=0, steps=steps)
        run_text(spec, tmp_path / name, lambda progress, told=told: told.append(progress.done))
        done.append(told[-1])
    assert done[0] < 105 == done[1]
    early, late = (ds.load(tmp_path / name / "sketch.json") for name in "ab")
    assert torch.equal(early.points, late.points)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ball", "bowl", "castle"])
def test_so_many_steps_find_the_whole_thing(name):
    """A ball's few strokes are far from where they start, a castle has many."""
    sketch = ds.text_to_sketch(f"a {name}")
    members = exemplars_of(f"a {name}", 0).meant
    alike = members[nearest_member(sketch, members)]
    assert float(chord_lengths(sketch).sum()) == pytest.approx(float(chord_lengths(join_smooth(alike).sketch).sum()))


@pytest.mark.usefixtures("few_members")
def test_the_command_draws_again_unless_told_not_to(tmp_path):
    few = ["--steps", "40", "--strokes", "60", "--sheet-every", "0", "--quiet", "--prior", "exemplar"]
    main(["text", "a mug", "-o", str(tmp_path / "a"), *few])
    main(["text", "a mug", "-o", str(tmp_path / "b"), *few, "--no-redraw"])
    clean, left = (ds.load(tmp_path / name / "sketch.json") for name in "ab")
    assert clean.chains is not None
    assert left.chains is None
    assert json.loads((tmp_path / "b" / "run.json").read_text())["options"]["redraw"] is False
