"""What of a sketch can be saved from the studio: the formats, what each is for, and the file of one."""

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

from diff3ds.tasks.detail_options import DetailOptions
from diff3ds.tasks.export.export import run_export
from diff3ds.tasks.export.export_options import ExportOptions
from diff3ds.tasks.hatch_options import HatchOptions
from diff3ds.tasks.render.render_options import OrbitOptions, PictureOptions, SurfaceOptions
from diff3ds.tasks.render.render_views import run_render
from diff3ds.tasks.results import SURFACE
from diff3ds.tasks.style_options import OF_BRUSHES, StyleName, StyleOptions

# Without those that need a brush.
STYLES = tuple(name for name in get_args(StyleName) if name not in OF_BRUSHES)
# How surfaces are made darker.
HATCHES = ("light", "depth")
# Pixels of a picture, and of one by which a sketch is known.
SIZE, SMALL = 1024, 320


@dataclass(frozen=True)
class Format:
    """A format.

    Attributes:
        name: for people.
        suffix: of its files.
        purpose: what it is for.
        drawn: whether it is a drawing, of one view, or else the lines in space.
        centerline: for pens that follow each line once.
    """

    name: str
    suffix: str
    purpose: str
    drawn: bool = False
    centerline: bool = False


FORMATS = {
    "svg": Format("SVG", ".svg", "a drawing for Inkscape, Illustrator and web pages", True),
    "png": Format("PNG", ".png", "a picture for everything", True),
    "pdf": Format("PDF", ".pdf", "a drawing to print", True),
    "plotter": Format("SVG for plotters", ".svg", "each line once, for pens and cutters", True, True),
    "html": Format("Web page", ".html", "a page to turn it in any browser, without this program"),
    "step": Format("STEP", ".step", "exact curves for CAD programs"),
    "dxf": Format("DXF", ".dxf", "exact curves for CAD programs and cutters"),
    "3dm": Format("3DM", ".3dm", "exact curves for Rhino"),
    "usd": Format("USD", ".usda", "curves for film and game programs"),
    "glb": Format("GLB", ".glb", "solid wires for 3D viewers, slides and phones"),
    "obj": Format("OBJ", ".obj", "lines for any 3D program"),
    "ply": Format("PLY", ".ply", "solid wires for slicers and 3D printing"),
    "blender": Format("Blender", ".py", "a script that builds it in Blender"),
    "json": Format("sketch.json", ".json", "everything, to open it here again"),
}  # fmt: skip


def made(folder: Path, title: str, name: str, question: dict[str, str], size: int = SIZE) -> tuple[str, bytes]:
    """The name and the content of a file in one of these formats.

    Args:
        folder: of the run.
        title: of the file.
        name: of the format.
        question: of a drawing: `azimuth` and `elevation`, degrees; `hidden`, `style`, `hatch` and `detail`, as options
            have them; `paper`, if it is on one with fibres, which styles have.
        size: of a drawing, pixels.

    Raises:
        ValueError, OSError, ImportError: no such format; as `run_render` and `run_export`.
    """
    if name not in FORMATS:
        raise ValueError(f"{name!r} is no format: there are {', '.join(FORMATS)}")
    wanted = FORMATS[name]
    try:
        detail = float(question.get("detail", 1))
        azimuth, elevation = float(question.get("azimuth", 30)), float(question.get("elevation", 20))
    except ValueError as error:
        raise ValueError("detail, azimuth and elevation are numbers") from error
    level = DetailOptions(detail=detail)
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / f"{title}{wanted.suffix}"
        if not wanted.drawn:
            run_export(folder, file, ExportOptions(), StyleOptions(), level=level)
            return file.name, file.read_bytes()
        view = OrbitOptions((azimuth % 360,), max(-90.0, min(90.0, elevation)))
        hides = (folder / SURFACE).is_file() and not wanted.centerline
        hidden, hatch = (question.get(key) or None if hides else None for key in ("hidden", "hatch"))
        if hidden not in (None, "drop", "faint", "dashed", "show"):
            raise ValueError(f"hidden lines are drop, faint, dashed or show, not {hidden!r}")
        style = None if wanted.centerline else question.get("style") or None
        if style not in (None, *STYLES):
            raise ValueError(f"a style is one of {', '.join(STYLES)}, not {style!r}")
        if hatch not in (None, *HATCHES):
            raise ValueError(f"hatching is by {' or '.join(HATCHES)}, not {hatch!r}")
        paper = style is not None and question.get("paper") == "true"
        options = (
            view,
            PictureOptions(size=str(size), centerline=wanted.centerline),
            SurfaceOptions(hidden=hidden, tone=HatchOptions(hatch)),  # type: ignore[arg-type] # one of these
            StyleOptions(style=style, paper=paper),  # type: ignore[arg-type] # one of these
        )
        (written, *_) = run_render(folder, file, *options, lambda _: None, level)
        return file.name, written.read_bytes()
