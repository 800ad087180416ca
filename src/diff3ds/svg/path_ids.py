"""The ids of paths in SVG files, by which they lead back to strokes, and what the root of a file says of these."""

import itertools
from collections import Counter
from collections.abc import Iterable, Sequence

# What paths have of strokes as these have it.
KEPT = ("color", "opacity", "width")


class PathIds:
    """The ids of the paths of one view: "stroke-7", of further ones of a stroke "stroke-7-part-2" and so on.

    Of several strokes together it is "strokes-7-9"; of lines of the view alone "line-1".
    """

    def __init__(self, prefix: str, numbers: Sequence[int] | None = None) -> None:
        """Begins a view.

        Args:
            prefix: of all ids.
            numbers: of the strokes that are drawn, in the sketch that they come from; -1 for lines of the view alone.
        """
        self._prefix, self._numbers = prefix, numbers
        self._count: Counter[str] = Counter()

    def of(self, strokes: Iterable[int]) -> str:
        """The id of the next path, of these of the strokes that are drawn."""
        numbers = list(dict.fromkeys(strokes if self._numbers is None else (self._numbers[s] for s in strokes)))
        own = [number for number in numbers if number >= 0]
        known = f"stroke{'s' if len(own) > 1 else ''}-{'-'.join(map(str, own))}" if own else "line"
        self._count[known] += 1
        count = self._count[known]
        part = f"-part-{count}" if count > 1 else ""
        return f"{self._prefix}{known}{part}" if own else f"{self._prefix}line-{count}"


def said_of_strokes(numbers: Iterable[int], kept: Sequence[str], height: float | None) -> str:
    """Attributes of the root of a file, by which `diff3ds apply` knows what an edit is.

    Args:
        numbers: of the strokes in the file.
        kept: of "color", "opacity" and "width" what paths have as strokes have it.
        height: what the height of the image is in the units of the view box, where widths are shares of it.
    """
    rows = sorted({number for number in numbers if number >= 0})
    runs = [list(run) for _, run in itertools.groupby(enumerate(rows), lambda pair: pair[1] - pair[0])]
    ranges = " ".join(f"{run[0][1]}-{run[-1][1]}" if len(run) > 1 else str(run[0][1]) for run in runs)
    tall = "" if height is None else f' data-height="{height:.9g}"'
    return f'data-strokes="{ranges}" data-keeps="{" ".join(kept)}"{tall}'
