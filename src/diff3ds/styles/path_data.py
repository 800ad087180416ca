"""SVG path data to outlines, by the grammar of SVG 1.1, strictly: what does not fit is an error."""

import math
import re
from collections.abc import Iterator
from typing import Any

MOST_COMMANDS = 20_000
# Coordinates beyond are taken for a mistake: float32 has no thousandths there.
LARGEST = 1e4
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_FLAG = re.compile(r"[01]")
_GAP = re.compile(r"[\s,]*")
# How many numbers each command takes.
_TAKES = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
# Of an arc, the places of numbers that are one digit each and may stand without a gap.
_FLAGS = (3, 4)


def number(text: str) -> float:
    """A number of an attribute, with or without "px".

    Raises:
        ValueError: not one, or one that is too large.
    """
    text = text.strip().removesuffix("px")
    if not _NUMBER.fullmatch(text) or abs(float(text)) > LARGEST:
        raise ValueError(f"expected a number of at most {LARGEST:g}, got {text[:40]!r}")
    return float(text)


def numbers(text: str) -> list[float]:
    """The numbers of a list with gaps or commas between them."""
    return [number(part) for part in re.split(r"[\s,]+", text.strip()) if part]


def add_path_data(path: Any, data: str) -> int:
    """Adds the subpaths of path data, closed, to a path of pathops.

    Returns:
        How many commands there were.

    Raises:
        ValueError: data that is none; more commands or larger coordinates than a brush has.
    """
    pen, count = _Pen(path), 0
    for command, values in _commands(data):
        count += 1
        if count > MOST_COMMANDS:
            raise ValueError(f"it has more than {MOST_COMMANDS} path commands: simplify it")
        pen.draw(command, values)
    pen.close()
    return count


def _commands(data: str) -> Iterator[tuple[str, list[float]]]:
    """Commands with their numbers; a letter may stand for several, after M for lines."""
    place, letter = _GAP.match(data).end(), ""  # type: ignore[union-attr]
    if data.strip() and data[place] not in "Mm":
        raise ValueError(f"path data begins with M, got {data[place : place + 20]!r}")
    while place < len(data):
        repeated = not data[place].isalpha()
        if not repeated:
            letter, place = data[place], place + 1
        if letter.upper() not in _TAKES or (repeated and letter in "Zz"):
            raise ValueError(f"cannot read path data at {data[max(place - 1, 0) : place + 20]!r}")
        values = []
        for k in range(_TAKES[letter.upper()]):
            place = _GAP.match(data, place).end()  # type: ignore[union-attr]
            found = (_FLAG if letter in "Aa" and k in _FLAGS else _NUMBER).match(data, place)
            if not found:
                raise ValueError(f"cannot read path data at {data[place : place + 20]!r}: a number of {letter!r} lacks")
            values.append(number(found[0]))
            place = found.end()
        yield letter, values
        letter = {"M": "L", "m": "l"}.get(letter, letter)
        place = _GAP.match(data, place).end()  # type: ignore[union-attr]


class _Pen:
    """Where path data is, and what it last did."""

    def __init__(self, path: Any) -> None:
        self.path = path
        self.at = self.first = self.handle = (0.0, 0.0)
        self.last = ""
        self.open = False

    def draw(self, command: str, values: list[float]) -> None:
        """Follows one command."""
        kind = command.upper()
        x, y = self.at if command.islower() else (0.0, 0.0)
        if kind == "Z":
            self.close()
            self.at, self.last = self.first, kind
            return
        if kind == "H":
            values = [values[0] + x, self.at[1]]
        elif kind == "V":
            values = [self.at[0], values[0] + y]
        elif kind == "A":
            values[5:] = [values[5] + x, values[6] + y]
        else:
            values = [v + (y if k % 2 else x) for k, v in enumerate(values)]
        if any(abs(v) > LARGEST for v in values):
            raise ValueError(f"it has coordinates beyond {LARGEST:g}: make it smaller")
        self.to(kind, values)
        self.at, self.last = (values[-2], values[-1]), kind

    def to(self, kind: str, values: list[float]) -> None:
        """Draws to absolute coordinates."""
        end = (values[-2], values[-1])
        if kind == "M":
            self.close()
            self.first = end
            return
        if not self.open:
            self.path.moveTo(*self.first)
            self.open = True
        if kind in "LHV":
            self.path.lineTo(*end)
        elif kind in "CS":
            start = self.mirrored("CS") if kind == "S" else (values[0], values[1])
            self.handle = (values[-4], values[-3])
            self.path.cubicTo(*start, *self.handle, *end)
        elif kind in "QT":
            self.handle = self.mirrored("QT") if kind == "T" else (values[0], values[1])
            self.path.quadTo(*self.handle, *end)
        elif math.dist(self.at, end) > 0:
            self.arc(values)

    def arc(self, values: list[float]) -> None:
        """An elliptic arc; with a radius of 0, a line."""
        rx, ry, turn, large, sweep, *end = values
        if rx == 0 or ry == 0:
            self.path.lineTo(*end)
            return
        self.path.arcTo(abs(rx), abs(ry), turn, int(large), int(not sweep), *end)

    def mirrored(self, kinds: str) -> tuple[float, float]:
        """The last handle on the other side, after a command of these kinds; else the place itself."""
        if self.last not in tuple(kinds):
            return self.at
        return 2 * self.at[0] - self.handle[0], 2 * self.at[1] - self.handle[1]

    def close(self) -> None:
        """Ends a subpath, which is filled as if it were closed."""
        if self.open:
            self.path.close()
        self.open = False
