"""Options of `diff3ds mesh`."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from tyro.conf import arg

from diff3ds._settings import MAX_SIZE, check_level
from diff3ds.tasks.hatch_options import HatchOptions
from diff3ds.tasks.render.page_options import NO_PAGE, PageOptions, PenOptions
from diff3ds.tasks.render.render_options import ALL_AROUND, MOST_FRAMES, LayerBy, OrbitOptions

# A smooth thing's strokes where nobody says how many.
SMOOTH_STROKES = 24


@dataclass(frozen=True)
class MeshOptions(PenOptions):
    """Options of `diff3ds mesh`.

    Attributes:
        view: of the drawings.
        up: the axis that points up in the file; the sketch has z up. GLB files say it.
        angle: faces of a mesh that meet at more than so many degrees make a crease: by default 38, and none where most
            creases would be scraps, as on an animal.
        strokes: so many strokes at most, those that show most from all sides. By default all creases and borders; of
            a thing most of whose outlines are smooth, up to 24 fitted to its outlines as well.
        detail: from 0 (one stroke) to 1 (all): the most important strokes alone, of which there are the more the
            higher it is.
        rounded: whether a rounded edge of a bumpy, rounded or scanned mesh is one line, where its sides would meet, or
            the two tangent lines at which it begins; a solid has its own.
        tangent: what becomes of lines between faces that go on smoothly in each other, a solid's edges and tangent
            lines of a mesh: drawn, thin (half as wide as other lines) or hidden.
        contours: draw the outlines of smooth parts, which are others from each side (--no-contours: leave them out).
        hidden: what becomes of hidden lines in the drawings: drop, faint, dashed or show.
        tone: whether the drawings are hatched.
        page: that each drawing lies on, as SVG and PNG, and all of them in preview.png and sketch.svg; the turntable
            stays a film for screens, of which --fit says how it is fitted.
        color: draw each stroke in the colour of the surface along it: of vertices, faces, materials or textures.
        layers: of the drawings' SVG files, by thing (the parts of an assembly), kind, visibility or color, several
            within each other; by default one a kind, of parts of assemblies each.
        size: of the drawings, pixels.
        turntable: frames of turntable.webp, once round; 0 leaves it out.
        overwrite: the folder's run may be lost.
    """

    view: OrbitOptions = field(default_factory=lambda: OrbitOptions(azimuth=ALL_AROUND))
    up: Literal["z", "y"] = "z"
    angle: float | None = None
    strokes: int | None = None
    detail: float = 1.0
    rounded: Literal["edge", "tangents"] = "edge"
    tangent: Literal["drawn", "thin", "hidden"] = "thin"
    contours: Annotated[bool, arg(help_behavior_hint="(default: they are drawn)")] = True
    hidden: Literal["drop", "faint", "dashed", "show"] = "drop"
    tone: HatchOptions = field(default_factory=HatchOptions)
    page: PageOptions = NO_PAGE
    color: bool = False
    layers: tuple[LayerBy, ...] = ()
    size: int = 512
    turntable: int = 24
    overwrite: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_on(self.page)
        self.page.check_pixels()
        if self.angle is not None and not 0 < self.angle < 180:
            raise ValueError(f"angle must be between 0 and 180 degrees, got {self.angle:g}")
        check_level(self.detail, self.strokes)
        if not 1 <= self.size <= MAX_SIZE:
            raise ValueError(f"size must be from 1 to {MAX_SIZE} pixels, got {self.size}")
        if self.turntable != 0 and not 2 <= self.turntable <= MOST_FRAMES:
            raise ValueError(f"turntable must be 0, or from 2 to {MOST_FRAMES} frames, got {self.turntable}")
