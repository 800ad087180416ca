"""SVG path data to outlines, by the grammar of SVG 1.1, strictly: what does not fit is an error."""

import math
import re
from collections.abc import Iterator
from typing import Any

# Coordinates beyond are taken for a mistake: float32 has no tenths there.
LARGEST = 1e6
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_FLAG = re.compile(r"[01]")
_GAP = re.compile(r"[\s,]*")
# How many numbers each command takes.
_TAKES = {"M": 2, "L": 2, "H": 1, "V": 1, "C": 6, "S": 4, "Q": 4, "T": 2, "A": 7, "Z": 0}
# Of an arc, the places of numbers that are one digit each and may stand without a gap.
_FLAGS = (3, 4)


def number(text: str, largest: float = LARGEST) -> float:
    """A number of an attribute, with or without "px".

    Raises:
        ValueError: not one, or one that is too large.
    """
    text = text.strip().removesuffix("px")
    if not _NUMBER.fullmatch(text) or abs(float(text)) > largest:
        raise ValueError(f"expected a number of at most {largest:g}, got {text[:40]!r}")
    return float(text)


def numbers(text: str) -> list[float]:
    """The numbers of a list with gaps or commas between them."""
    return [number(part) for part in re.split(r"[\s,]+", text.strip()) if part]


def add_path_data(path: Any, data: str, most: int, largest: float = LARGEST, *, filled: bool = False) -> int:
    """Draws path data on what has the methods of a path of pathops (moveTo, lineTo, quadTo, cubicTo, arcTo, close).

    Args:
        most: commands.
        largest: coordinate.
        filled: closes open subpaths too.

    Returns:
        How many commands there were.

    Raises:
        ValueError: data that is none; more commands or larger coordinates than that.
    """
    pen, count = _Pen(path, largest, filled), 0
    for command, values in _commands(data, largest):
        count += 1
        if count > most:
            raise ValueError(f"it has more than {most} path commands: simplify it")
        pen.draw(command, values)
    pen.end(filled)
    return count


def _commands(data: str, largest: float) -> Iterator[tuple[str, list[float]]]:
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
            values.append(number(found[0], largest))
            place = found.end()
        yield letter, values
        letter = {"M": "L", "m": "l"}.get(letter, letter)
        place = _GAP.match(data, place).end()  # type: ignore[union-attr]


class _Pen:
    """Where path data is, and what it last did."""

    def __init__(self, path: Any, largest: float, filled: bool) -> None:
        self.path = path
        self.largest = largest
        self.filled = filled
        self.at = self.first = self.handle = (0.0, 0.0)
        self.last = ""
        self.open = False

    def draw(self, command: str, values: list[float]) -> None:
        """Follows one command."""
        kind = command.upper()
        x, y = self.at if command.islower() else (0.0, 0.0)
        if kind == "Z":
            self.end(True)
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
        if any(abs(v) > self.largest for v in values):
            raise ValueError(f"it has coordinates beyond {self.largest:g}: make it smaller")
        self.to(kind, values)
        self.at, self.last = (values[-2], values[-1]), kind

    def to(self, kind: str, values: list[float]) -> None:
        """Draws to absolute coordinates."""
        end = (values[-2], values[-1])
        if kind == "M":
            self.end(self.filled)
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

    def end(self, closed: bool) -> None:
        """Ends a subpath."""
        if self.open and closed:
            self.path.close()
        self.open = False
