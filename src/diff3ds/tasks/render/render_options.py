"""Options of `diff3ds render`: the views, and the pictures made of them."""

import math
import re
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Literal

from diff3ds._settings import MAX_SIZE, require_finite
from diff3ds._units import DxfVersion
from diff3ds.pictures.picture_options import parse_color
from diff3ds.tasks.hatch_options import HatchOptions
from diff3ds.tasks.render.page_options import MOST_PIXELS, PageOptions, PenOptions

# Each suffix by what it holds: views, or the frames of a turntable; a view's strokes in space.
PLOTTED = (".hpgl", ".plt")
STILLS, VECTORS, MOVIES = (".png", ".svg", ".pdf", ".dxf", *PLOTTED), (".svg", ".pdf"), (".mp4", ".webp", ".gif")
IN_SPACE = (".json", ".py")
MOST_FRAMES = 10_000
# From where meshes are drawn unless one says: cameras of a file stand for these too.
ALL_AROUND = (30.0, 120.0, 210.0, 300.0)
# What makes a layer of strokes in a file.
LayerBy = Literal["thing", "kind", "visibility", "color"]


@dataclass(frozen=True)
class OrbitOptions:
    """From where the sketch is seen: its middle is in the middle of the picture.

    Attributes:
        azimuth: degrees, 0 on +x, counter-clockwise seen from above; several make a view each.
        elevation: degrees above the horizon.
        distance: from the middle, world units; by default the sketch fills the picture.
        fov: vertical field of view, degrees.
        height: world units from the lower edge of the picture to the upper: then the view is orthographic.
        cameras: the views of a transforms.json, or of a folder with one, instead.
    """

    azimuth: tuple[float, ...] = (30.0,)
    elevation: float = 20.0
    distance: float | None = None
    fov: float = 40.0
    height: float | None = None
    cameras: Path | None = None

    def __post_init__(self) -> None:
        require_finite(self)
        if not self.azimuth:
            raise ValueError("azimuth must be one number or several, got none")
        if not -90 <= self.elevation <= 90:
            raise ValueError(f"elevation must be from -90 to 90 degrees, got {self.elevation:g}")
        for name in ("distance", "height"):
            value = getattr(self, name)
            if value is not None and value <= 0:
                raise ValueError(f"{name} must be positive, got {value:g}")
        if not 0 < self.fov < 180:
            raise ValueError(f"fov must be between 0 and 180 degrees, got {self.fov:g}")
        if self.height is not None and self.fov != OrbitOptions.fov:
            raise ValueError("give either --fov or --height: orthographic views have no field of view")
        if self.cameras is not None:
            for field in fields(self):
                if field.name != "cameras" and getattr(self, field.name) not in (field.default, ALL_AROUND):
                    raise ValueError(f"give either --cameras or --{field.name}: the file says where the cameras are")


@dataclass(frozen=True)
class PictureOptions(PenOptions):
    """What is made of the views.

    Attributes:
        size: pixels: 512, or width x height as 1280x720; by default 512, or what --cameras says.
        background: white, black, R,G,B with numbers from 0 to 1, or transparent; by default white, with --centerline
            none: plotters would draw the edge of it.
        turntable: so many frames, once round the sketch, as MP4, WebP or GIF, or in Blender.
        fps: frames a second of a turntable.
        sheet: all views in one picture; otherwise each has a file of its own, numbered where there are several.
        layers: of SVG, PDF, DXF, HPGL and PY files, by thing (and its parts), kind (crease, border, contour, ...),
            visibility or color, several within each other; strokes of different layers lie over each other as the
            layers do.
        dxf_polylines: strokes of a DXF file as polylines, for programs that ignore the weights of splines.
        dxf_version: of AutoCAD: R12, with polylines, for old cutters that read no other.
        tolerance: of SVG and PDF: how far paths may be off the strokes, pixels; by default
            .05. More makes smaller files.
        engine: kernels, which draw the strokes as everywhere here, or blender: the Blender of this machine renders them
            as tubes in daylight.
    """

    size: str | None = None
    background: str | None = None
    turntable: int | None = None
    fps: int = 24
    sheet: bool = False
    layers: tuple[LayerBy, ...] = ()
    dxf_polylines: bool = False
    dxf_version: DxfVersion = "R2010"
    tolerance: float | None = None
    engine: Literal["kernels", "blender"] = "kernels"

    def __post_init__(self) -> None:
        if self.size is not None:
            parse_size(self.size)
        if self.background not in (None, "transparent"):
            parse_color(self.background)
        if self.turntable is not None and not 2 <= self.turntable <= MOST_FRAMES:
            raise ValueError(f"turntable must be from 2 to {MOST_FRAMES} frames, got {self.turntable}")
        super().__post_init__()
        if self.tolerance is not None and self.tolerance <= 0:
            raise ValueError(f"tolerance must be positive, got {self.tolerance:g}")
        if not 1 <= self.fps <= 100:
            raise ValueError(f"fps must be from 1 to 100, got {self.fps}")
        if self.turntable is not None and self.sheet:
            raise ValueError("give either --turntable or --sheet")

    @property
    def color(self) -> tuple[float, float, float] | None:
        """RGB of the background, None for a transparent one."""
        if self.background is None:
            return None if self.centerline else parse_color("white")
        return None if self.background == "transparent" else parse_color(self.background)


@dataclass(frozen=True)
class SurfaceOptions:
    """What hides lines, and is hatched.

    Attributes:
        surface: a mesh, in the sketch's frame, that hides what lies behind it: .obj, .stl, .ply, .off, .glb or .gltf;
            with --hidden or --hatch the surface.glb of the run by default.
        surface_up: the axis that points up in its file, y or z; a .glb file says it itself.
        hidden: what becomes of hidden lines: drop (the default with a surface), faint (a quarter of the opacity),
            dashed, or show.
        contours: the outlines of the mesh's smooth parts, which depend on the view, are drawn as well.
        tone: whether it is hatched.
    """

    surface: Path | None = None
    surface_up: Literal["z", "y"] = "z"
    hidden: Literal["drop", "faint", "dashed", "show"] | None = None
    contours: bool = True
    tone: HatchOptions = field(default_factory=HatchOptions)

    def __post_init__(self) -> None:
        if self.surface is None and self.surface_up != SurfaceOptions.surface_up:
            raise ValueError("give a --surface with --surface-up")
        if not self.hides and not self.contours:
            raise ValueError("give a --surface, or --hidden or --hatch for that of a run, with --no-contours")

    @property
    def hides(self) -> bool:
        """Whether there is a surface: a file that is named, or that of the run."""
        return self.surface is not None or self.hidden is not None or self.tone.hatch is not None


def parse_size(text: str) -> tuple[int, int]:
    """(height, width) of `512`, or of `1280x720`, which is width x height.

    Raises:
        ValueError: it is neither.
    """
    found = re.fullmatch(r"(\d{1,6})(?:[xX×](\d{1,6}))?", text)
    width, height = (int(found[1]), int(found[2] or found[1])) if found else (0, 0)
    if not (0 < width <= MAX_SIZE and 0 < height <= MAX_SIZE and width * height <= MOST_PIXELS):
        side = math.isqrt(MOST_PIXELS)
        raise ValueError(f"size must be a number of pixels or WIDTHxHEIGHT, up to {side}x{side}, got {text!r}")
    return height, width


def check_file(file: Path, options: PictureOptions, page: PageOptions) -> None:
    """Sees that a file of this name can hold what is asked for.

    Args:
        file: that is written.
        options: of its pictures.
        page: that they lie on.

    Raises:
        ValueError: it cannot.
    """
    suffix = file.suffix.lower()
    if suffix not in (*STILLS, *MOVIES, *IN_SPACE):
        # The formats load torch, without which options are told.
        from diff3ds.formats.opening import instead_of

        written = ", ".join((*STILLS, *MOVIES, *IN_SPACE))
        raise ValueError(f"{file}: cannot draw to {suffix!r}, only to {written}{instead_of(suffix)}")
    if options.engine == "blender" and (suffix not in (".png", ".mp4") or options.background not in (None, "white")):
        raise ValueError(f"{file}: Blender draws .png files and .mp4 turntables here, over white: leave --engine out")
    paths = (*VECTORS, *PLOTTED)
    known = {"centerline": paths, "tolerance": paths, "layers": (*paths, ".dxf", ".py")}
    for name, suffixes in (known | dict.fromkeys(("dxf_polylines", "dxf_version"), (".dxf",))).items():
        if getattr(options, name) != getattr(PictureOptions, name) and suffix not in suffixes:
            *most, last = suffixes
            named = f"{', '.join(most)} and {last}" if most else last
            raise ValueError(f"{file}: --{name.replace('_', '-')} is for {named} files")
    if page.dpi is not None and suffix not in (".png", *MOVIES):
        raise ValueError(f"{file}: --dpi is for {', '.join(('.png', *MOVIES))} files; others have no pixels")
    if suffix in (".png", *MOVIES):
        page.check_pixels()
    if page.page is None and page.fit is not None and suffix not in MOVIES:
        raise ValueError(f"{file}: --fit is for pages and turntables: give a --page too, such as A4")
    if suffix in PLOTTED and page.page is None:
        raise ValueError(f"{file}: a plotter draws on paper: give a --page, such as A4")
    if suffix not in PLOTTED:
        options.check_on(page)
    if page.page is not None and options.engine == "blender":
        raise ValueError(f"{file}: Blender draws pictures without a --page: leave it or --engine out")
    if suffix in MOVIES and options.turntable is None:
        raise ValueError(f"{file}: a {suffix} file holds a turntable: give --turntable 120, or a .png or .svg file")
    if suffix in (*STILLS, ".json") and options.turntable is not None:
        raise ValueError(f"{file}: a turntable goes to {', '.join((*MOVIES, '.py'))}, not to {suffix}")
    if suffix in IN_SPACE and (page.page is not None or options.background is not None or options.sheet):
        raise ValueError(f"{file}: strokes in space have no page: leave --page, --background and --sheet out")
    if suffix in (".mp4", ".gif") and options.color is None:
        raise ValueError(f"{file}: {suffix} has no partly transparent pixels: give a --background, or a .webp file")
    if suffix == ".gif" and options.fps > 50:
        raise ValueError(f"{file}: fps must be at most 50 in a .gif file, which viewers show slower, got {options.fps}")
    if suffix == ".mp4" and options.size is not None and any(side % 2 for side in parse_size(options.size)):
        raise ValueError(f"{file}: size must be even both ways in an .mp4 file, got {options.size}")
