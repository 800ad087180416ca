"""Options of `diff3ds views`, and what a fit of one set of pictures needs."""

from dataclasses import dataclass
from typing import Literal

from diff3ds._shapes import Tensor
from diff3ds.optimize.checkpoint import check_seed
from diff3ds.optimize.fit import FitConfig, Objective
from diff3ds.pictures.background import color_or_path
from diff3ds.pictures.clean_plates import Plates
from diff3ds.pictures.dataset import PosedPictures, Target
from diff3ds.pictures.frame import Frame
from diff3ds.pictures.masks import Masks
from diff3ds.pictures.pyramid import Pyramid
from diff3ds.sketch import Sketch

Init = Literal["carve", "random"]


@dataclass(frozen=True)
class ViewsOptions:
    """Options of `diff3ds views`.

    Attributes:
        target: edges (edge maps, line drawings), color, or color-edges (the edges of coloured pictures); edges or color
            is found by itself if not given.
        init: where edges start: carve (curves through 3D points on which the views agree), or random curves.
        strokes: strokes of a coloured sketch, by default as many, from 64 to 1024, as its details need; random curves
            for edges, by default 128.
        steps: gradient steps from random curves or for colour; by default 1200.
        batch: views of such a step; by default 10 for edges, 5 for colour.
        background: what lies behind the object in coloured pictures: white, black or R,G,B, each from 0 to 1; a
            picture, scaled to each view; or a folder with each view without the object, by the file names of the
            pictures. By default alpha says where nothing is, or else the colour that nearly all of the borders have.
        masks: what the black pixels of a mask_path are: ignore leaves them out of the loss and the scores, as
            nerfstudio does; object takes them for background, so that masks cut the object out.
        size: larger pictures are reduced to this many pixels along the longer side.
        seed: of all random draws.
        resume: go on from the checkpoint in the output folder, if there is one.
        overwrite: the run in the output folder may be lost.
    """

    target: Target | None = None
    init: Init = "carve"
    strokes: int | None = None
    steps: int | None = None
    batch: int | None = None
    background: str | None = None
    masks: Masks = "ignore"
    size: int = 512
    seed: int = 0
    resume: bool = False
    overwrite: bool = False

    def __post_init__(self) -> None:
        for name in ("strokes", "steps", "batch", "size"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ValueError(f"{name} must be positive, got {value}")
        check_seed(self.seed)
        if self.background is not None:
            color_or_path(self.background)

    def idle(self, target: Target) -> list[str]:
        """What was given, but changes nothing for pictures of this target: `--steps 500`."""
        if target == "color":
            return ["--init random"] if self.init == "random" else []
        without = ["background", *(["strokes", "steps", "batch"] if self.init == "carve" else [])]
        return [f"--{name} {getattr(self, name)}" for name in without if getattr(self, name) is not None]


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
    background: Tensor | Plates | None = None
