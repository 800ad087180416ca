"""What the fit of one set of pictures needs, and what it hands over at its end."""

from dataclasses import dataclass
from typing import Any

from diff3ds._shapes import Tensor
from diff3ds.optimize.config import FitConfig
from diff3ds.optimize.fit import Objective
from diff3ds.photogrammetry.lens_change import UNCHANGED, LensChange
from diff3ds.pictures.content.clean_plates import CleanPlates
from diff3ds.pictures.dataset import PosedPictures
from diff3ds.pictures.frame import Frame
from diff3ds.pictures.pyramid import Pyramid
from diff3ds.sketch import Sketch


@dataclass(frozen=True, eq=False)
class Plan:
    """All that the fit of one set of pictures needs, in its frame.

    `background` lies behind the pictures' alpha, where that is not their own.
    """

    pictures: PosedPictures
    frame: Frame
    start: Sketch
    objective: Objective
    pyramid: Pyramid
    config: FitConfig
    background: Tensor | CleanPlates | None = None


@dataclass(frozen=True, eq=False)
class Fitted:
    """The end of a fit.

    Attributes:
        sketch: in the world of the cameras.
        pictures: that it shows: those with refined cameras alone, where cameras are refined.
        chosen: what was found out or filled in, for run.json.
        losses: of every step.
        scores: of the sketch.
        stopped: whether Ctrl-C came before the end.
        refined: which pictures of the project have refined cameras that agree.
        lens: how these have changed the lenses.
    """

    sketch: Sketch
    pictures: PosedPictures
    chosen: dict[str, Any]
    losses: list[float]
    scores: dict[str, float]
    stopped: bool
    refined: tuple[int, ...] = ()
    lens: LensChange = UNCHANGED
