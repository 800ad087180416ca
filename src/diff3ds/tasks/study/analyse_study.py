"""Answers of a study to a table and a plot: what `diff3ds study analyse` does."""

import itertools
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from diff3ds._files import read_json, write_text
from diff3ds.metrics.statistics import Mean, agreement, holm, mean_of, signed_rank
from diff3ds.tasks.evaluate.score_table import table
from diff3ds.tasks.study.make_study import ANSWERS, KEY
from diff3ds.tasks.study.questions import LEAST, MOST, QUESTIONS

# Marks of one participant: by question and sketch.
Marks = dict[str, dict[str, float]]
# Of the plot, pixels: of a bar, between groups, its height, its borders; and the colours of methods, in turn.
BAR, GAP, HEIGHT, LEFT, TOP = 34, 46, 220, 46, 46
COLOURS = ("#4878a8", "#d8813a", "#5f9e6e", "#b5544f", "#8a72b2", "#8d7866")


@dataclass(frozen=True)
class Pair:
    """Two methods compared: the difference of their means, and p by Wilcoxon's signed-rank test, Holm's correction."""

    first: str
    second: str
    difference: float
    p: float
    corrected: float


@dataclass(frozen=True)
class Findings:
    """What participants said to one question."""

    means: dict[str, Mean]
    pairs: list[Pair]
    agreement: float | None


def analyse_study(folder: Path) -> tuple[dict[str, Findings], int]:
    """Writes analysis.md, analysis.json and analysis.svg beside the answers of a study.

    Participants are what is independent: a method's mean is that of their means over sketches.

    Args:
        folder: of the study, with the files of answers in its folder `answers`.

    Returns:
        What was found by question, and the number of participants.

    Raises:
        FileNotFoundError, ValueError: no study, no answers; a file that is none, is of another study, is not complete,
            or has marks that the page does not give.
    """
    key = _key(folder / KEY)
    codes: Mapping[str, Mapping[str, str]] = key["sketches"]
    paths = sorted((folder / ANSWERS).glob("*.json"))
    if not paths:
        raise FileNotFoundError(
            f"{folder / ANSWERS}: no answers in it; participants' files (answers-....json) go there"
        )
    participants: dict[str, Marks] = {}
    for path in paths:
        who, marks = _read(path, key)
        if who in participants:
            raise ValueError(f"{path}: the same participant ({who}) as another file: take one of them away")
        participants[who] = marks
    found = {question: _found(question, key["methods"], codes, list(participants.values())) for question in QUESTIONS}
    content = {"participants": len(participants), **{name: asdict(one) for name, one in found.items()}}
    write_text(folder / "analysis.json", json.dumps(content, indent=1))
    write_text(folder / "analysis.md", markdown(found, len(participants), len(codes)))
    write_text(folder / "analysis.svg", bar_plot(found))
    return found, len(participants)


def _key(path: Path) -> Mapping[str, Any]:
    """Which sketch is whose, as `make_study` wrote it."""
    if not path.is_file():
        raise FileNotFoundError(f'{path} is not there: give the folder that "diff3ds study make" wrote')
    key = read_json(path)
    try:
        methods, of = key["methods"], [about["method"] for about in key["sketches"].values()]
        is_whole = isinstance(key["study"], str) and len(methods) >= 2 and set(methods) == set(of)
    except (AttributeError, KeyError, TypeError):
        is_whole = False
    if not is_whole:
        raise ValueError(f'{path}: damaged, it does not say which sketch is whose as "diff3ds study make" wrote it')
    found: Mapping[str, Any] = key
    return found


def _read(path: Path, key: Mapping[str, Any]) -> tuple[str, Marks]:
    """The participant and the marks of a file of answers."""
    content = read_json(path)
    try:
        study, who, answers = content["study"], str(content["participant"]), content["answers"]
        given = {answer["sketch"]: answer for answer in answers}
        marks = {question: {code: answer[question] for code, answer in given.items()} for question in QUESTIONS}
    except (TypeError, KeyError) as error:
        raise ValueError(f"{path}: not a file of answers, as the page of a study saves it") from error
    if study != key["study"]:
        raise ValueError(f"{path}: answers to another study ({study}, not {key['study']})")
    if given.keys() != key["sketches"].keys() or len(given) != len(answers):
        raise ValueError(
            f"{path}: answers about {len(answers)} sketches, not once about each of {len(key['sketches'])}"
        )
    for of_question in marks.values():
        for mark in of_question.values():
            if not isinstance(mark, int) or isinstance(mark, bool) or not LEAST <= mark <= MOST:
                raise ValueError(f"{path}: marks are whole numbers from {LEAST} to {MOST}, got {mark!r}")
    return who, marks


def _found(
    question: str, methods: list[str], codes: Mapping[str, Mapping[str, str]], participants: list[Marks]
) -> Findings:
    own = {method: [code for code, about in codes.items() if about["method"] == method] for method in methods}
    means = {
        method: [float(np.mean([marks[question][code] for code in own[method]])) for marks in participants]
        for method in methods
    }
    chosen = list(itertools.combinations(methods, 2))
    values = [signed_rank(means[a], means[b]) for a, b in chosen]
    pairs = [
        Pair(a, b, float(np.mean(means[a]) - np.mean(means[b])), p, corrected)
        for (a, b), p, corrected in zip(chosen, values, holm(values), strict=True)
    ]
    marks = np.array([[of[question][code] for code in codes] for of in participants], dtype=np.float64)
    return Findings({method: mean_of(values) for method, values in means.items()}, pairs, agreement(marks))


def markdown(found: Mapping[str, Findings], participants: int, sketches: int) -> str:
    """The table of a study."""
    head = f"{participants} participants, {sketches} sketches each, marks from {LEAST} to {MOST}."
    parts = ["# User study", head + " Means over participants with 95 % confidence intervals (Student's t)."]
    methods = list(next(iter(found.values())).means)
    rows = [[method, *(_interval(one.means[method]) for one in found.values())] for method in methods]
    parts += [table(["method", *found], rows)]
    parts += ["Paired comparisons: Wilcoxon's signed-rank test of participants' means, two-sided, Holm's correction."]
    pairs = [
        [question, pair.first, pair.second, f"{pair.difference:+.2f}", f"{pair.p:.4g}", f"{pair.corrected:.4g}"]
        for question, one in found.items()
        for pair in one.pairs
    ]
    parts += [table(["question", "first", "second", "difference", "p", "p corrected"], pairs)]
    said = [f"{q} {'—' if one.agreement is None else f'{one.agreement:.3f}'}" for q, one in found.items()]
    parts += [f"Agreement of participants (Krippendorff's alpha, intervals): {', '.join(said)}."]
    parts += [f"- {name}: {text}" for name, text in QUESTIONS.items()]
    return "\n\n".join(parts) + "\n"


def _interval(mean: Mean) -> str:
    return f"{mean.value:.2f}" + ("" if mean.margin is None else f" ± {mean.margin:.2f}")


def bar_plot(found: Mapping[str, Findings]) -> str:
    """A group of bars a question, a bar a method, with confidence intervals, as SVG."""
    methods = list(next(iter(found.values())).means)
    group = len(methods) * BAR + GAP
    width, base = LEFT + len(found) * group + 10, TOP + HEIGHT

    def y(mark: float) -> float:
        return base - HEIGHT * (mark - LEAST) / (MOST - LEAST)

    lines = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{base + 30 + 18 * len(methods)}">']
    lines += ['<rect width="100%" height="100%" fill="#fff"/><g font-family="sans-serif" font-size="13">']
    for mark in range(LEAST, MOST + 1):
        lines.append(f'<path d="M{LEFT} {y(mark):.1f}H{width - 10}" stroke="#ddd"/>')
        lines.append(f'<text x="{LEFT - 10}" y="{y(mark) + 4:.1f}" text-anchor="end">{mark}</text>')
    for i, (question, one) in enumerate(found.items()):
        left = LEFT + i * group + GAP / 2
        for j, method in enumerate(methods):
            mean, x, colour = one.means[method], left + j * BAR, COLOURS[j % len(COLOURS)]
            top = y(mean.value)
            lines.append(f'<path d="M{x + 3} {base}V{top:.1f}h{BAR - 6}V{base}z" fill="{colour}"/>')
            end = y(min(MOST + 0.6, mean.value + (mean.margin or 0)))
            if mean.margin is not None:
                low = y(max(LEAST, mean.value - mean.margin))
                lines.append(f'<path d="M{x + BAR / 2} {low:.1f}V{end:.1f}" stroke="#222" stroke-width="1.5"/>')
            lines.append(f'<text x="{x + BAR / 2}" y="{end - 5:.1f}" text-anchor="middle">{mean.value:.2f}</text>')
        middle = left + len(methods) * BAR / 2
        lines.append(f'<text x="{middle}" y="{base + 18}" text-anchor="middle">{escape(question)}</text>')
    for j, method in enumerate(methods):
        row = base + 30 + 18 * j
        lines.append(f'<rect x="{LEFT}" y="{row}" width="12" height="12" fill="{COLOURS[j % len(COLOURS)]}"/>')
        lines.append(f'<text x="{LEFT + 18}" y="{row + 11}">{escape(method)}</text>')
    return "\n".join([*lines, "</g></svg>", ""])
