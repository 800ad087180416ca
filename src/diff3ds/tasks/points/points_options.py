"""Options of `diff3ds points`."""

from dataclasses import dataclass, field
from typing import Literal

from diff3ds._settings import MAX_SIZE, check_level
from diff3ds.tasks.render.page_options import NO_PAGE, PageOptions
from diff3ds.tasks.render.render_options import OrbitOptions


@dataclass(frozen=True)
class PointsOptions:
    """Options of `diff3ds points`.

    Attributes:
        view: of the preview.
        up: the axis that points up in the file; the sketch has z up.
        rounded: whether a rounded edge is one line, where its sides would meet, or the two tangent lines at which it
            begins.
        tangent: what becomes of tangent lines: drawn, thin (half as wide as other lines) or hidden.
        strokes: so many strokes at most, the most important ones; by default all.
        detail: from 0 (one stroke) to 1 (all): the most important strokes alone, of which there are the more the
            higher it is.
        seed: of what is drawn by chance.
        size: of a view of the preview, pixels.
        page: that the views of sketch.svg and preview.png lie on.
        overwrite: the folder's run may be lost.
    """

    view: OrbitOptions = field(default_factory=lambda: OrbitOptions(azimuth=(30.0, 120.0, 210.0, 300.0)))
    up: Literal["z", "y"] = "z"
    rounded: Literal["edge", "tangents"] = "edge"
    tangent: Literal["drawn", "thin", "hidden"] = "thin"
    strokes: int | None = None
    detail: float = 1.0
    seed: int = 0
    size: int = 512
    page: PageOptions = NO_PAGE
    overwrite: bool = False

    def __post_init__(self) -> None:
        self.page.check_previews()
        if not 1 <= self.size <= MAX_SIZE:
            raise ValueError(f"size must be from 1 to {MAX_SIZE} pixels, got {self.size}")
        check_level(self.detail, self.strokes)
        if self.seed < 0:
            raise ValueError(f"seed must not be negative, got {self.seed}")
