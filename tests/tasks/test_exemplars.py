"""The built-in prior of a phrase, and `diff3ds text` with it."""

import json
from dataclasses import replace

import pytest
import torch
from nearness import f_score, points_on

import diff3ds as ds
from diff3ds._settings import with_options
from diff3ds.cli import FAULT, main
from diff3ds.library.categories import CATEGORIES
from diff3ds.library.phrase import Request
from diff3ds.library.vocabulary import COLORS
from diff3ds.tasks.exact_prior.exemplars import FITTING, OTHER_KINDS, exemplars_of, requested
from diff3ds.tasks.text_image.run_spec import RunSpec
from diff3ds.tasks.text_image.subject import Phrase
from diff3ds.tasks.text_image.text import run_text


def test_members_that_fit_and_all_the_others():
    known = exemplars_of("a red chair", seed=0)
    assert len(known.members) == FITTING + len(OTHER_KINDS) - 1
    assert sum(known.fitting) == FITTING
    assert known.color == COLORS["red"]
    assert torch.allclose(known.members[0].color, torch.tensor(COLORS["red"]))
    again = exemplars_of("a red chair", seed=0)
    assert all(torch.equal(a.points, b.points) for a, b in zip(known.members, again.members, strict=True))
    assert not torch.equal(exemplars_of("a red chair", seed=1).members[0].points, known.members[0].points)


def test_a_new_kind_changes_nothing_for_the_old_ones(monkeypatch):
    before = exemplars_of("a red chair", seed=0).members
    monkeypatch.setitem(CATEGORIES, "marquee", replace(CATEGORIES["tent"], name="marquee"))
    after = exemplars_of("a red chair", seed=0).members
    assert all(torch.equal(a.points, b.points) for a, b in zip(before, after, strict=True))
    assert len(exemplars_of(Request("marquee"), seed=0).members) == FITTING + len(OTHER_KINDS)


@pytest.mark.parametrize(
    "asked", [Request("mug", count=1), Request("mug", count=3), Request("lamp", stretch=(1.0, 1.0, 1.35))]
)
def test_what_is_asked_for_fills_the_unit_ball(asked):
    points = points_on(requested(asked, torch.Generator().manual_seed(2)))
    assert 0.93 < float(points.norm(dim=1).max()) < 0.97


def test_faces_go_with_the_strokes_of_what_is_asked_for():
    """A box has its corners where the strokes of its edges end, however it is stretched and repeated."""
    known = exemplars_of(Request("present", count=2, stretch=(1.0, 1.0, 1.5)), seed=0)
    for sketch, made in zip(known.meant, known.faces, strict=True):
        corners, ends = (
            {tuple(round(x, 2) for x in point) for point in points.reshape(-1, 3).tolist()}
            for points in (made(), sketch.points[:, [0, 3]])
        )
        assert len(corners) >= 16
        assert corners <= ends


def test_several_things_stand_in_a_row_apart():
    generator = torch.Generator
    one = requested(Request("bottle"), generator().manual_seed(2))
    three = requested(Request("bottle", count=3), generator().manual_seed(2))
    assert len(three) == 3 * len(one)
    parts = [points_on(three[i * len(one) : (i + 1) * len(one)])[:, 1] for i in range(3)]
    assert float(parts[0].max()) < float(parts[1].min())
    assert float(parts[1].max()) < float(parts[2].min())


def test_proportions_change_as_said():
    def height_by_width(stretch) -> float:
        points = points_on(requested(Request("lamp", stretch=stretch), torch.Generator().manual_seed(2)))
        extent = points.amax(0) - points.amin(0)
        return float(extent[2] / extent[1])

    assert height_by_width((1.0, 1.0, 1.35)) == pytest.approx(1.35 * height_by_width((1.0, 1.0, 1.0)), rel=1e-4)


@pytest.fixture(scope="module")
def chair(tmp_path_factory):
    out = tmp_path_factory.mktemp("chair") / "run"
    main(["text", "a chair", "-o", str(out), "--quiet", "--steps", "60", "--prior", "exemplar"])
    return out


def test_a_phrase_becomes_its_thing(chair):
    """F-score at 5 % of the size against the nearest member that the phrase means."""
    sketch = ds.load(chair / "sketch.json")
    best = max(f_score(sketch, wanted) for wanted in exemplars_of("a chair", seed=0).members[:FITTING])
    assert best > 0.85
    # As thin as other sketches, although the prior looks at thick strokes.
    assert torch.allclose(sketch.width, torch.tensor(0.006))


def test_the_run_says_what_it_was(chair):
    info = json.loads((chair / "run.json").read_text())
    assert info["options"]["phrase"] == "a chair"
    assert info["options"]["prior"] == "exemplar"
    assert info["radius"] == 0.8


@pytest.mark.slow
@pytest.mark.usefixtures("few_members")
def test_colour_and_count_arrive(tmp_path):
    main(
        ["text", "two blue mugs", "-o", str(tmp_path), "--quiet", "--steps", "3", "--no-redraw", "--prior", "exemplar"]
    )
    assert torch.allclose(ds.load(tmp_path / "sketch.json").color, torch.tensor(COLORS["blue"]))


def test_what_it_does_not_know_is_an_error_that_helps(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["text", "a zeppelin", "-o", str(tmp_path / "out"), "--prior", "exemplar"])
    assert ended.value.code == FAULT
    said = " ".join(capsys.readouterr().err.split())
    assert "does not know 'zeppelin'" in said
    assert "diff3ds fetch mvdream" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("few_members")
def test_without_a_gpu_or_weights_the_built_in_prior_is_taken_and_said(tmp_path, capsys):
    main(["text", "a mug", "-o", str(tmp_path), "--steps", "1", "--no-redraw"])
    said = " ".join(capsys.readouterr().err.split())
    assert "prior: the built-in prior, because" in said


def test_negative_phrases_are_for_others(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["text", "a mug", "-o", str(tmp_path / "out"), "--negative", "a chair", "--prior", "exemplar"])
    assert "negative phrases are for mvdream" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.usefixtures("few_members")
def test_a_seed_is_one_sketch_for_any_number_of_threads(tmp_path):
    """Also what is summed before the first step."""
    found, threads = [], torch.get_num_threads()
    spec = with_options(RunSpec(Phrase("a mug")), steps=3, sheet_every=0)
    for count in (1, 2):
        torch.set_num_threads(count)
        try:
            found.append(run_text(spec, tmp_path / str(count)))
        finally:
            torch.set_num_threads(threads)
    assert torch.equal(found[0].points, found[1].points)
    assert torch.equal(found[0].weights, found[1].weights)


@pytest.mark.slow
def test_the_prior_of_a_phrase_is_one_for_any_number_of_threads():
    threads = torch.get_num_threads()
    means = []
    for count in (1, 2):
        torch.set_num_threads(count)
        try:
            means.append(exemplars_of("a chair", 0).prior(0.05)._mean)
        finally:
            torch.set_num_threads(threads)
    assert means[0] == means[1]


@pytest.mark.usefixtures("few_members")
def test_words_of_size_are_said_to_change_nothing(tmp_path):
    said = []
    for phrase, prior in (("a small chair", "exemplar"), ("a big chair", "small")):
        spec = with_options(RunSpec(Phrase(phrase)), prior=prior, steps=1, strokes=4, redraw=False)
        run_text(spec, tmp_path / prior, say=said.append)
    assert said == [f"'{word}' changes nothing: every sketch fills the same ball" for word in ("small", "big")]
