"""The user study: its page in a browser, and the analysis of answers against published and independent values."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
import scipy.stats
from viewer_browser import CHROMIUM

import diff3ds as ds
from diff3ds.library import member
from diff3ds.metrics.statistics import agreement, holm, mean_of, signed_rank
from diff3ds.tasks.study.analyse_study import analyse_study
from diff3ds.tasks.study.make_study import make_study, named_folders

METHODS, PHRASES = ("ours", "theirs", "others"), ("a chair", "a <b>table</b>")


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A study of three methods and two phrases."""
    import torch

    folder = tmp_path_factory.mktemp("study")
    for i, (method, phrase) in enumerate(itertools.product(METHODS, PHRASES)):
        place = folder / method / str(i)
        ds.save(place / "sketch.json", member("chair", torch.Generator().manual_seed(i)).sketch)
        (place / "run.json").write_text(json.dumps({"options": {"phrase": phrase}}))
    assert make_study({m: folder / m for m in METHODS}, folder / "out", "A title & more") == 6
    return folder / "out"


def key_of(study: Path) -> dict:
    return json.loads((study / "study.json").read_text())


def answer(study: Path, who: str, mark, folder: Path) -> Path:
    """A participant's file: the marks of a method and a question are what `mark(method, subject, question)` says."""
    key = key_of(study)
    answers = [
        {"sketch": code, **{q: mark(about["method"], about["subject"], q) for q in ("quality", "match")}}
        for code, about in key["sketches"].items()
    ]
    path = folder / "answers" / f"answers-{who}.json"
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps({"study": key["study"], "participant": who, "answers": answers}))
    return path


@pytest.fixture
def answered(study, tmp_path):
    (tmp_path / "study.json").write_text((study / "study.json").read_text())
    return tmp_path


def test_agreement_is_that_of_krippendorffs_example():
    """The four observers and twelve units of Krippendorff (2011), whose alpha for intervals is published: .849."""
    none = np.nan
    marks = [
        [1, 2, 3, 3, 2, 1, 4, 1, 2, none, none, none],
        [1, 2, 3, 3, 2, 2, 4, 1, 2, 5, none, 3],
        [none, 3, 3, 3, 2, 3, 4, 2, 2, 5, 1, none],
        [1, 2, 3, 3, 2, 4, 4, 1, 2, 5, 1, none],
    ]
    assert agreement(np.array(marks)) == pytest.approx(0.849, abs=5e-4)
    assert agreement(np.array([[1.0, 5], [1, 5]])) == 1
    assert agreement(np.full((3, 2), 4.0)) is None


def test_holms_correction_by_hand():
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == [1.0, 1.0]


def test_signed_ranks_by_hand():
    # Of 2^5 signs of five ranks two are as extreme as all alike.
    assert signed_rank([5, 4, 4.5, 4.2, 4.9], [1, 2, 3.5, 3.9, 2.1]) == pytest.approx(2 / 32)
    assert signed_rank([1, 2], [1, 2]) == 1


def test_intervals_are_students():
    mean = mean_of([2.0, 3, 4, 4.5])
    low, high = scipy.stats.t.interval(0.95, 3, loc=3.375, scale=scipy.stats.sem([2, 3, 4, 4.5]))
    assert (mean.value, mean.count) == (3.375, 4)
    assert (mean.value - mean.margin, mean.value + mean.margin) == pytest.approx((low, high))
    assert mean_of([3.0]).margin is None


def test_the_analysis_of_answers_that_are_known(study, answered):
    base = {"ours": 5, "theirs": 3, "others": 3}
    for i in range(6):
        shift = i % 2

        def mark(method, subject, question, shift=shift):
            return base[method] - shift if question == "quality" else 4

        answer(study, f"p{i}", mark, answered)
    found, count = analyse_study(answered)
    assert count == 6
    assert {m: one.value for m, one in found["quality"].means.items()} == {"ours": 4.5, "theirs": 2.5, "others": 2.5}
    expected = scipy.stats.wilcoxon([2.0] * 6, method="approx").pvalue
    by_pair = {(p.first, p.second): p for p in found["quality"].pairs}
    assert by_pair["ours", "theirs"].p == pytest.approx(expected)
    assert by_pair["ours", "theirs"].corrected == pytest.approx(min(1, 3 * expected))
    assert by_pair["theirs", "others"].p == 1
    assert by_pair["ours", "theirs"].difference == 2
    assert found["match"].agreement is None
    text = (answered / "analysis.md").read_text()
    assert "| ours | 4.50 ± 0.57 | 4.00 ± 0.00 |" in text
    assert "6 participants, 6 sketches each" in text
    plot = (answered / "analysis.svg").read_text()
    assert plot.count('text-anchor="middle">4.50<') == 1


BROKEN = {
    "another study": lambda c: c | {"study": "x"},
    "not a file of answers": lambda c: {"answers": 3},
    "not once about each": lambda c: c | {"answers": c["answers"][1:]},
    "whole numbers from 1 to 5, got 6": lambda c: c | {"answers": [c["answers"][0] | {"match": 6}, *c["answers"][1:]]},
    "not a file": lambda c: c | {"answers": [{"sketch": "x"}]},
}


@pytest.mark.parametrize("said", BROKEN)
def test_answers_that_are_none_are_named(said, study, answered):
    path = answer(study, "p", lambda *_: 3, answered)
    path.write_text(json.dumps(BROKEN[said](json.loads(path.read_text()))))
    with pytest.raises(ValueError, match=said) as caught:
        analyse_study(answered)
    assert path.name in str(caught.value)
    assert not (answered / "analysis.md").exists()


@pytest.mark.parametrize(
    "key",
    [
        [],
        {},
        {"study": "x", "methods": 3, "sketches": {}},
        {"study": "x", "methods": ["a", "b"], "sketches": {"c": {}}},
    ],
)
def test_a_damaged_study_is_named(key, study, answered):
    answer(study, "p", lambda *_: 3, answered)
    (answered / "study.json").write_text(json.dumps(key))
    with pytest.raises(ValueError, match=r"study\.json: damaged"):
        analyse_study(answered)
    (answered / "study.json").unlink()
    with pytest.raises(FileNotFoundError, match='give the folder that "diff3ds study make" wrote'):
        analyse_study(answered)


def test_one_participant_counts_once(study, answered):
    path = answer(study, "p", lambda *_: 3, answered)
    path.with_name("copy.json").write_text(path.read_text())
    with pytest.raises(ValueError, match="the same participant"):
        analyse_study(answered)
    path.unlink()
    path.with_name("copy.json").unlink()
    with pytest.raises(FileNotFoundError, match="no answers"):
        analyse_study(answered)


def test_like_is_compared_with_like(study, tmp_path):
    runs = study.parent
    with pytest.raises(ValueError, match="at least two methods"):
        make_study({"ours": runs / "ours"}, tmp_path)
    with pytest.raises(ValueError, match="holds a study"):
        make_study({m: runs / m for m in METHODS}, study)
    place = tmp_path / "less" / "0"
    ds.save(place / "sketch.json", ds.library.demo_sketch())
    (place / "run.json").write_text(json.dumps({"options": {"phrase": "a chair"}}))
    with pytest.raises(ValueError, match="less has no run of 'a <b>table</b>'"):
        make_study({"ours": runs / "ours", "less": tmp_path / "less"}, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    for words, said in ((["ours"], "NAME=FOLDER"), (["a=b", "a=c"], "named twice")):
        with pytest.raises(ValueError, match=said):
            named_folders(words)


def test_the_page_does_not_say_whose_sketches_are(study):
    text = (study / "study.html").read_text()
    assert not any(f'"{method}"' in text for method in METHODS)
    assert "A title &amp; more" in text
    assert "<b>table" not in text


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium (Debian: apt-get install chromium)")
@pytest.mark.xdist_group("browser")
def test_participants_in_a_browser_are_asked_in_their_own_order_and_get_their_answers(browser, study, answered):
    key = key_of(study)
    orders = set()
    for number in range(3):
        browser.open((study / "study.html").as_uri(), width=760, height=900)
        # Another participant, whose browser knows nothing of the last.
        browser.value("localStorage.clear()")
        browser.open((study / "study.html").as_uri(), width=760, height=900)
        browser.value("document.getElementById('begin').click()")
        for at in range(6):
            place = browser.value("document.getElementById('place').textContent")
            assert place == f"Sketch {at + 1} of 6"
            assert browser.value("document.getElementById('next').disabled")
            # What is not answered is not passed.
            browser.value("document.getElementById('ask').requestSubmit()")
            assert browser.value("document.getElementById('place').textContent") == place
            for name, mark in (("quality", 1 + at % 5), ("match", 2 + number)):
                browser.value(f"document.querySelector('input[name={name}][value=\"{mark}\"]').click()")
            if number == at == 0:
                browser.value("document.getElementById('sketch').decode()")
                assert browser.value("document.getElementById('sketch').naturalWidth") == 512
            browser.value("document.getElementById('ask').requestSubmit()")
        # Back and forth again, with what was said.
        browser.value("document.getElementById('again').click()")
        assert browser.value("document.querySelector('input[name=match]:checked').value") == str(2 + number)
        browser.value("document.getElementById('ask').requestSubmit()")
        assert not browser.value("document.getElementById('end').hidden")
        name = browser.value("document.getElementById('save').download")
        text = browser.value("fetch(document.getElementById('save').href).then(r => r.text())"
                             ".catch(() => document.getElementById('save').dataset.text)")  # fmt: skip
        assert browser.requests[:1] == [(study / "study.html").as_uri()]
        assert all(r.startswith(("data:", "file:", "blob:")) for r in browser.requests)
        answers = json.loads(text)
        order = [a["sketch"] for a in answers["answers"]]
        assert {*order} == key["sketches"].keys()
        # Sketches of a task come one after the other.
        tasks = [key["sketches"][code]["subject"] for code in order]
        assert len([*itertools.groupby(tasks)]) == 2
        assert [a["quality"] for a in answers["answers"]] == [1, 2, 3, 4, 5, 1]
        orders.add(tuple(order))
        (answered / "answers").mkdir(exist_ok=True)
        (answered / "answers" / name).write_text(text)
    assert len(orders) > 1
    found, count = analyse_study(answered)
    assert count == 3
    assert all(mean.value == 3 for mean in found["match"].means.values())
    # All marks of one participant are 2, 3 or 4: within sketches the squared differences are 2, over all 432 / 306.
    assert found["match"].agreement == pytest.approx(1 - 2 / (432 / 306))
