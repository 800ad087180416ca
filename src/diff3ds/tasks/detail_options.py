"""How many strokes of a sketch are drawn: options of `diff3ds render` and `export`."""

from dataclasses import dataclass

from diff3ds._settings import check_level


@dataclass(frozen=True)
class DetailOptions:
    """The strokes that say most.

    Attributes:
        detail: from 0 (one stroke) to 1 (all): the most important strokes alone, of which there are the more the
            higher it is.
        strokes: so many strokes at most, the most important ones.
    """

    detail: float = 1.0
    strokes: int | None = None

    def __post_init__(self) -> None:
        check_level(self.detail, self.strokes)


# All strokes.
WHOLE = DetailOptions()
