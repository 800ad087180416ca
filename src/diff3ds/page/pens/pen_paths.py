"""Paths of one pen: nothing drawn twice, joined into long ones, in an order of short ways; and what a pen travels."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from diff3ds.page.drawn_paths import DrawnPath
from diff3ds.page.pens.doubled import without_doubled
from diff3ds.page.pens.joined import join_followers, join_tracks
from diff3ds.page.pens.order import in_order
from diff3ds.page.pens.track import Samples, Track
from diff3ds.page.stroke_outlines import Path

# px. Lengths of curves are those of chords so long: less than a ten thousandth off where they bend as on pages.
CHORD = 0.5


class Travel(NamedTuple):
    """What a pen travels.

    Attributes:
        lifts: how often it is lifted.
        drawn: how far it draws, millimetres, or pixels where the page has no size on paper.
        moved: how far it goes in the air from one path to the next, in the same.
    """

    lifts: int
    drawn: float
    moved: float

    def told(self, unit: str, speed: float | None = None) -> str:
        """What is said of it, with how long it takes at a speed in the unit a second."""
        ways = f"{self.drawn:.0f} {unit} drawn, {self.moved:.0f} {unit} in the air"
        if speed is not None:
            minutes, seconds = divmod(round((self.drawn + self.moved) / speed), 60)
            ways += f", {minutes} min {seconds} s at {speed:g} {unit} a second"
        times = "once" if self.lifts == 1 else f"{self.lifts} times"
        return f"the pen is lifted {times}: {ways}"


def pen_paths(paths: Sequence[DrawnPath], pen: float | None = None) -> list[DrawnPath]:
    """Centre lines as one pen draws them.

    What lies on ink that is there already is left out, what meets within the pen's width is joined, loops begin where
    the pen comes from, and the ways in the air are short. All are as wide as the pen.

    Args:
        paths: to stroke, of one colour.
        pen: its width, pixels; by default the width of half of the paths or more.
    """
    if not paths:
        return []
    pen = float(np.median([path.width for path in paths])) if pen is None else pen
    tracks = [track for path in paths for track in _tracks(path)]
    if pen > 0:
        tracks = join_tracks(without_doubled(tracks, pen), pen)
    like = paths[0]._replace(width=pen)
    drawn = []
    # Loops begin where the pen is then.
    for track in join_followers(in_order(tracks, pen or CHORD), pen):
        curve = np.concatenate([track.cubics[:1, 0], track.cubics[:, 1:].reshape(-1, 2)])
        drawn.append(like._replace(strokes=track.strokes, curves=[curve], closed=track.closed))
    return drawn


def _tracks(path: DrawnPath) -> list[Track]:
    closed = path.closed and len(path.curves) == 1
    return [Track(_cubics(curve), closed, path.strokes) for curve in path.curves if len(curve) > 1]


def _cubics(curve: Path) -> np.ndarray:
    """The cubics of a path, each with its start, (K, 4, 2)."""
    return np.stack([curve[k : len(curve) - 3 + k : 3] for k in range(4)], 1)


def travel(groups: Sequence[Sequence[DrawnPath]], scale: float) -> Travel:
    """What pens travel that draw groups of paths in their order, one pen each.

    Args:
        scale: units of length of a pixel.
    """
    tracks = [[track for path in paths for track in _tracks(path)] for paths in groups]
    drawn = sum(float(Samples.of(some, CHORD).length.sum()) for some in tracks if some)
    moved = 0.0
    for some in tracks:
        ends = np.stack([track.ends for track in some]) if some else np.zeros((0, 2, 2))
        moved += float(np.linalg.norm(ends[1:, 0] - ends[:-1, 1], axis=1).sum())
    return Travel(sum(map(len, tracks)), drawn * scale, moved * scale)
