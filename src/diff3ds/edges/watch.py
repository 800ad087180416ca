"""Who watches a reconstruction: told how far it is, and of what there was too much to look at all of it."""

from collections.abc import Callable

# Called with how many of how many parts of a stage are done.
Tick = Callable[[int, int], None]
# Called with the name of a stage, the parts done and their number (None where nobody knows), the loss of a refinement's
# last step, and the number of curves.
Report = Callable[[str, int, int | None, float | None, int], None]
# Called with what there was too much of, how many of them were looked at, and of how many.
Capped = Callable[[str, int, int], None]


def no_tick(done: int, total: int) -> None:
    """For those whom nobody watches."""


def no_report(stage: str, done: int, total: int | None, loss: float | None, curves: int) -> None:
    """For those whom nobody watches."""


def not_said(what: str, kept: int, found: int) -> None:
    """For those whom nobody watches."""
