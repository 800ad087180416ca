"""What a run keeps of what it tells: the page follows it, and the run does not depend on it."""

import json

import pytest
import torch

import diff3ds as ds
from diff3ds.tasks import run_log
from diff3ds.tasks.progress import Progress
from diff3ds.tasks.run_log import EVERY, MOST_LOSSES, PROGRESS, RunLog, logged, read_log


def lines(count: int) -> ds.Sketch:
    return ds.Sketch(torch.arange(6.0 * count).reshape(count, 2, 3).sin())


class Clock:
    seconds = 100.0

    def __call__(self) -> float:
        return self.seconds


def quiet(*_):
    """Nobody listens."""


def test_nothing_is_written_before_there_are_strokes(tmp_path):
    log = RunLog(tmp_path, quiet, quiet, Clock())
    log.say("hello")
    log.report(Progress("read", 1, 2, None, 0))
    log.end("failed")
    assert not list(tmp_path.iterdir())


def test_strokes_and_state_are_written_now_and_then(tmp_path):
    clock, told = Clock(), []
    log = RunLog(tmp_path, told.append, quiet, clock)
    for step in range(1, 5):
        log.report(Progress("fit", step, 4, 1 / step, step, sketch=lines(step).detach))
        assert len(ds.load(tmp_path / "sketch.json")) == (1 if step < 3 else 3)
        assert read_log(tmp_path)["done"] == (1 if step < 3 else 3)
        clock.seconds += 0.6 * EVERY
    assert [progress.done for progress in told] == [1, 2, 3, 4]
    log.end("done")
    known = read_log(tmp_path)
    assert (known["ended"], known["done"], known["stage"]) == ("done", 4, "fit")
    assert known["losses"] == {"every": 1, "values": [1, 1 / 2, 1 / 3, 1 / 4]}


def test_what_takes_long_to_write_is_written_less_often(tmp_path):
    clock = Clock()
    log = RunLog(tmp_path, quiet, quiet, clock)

    def slow():
        clock.seconds += 1
        return lines(1)

    written = []
    for step in range(120):
        log.report(Progress("fit", step, 120, None, 1, sketch=slow))
        written.append(read_log(tmp_path)["done"])
        clock.seconds += 1
    assert len(set(written)) == 3


def test_a_long_curve_keeps_its_shape(tmp_path):
    log = RunLog(tmp_path, quiet, quiet, Clock())
    count = 5 * MOST_LOSSES
    for step in range(count):
        log.report(Progress("fit", step, count, float(step), 1, sketch=lines(1).detach))
    log.end("done")
    losses = read_log(tmp_path)["losses"]
    values = torch.tensor(losses["values"])
    assert MOST_LOSSES / 2 <= len(values) < MOST_LOSSES
    assert set(values.diff().tolist()) == {losses["every"]}
    assert values[-1] > count - 2 * losses["every"]


@pytest.mark.parametrize(
    ("error", "how"), [(None, "done"), (KeyboardInterrupt, "stopped"), (FloatingPointError, "failed")]
)
def test_how_it_ended_is_written(error, how, tmp_path):
    def run():
        with logged(tmp_path, quiet, quiet) as (report, say):
            say("a line")
            report(Progress("fit", 1, 2, 0.5, 1, sketch=lines(1).detach))
            if error:
                raise error

    if error:
        with pytest.raises(error):
            run()
    else:
        run()
    assert read_log(tmp_path)["ended"] == how
    assert read_log(tmp_path)["log"] == ["a line", "fit"]


def test_a_full_disk_stops_no_run(tmp_path, monkeypatch):
    def full(*_):
        raise OSError("no space left on device")

    monkeypatch.setattr(run_log, "write_text", full)
    told = []
    with logged(tmp_path, told.append, quiet) as (report, _):
        report(Progress("fit", 1, 2, 0.5, 1, sketch=lines(1).detach))
    assert len(told) == 1
    assert not (tmp_path / PROGRESS).exists()


def test_another_file_of_that_name_is_refused(tmp_path):
    assert read_log(tmp_path) is None
    (tmp_path / PROGRESS).write_text(json.dumps({"version": 0}))
    with pytest.raises(ValueError, match=r"progress\.json: not what this version"):
        read_log(tmp_path)
