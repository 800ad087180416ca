"""What a running task tells of its losses."""

import math
import sys
import time
from types import SimpleNamespace

import pytest
import torch
from rich.console import Console

from diff3ds.command_line.console import progress_on
from diff3ds.optimize.fit import Step
from diff3ds.parallel.in_copies import in_copies
from diff3ds.render import Rendering
from diff3ds.render.backends import set_num_threads
from diff3ds.sketch import Sketch
from diff3ds.tasks.progress import Lines, Progress, ShownLoss, StageTimes


class CountedStep(Step):
    """A step that counts the looks at its loss; "meta" stands for a GPU."""

    looks = 0

    def __init__(self, index: int, device: str) -> None:
        sketch = Sketch.random(1, generator=torch.Generator().manual_seed(0))
        drawn = Rendering(torch.zeros(1, 2, 2, 3), torch.zeros(1, 2, 2), torch.zeros(1, 2, 2))
        super().__init__(index, sketch, torch.tensor(float(index), device=device), drawn)

    @property
    def loss(self) -> float:
        CountedStep.looks += 1
        return float(self.index)


@pytest.fixture
def clock(monkeypatch):
    now = SimpleNamespace(seconds=100.0)
    monkeypatch.setattr(time, "monotonic", lambda: now.seconds)
    monkeypatch.setattr(CountedStep, "looks", 0)
    return now


def test_a_gpu_is_asked_once_a_second(clock):
    shown, seen = ShownLoss(), []
    for index in range(25):
        seen.append(shown.of(CountedStep(index, "meta")))
        clock.seconds += 0.125
    assert seen == [8.0 * (index // 8) for index in range(25)]
    assert CountedStep.looks == math.ceil(25 / 8)


def test_losses_on_the_cpu_are_all_shown(clock):
    shown = ShownLoss()
    assert [shown.of(CountedStep(index, "cpu")) for index in range(5)] == [0, 1, 2, 3, 4]


def test_lines_come_now_and_then(clock):
    said = []
    lines = Lines(said.append, lambda: clock.seconds)
    for step in range(400):
        lines(Progress("refine", step, 400, 0.5, 7))
        clock.seconds += 0.125
    # After two seconds and every 15 after it: 50 seconds have four.
    assert said == [f"refine {step}/400, loss 0.5, 7 strokes" for step in (16, 136, 256, 376)]
    # A stage that is over soon has none.
    for stage in ("join", "place"):
        for _ in range(5):
            lines(Progress(stage, 0, None, None, 0))
            clock.seconds += 0.25
    assert len(said) == 4
    # Of a stage that takes long it is said how long, once a tenth of it is done.
    for step in range(50):
        lines(Progress("fit", step, 400, None, 0))
        clock.seconds += 2
    assert said[4:7] == ["fit 1/400", "fit 9/400", "fit 17/400"]
    assert said[9] == "fit 41/400, about 12 min left"


def test_off_a_terminal_progress_is_lines(monkeypatch, capsys):
    monkeypatch.setattr(Lines, "SHORT", 0.0)
    with progress_on(Console(stderr=True, force_terminal=False)) as report:
        report(Progress("carve", 3, 8, None, 0))
    assert capsys.readouterr().err == "carve 3/8\n"
    with progress_on(Console(stderr=True, force_terminal=False, quiet=True)) as report:
        report(Progress("carve", 3, 8, None, 0))
    assert capsys.readouterr().err == ""


@pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux alone")
def test_the_processor_time_of_copies_is_that_of_the_stage_that_waits_for_them():
    set_num_threads(2)
    try:
        times = StageTimes()
        times.begin("apart")
        in_copies(lambda job: _busy(0.2), 2, 2)
        assert 0.3 < times.seconds()["apart"]["processor"] < 2.0
    finally:
        set_num_threads(None)


def _busy(seconds: float) -> None:
    until = time.process_time() + seconds
    while time.process_time() < until:
        pass
