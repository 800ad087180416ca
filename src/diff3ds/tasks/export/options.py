"""Options of `diff3ds export`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from diff3ds._settings import require_finite
from diff3ds._units import Unit


@dataclass(frozen=True)
class ExportOptions:
    """Options of `diff3ds export`.

    Attributes:
        unit: of length that the numbers in the file are in, where the format knows units: by default mm
            in STEP, DXF and 3DM, m in GLB and USD.
        scale: how many of these units a world unit of the sketch becomes.
        up: the axis of the file that points up; sketches have z up. GLB files have y up by themselves.
        beside: a second sketch (a file, or the folder of a run) on an .html page, seen by the same camera.
        surface: a mesh, in the sketch's frame, that hides lines on an .html page: .obj, .stl, .ply, .off or .glb; by
            default the surface.glb of the run, where there is one.
        surface_up: the axis that points up in its file, y or z; a .glb file says it itself.
        dxf_polylines: strokes of a DXF file as polylines, for programs that ignore the weights of splines.
        lines: strokes of a GLB file as lines in place of tubes.
    """

    unit: Unit | None = None
    scale: float = 1.0
    up: Literal["z", "y"] = "z"
    beside: Path | None = None
    surface: Path | None = None
    surface_up: Literal["z", "y"] = "z"
    dxf_polylines: bool = False
    lines: bool = False

    def __post_init__(self) -> None:
        require_finite(self)
        if self.scale <= 0:
            raise ValueError(f"scale must be positive, got {self.scale:g}")
        if self.surface is None and self.surface_up != ExportOptions.surface_up:
            raise ValueError("give a --surface with --surface-up")
