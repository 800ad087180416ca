"""What a running task tells."""

import math
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from diff3ds.optimize.fit import Step
    from diff3ds.sketch import Sketch


@dataclass(frozen=True)
class Progress:
    """Where a task is.

    Attributes:
        stage: its name.
        done, total: steps of this stage; total None where nobody knows.
        loss: of the last step; where one waits for it (on a GPU), of a step in the last second.
        strokes: of the sketch so far.
        note: what else to say of this step.
        sketch: makes the sketch so far, as the results would have it, for those who want to see it; None before there
            is one.
    """

    stage: str
    done: int
    total: int | None
    loss: float | None
    strokes: int
    note: str = ""
    sketch: "Callable[[], Sketch] | None" = None


Report = Callable[[Progress], None]


class Lines:
    """Reports as lines of text, where no terminal can show a bar: of a stage that goes on, one now and then."""

    # Of a stage that is over sooner nobody needs a line; in a file, more lines than this are too many.
    SHORT, EVERY = 2.0, 15.0

    def __init__(self, say: Callable[[str], None], clock: Callable[[], float] = time.monotonic) -> None:
        """Says nothing yet.

        Args:
            say: called with each line.
            clock: seconds.
        """
        self._say, self._clock = say, clock
        self._stage, self._due = "", math.inf
        self._began, self._first = 0.0, 0

    def __call__(self, progress: Progress) -> None:
        """Reports this."""
        now = self._clock()
        if progress.stage != self._stage:
            self._stage, self._due = progress.stage, now + self.SHORT
            self._began, self._first = now, progress.done
        if now < self._due:
            return
        self._due = now + self.EVERY
        of = f" {progress.done}/{progress.total}" if progress.total else ""
        loss = "" if progress.loss is None else f", loss {progress.loss:.5g}"
        strokes = f", {progress.strokes} strokes {progress.note}".rstrip() if progress.strokes else ""
        self._say(f"{progress.stage}{of}{loss}{strokes}{self._left(progress, now)}")

    def _left(self, progress: Progress, now: float) -> str:
        """How long the stage will take from here, once a tenth of it is done, where that is a minute or more."""
        done = progress.done - self._first
        if not progress.total or done <= 0 or progress.done < progress.total / 10:
            return ""
        minutes = (progress.total - progress.done) * (now - self._began) / done / 60
        return f", about {minutes:.0f} min left" if minutes >= 1 else ""


class ShownLoss:
    """The loss of a step for people to see. A look at one on a GPU waits for the device: there is one a second."""

    def __init__(self) -> None:
        self._value, self._due = math.nan, -math.inf

    def of(self, step: "Step") -> float:
        """The loss of this step, or of one not long before."""
        if step.loss_tensor.device.type == "cpu" or time.monotonic() >= self._due:
            self._value, self._due = step.loss, time.monotonic() + 1
        return self._value


class StageTimes:
    """How long the stages of a task take, one after the other."""

    def __init__(self) -> None:
        self._spent: dict[str, list[float]] = {}
        self._stage: str | None = None
        self._since = (0.0, 0.0)

    def begin(self, stage: str) -> None:
        """Counts time for this stage from here on."""
        copies = os.times()
        now = time.perf_counter(), time.process_time() + copies.children_user + copies.children_system
        if self._stage is not None:
            spent = self._spent.setdefault(self._stage, [0.0, 0.0])
            spent[:] = (s + n - then for s, n, then in zip(spent, now, self._since, strict=True))
        self._stage, self._since = stage, now

    def seconds(self) -> dict[str, dict[str, float]]:
        """The seconds of every stage so far: on the clock, and of the processor."""
        if self._stage is not None:
            self.begin(self._stage)
        return {
            stage: {"seconds": round(clock, 3), "processor": round(processor, 3)}
            for stage, (clock, processor) in self._spent.items()
        }


class Stopped(KeyboardInterrupt):
    """A task that Ctrl-C ended early, from whose results --resume goes on."""
