"""How far a fit of edges has come: kept in its checkpoint, reported, and what there was too much of said once."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.edges.cameras.coarse_to_fine import Refined
from diff3ds.edges.reconstruct import Result, nothing_yet
from diff3ds.edges.resume import Kept, read_result, write_result
from diff3ds.sketch import Sketch
from diff3ds.tasks.progress import Progress, Report


class EdgeCourse:
    """The course of one fit.

    Attributes:
        kept: what is reached: the result of the last stage, the losses of all steps, and the refined cameras.
        capped: of what there was too much, how many were looked at, and of how many.
    """

    def __init__(
        self,
        checkpoint: Path,
        settings: dict[str, Any],
        drawn: Callable[[Curves], Sketch],
        report: Report,
        say: Callable[[str], None],
    ) -> None:
        """Begins a fit.

        Args:
            checkpoint: file that keeps what is reached.
            settings: what a run that goes on must share.
            drawn: makes a sketch of curves.
            report: called as it goes on.
            say: called with what there was too much of.
        """
        self._checkpoint, self._settings, self._drawn = checkpoint, settings, drawn
        self._report, self._say = report, say
        self.kept = Kept(nothing_yet(), [])
        self.capped: dict[str, tuple[int, int]] = {}

    @property
    def sketch(self) -> Sketch:
        """What is reached, drawn."""
        return self._drawn(self.kept.result.curves)

    def begin(self, resume: bool) -> None:
        """Goes on from the checkpoint if there is one and that is wanted, or else writes the first.

        Raises:
            ValueError: as `read_result`.
        """
        if resume and self._checkpoint.exists():
            self.kept = read_result(self._checkpoint, self._settings)
        else:
            # From here on there is something to resume.
            self._keep(self.kept)

    def save(self, result: Result) -> None:
        """Keeps what a stage has reached."""
        self._keep(replace(self.kept, result=result))

    def save_cameras(self, refined: Refined) -> None:
        """Keeps refined cameras."""
        self._keep(replace(self.kept, refined=refined))

    def _keep(self, kept: Kept) -> None:
        self.kept = kept
        write_result(self._checkpoint, kept, self._settings)

    def tell(self, stage: str, done: int, total: int | None, loss: float | None, strokes: int) -> None:
        """Reports as `edges.watch` wants it, with the sketch so far."""
        self.kept.losses.extend([] if loss is None else [loss])
        told = Progress(stage, done, total, loss, strokes)
        drawn = partial(self._drawn, self.kept.result.curves)
        self._report(replace(told, sketch=drawn) if self.kept.result.stage else told)

    def cap(self, what: str, kept: int, found: int) -> None:
        """Says of what there was too much, and keeps it for run.json."""
        if what not in self.capped:
            self._say(f"full of edges: of {found} {what} {kept} are looked at")
        self.capped[what] = kept, found
