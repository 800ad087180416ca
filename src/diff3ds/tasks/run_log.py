"""What a run has told so far, in its folder: progress.json, and its strokes in sketch.json, which a page follows."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Literal

from diff3ds._files import read_json, write_text
from diff3ds.formats.sketch_json import save_json
from diff3ds.tasks.progress import Progress, Report

PROGRESS = "progress.json"
VERSION = 1
# Seconds between two states of the files at least, and as a multiple of the time that writing them takes: no run
# spends more than a fiftieth of its time on it.
EVERY, SPARING = 2.0, 50
# Numbers of the curve, and lines of the log, at most.
MOST_LOSSES, MOST_LINES = 512, 500

How = Literal["done", "stopped", "failed"]
Say = Callable[[str], None]


@contextmanager
def logged(out: Path, report: Report, say: Say) -> Iterator[tuple[Report, Say]]:
    """Reports and says on, and keeps what was told in the folder of a run, from its first strokes on.

    A run does not depend on it: where the files cannot be written, there are none. The results of a run take the place
    of the sketch so far.

    Args:
        out: the folder of the run.
        report: what the command reports its progress to.
        say: what the command says its lines to.
    """
    log = RunLog(out, report, say)
    try:
        yield log.report, log.say
    except KeyboardInterrupt:
        log.end("stopped")
        raise
    except BaseException:
        log.end("failed")
        raise
    log.end("done")


class RunLog:
    """Keeps what a run tells."""

    def __init__(self, out: Path, report: Report, say: Say, clock: Callable[[], float] = time.monotonic) -> None:
        """Writes nothing yet.

        Args:
            out: the folder of the run.
            report, say: told everything as well.
            clock: seconds.
        """
        self._path, self._report, self._say, self._clock = out / PROGRESS, report, say, clock
        self._lines: list[str] = []
        self._losses: list[float] = []
        # Every so many of the losses one is kept; so many there were.
        self._every, self._seen = 1, 0
        self._latest: Progress | None = None
        self._begun = False
        self._due = -float("inf")

    def say(self, line: str) -> None:
        """Keeps a line."""
        self._lines = [*self._lines, line][-MOST_LINES:]
        self._say(line)

    def report(self, progress: Progress) -> None:
        """Keeps where the run is, and writes it now and then, once there are strokes."""
        if self._latest is None or progress.stage != self._latest.stage:
            self._lines = [*self._lines, progress.stage][-MOST_LINES:]
        self._latest = progress
        if progress.loss is not None:
            self._keep(progress.loss)
        now = self._clock()
        if (progress.sketch is not None or self._begun) and now >= self._due:
            with suppress(OSError):
                # A stage that has no strokes of its own leaves those of the one before.
                if progress.sketch is not None:
                    save_json(self._path.with_name("sketch.json"), progress.sketch())
                self._write(None)
            after = self._clock()
            self._due = after + max(EVERY, SPARING * (after - now))
        self._report(progress)

    def end(self, how: How) -> None:
        """Writes how the run has ended, if it had begun."""
        if self._begun:
            with suppress(OSError):
                self._write(how)

    def _keep(self, loss: float) -> None:
        self._seen += 1
        if (self._seen - 1) % self._every:
            return
        self._losses.append(loss)
        if len(self._losses) >= MOST_LOSSES:
            self._losses, self._every = self._losses[::2], 2 * self._every

    def _write(self, ended: How | None) -> None:
        latest = self._latest
        assert latest is not None
        about = {
            "version": VERSION,
            "ended": ended,
            "stage": latest.stage,
            "done": latest.done,
            "total": latest.total,
            "loss": latest.loss,
            "note": latest.note,
            "losses": {"every": self._every, "values": self._losses},
            "log": self._lines,
        }
        lines = [f"{json.dumps(name)}: {json.dumps(value)}" for name, value in about.items()]
        write_text(self._path, "{\n" + ",\n".join(lines) + "\n}\n")
        self._begun = True


def read_log(out: Path) -> dict[str, Any] | None:
    """What a run has told so far; None where it has told nothing.

    Raises:
        ValueError: it is no such file.
        OSError: it cannot be read.
    """
    path = out / PROGRESS
    if not path.is_file():
        return None
    told = read_json(path)
    if not isinstance(told, dict) or told.get("version") != VERSION:
        raise ValueError(f"{path}: not what this version of diff3ds tells of a run: delete it")
    return told
