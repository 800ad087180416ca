"""Options of `diff3ds export`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import arg

from diff3ds._settings import require_finite
from diff3ds._units import DxfVersion, Unit, check_tolerance


@dataclass(frozen=True)
class ExportOptions:
    """Options of `diff3ds export`.

    Attributes:
        unit: of length that the numbers in the file are in, where the format knows units: by default mm
            in STEP, DXF and 3DM, m in GLB and USD; in Blender its own unit, or as the scale of its scene says.
        scale: how many of these units a world unit of the sketch becomes.
        up: the axis of the file that points up; sketches have z up. GLB files have y up by themselves.
        built: what strokes are in Blender: curves, one object each with exact weights, or grease-pencil (4.3 or newer),
            one object with a layer a thing and kind.
        beside: a second sketch (a file, or the folder of a run) on an .html page, seen by the same camera.
        surface: a mesh, in the sketch's frame, that hides lines on an .html page or in Blender: .obj, .stl, .ply, .off,
            .glb or .gltf; by default the surface.glb of the run, where there is one.
        surface_up: the axis that points up in its file, y or z; a .glb file says it itself.
        tolerance: how far lines, arcs and polylines in a .step, .dxf or .3dm file may lie off the strokes that they
            stand for, in the unit of the file; by default as well as the sketch's coordinates are known, and 1e-4 of
            its radius for polylines.
        dxf_polylines: strokes of a DXF file as polylines, for programs that ignore the weights of splines.
        dxf_version: of AutoCAD: R12, with polylines, for old cutters that read no other.
        lines: strokes of a GLB file as lines in place of tubes.
        layers: of .step, .dxf, .3dm, .glb, .py and USD files, by thing (and its parts), kind (crease, border, contour,
            ...) or color, several within each other; "lamp - crease" where a format knows no layers within layers. By
            default by color in .step, .dxf and .3dm files, in Blender by thing and kind where the sketch knows them.
    """

    unit: Unit | None = None
    scale: float = 1.0
    up: Literal["z", "y"] = "z"
    built: Annotated[Literal["curves", "grease-pencil"], arg(name="as")] = "curves"
    beside: Path | None = None
    surface: Path | None = None
    surface_up: Literal["z", "y"] = "z"
    tolerance: float | None = None
    dxf_polylines: bool = False
    dxf_version: DxfVersion = "R2010"
    lines: bool = False
    layers: tuple[Literal["thing", "kind", "color"], ...] = ()

    def __post_init__(self) -> None:
        require_finite(self)
        check_tolerance(self.tolerance)
        if self.scale <= 0:
            raise ValueError(f"scale must be positive, got {self.scale:g}")
        if self.surface is None and self.surface_up != ExportOptions.surface_up:
            raise ValueError("give a --surface with --surface-up")
