"""Scripts for Blender: strokes as exact NURBS curves or Grease Pencil, what hides them, camera, light and a turn."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, get_args

import torch

from diff3ds._files import write_text
from diff3ds._shapes import Tensor
from diff3ds._units import MILLIMETRES, Unit, check_unit
from diff3ds._version import __version__
from diff3ds.bezier import to_nurbs
from diff3ds.bezier.curves import from_homogeneous
from diff3ds.camera import Cameras
from diff3ds.chains import Chains
from diff3ds.formats.cad.layers import flat_layers, known_layers
from diff3ds.formats.framing import FILLED, FOV, ball_of, framed
from diff3ds.formats.scenes.html import PageSurface
from diff3ds.formats.scenes.smooth_pieces import Pieces, polynomial_pieces, rational_pieces
from diff3ds.sketch import Sketch

Strokes = Literal["curves", "grease-pencil"]
Layers = Sequence[tuple[str, ...]]

# Of the turntable that the script makes.
FRAMES = 120
# The view of the script's camera, degrees.
AZIMUTH, ELEVATION = 30.0, 20.0
# Of the radius of the sketch: by how much polynomial cubics may be off the strokes, and chords off curves. Both
# together are less than a thousandth.
CURVES, CHORDS = 2e-4, 5e-4


def save_blender(
    path: str | Path,
    sketch: Sketch,
    *,
    strokes: Strokes = "curves",
    unit: Unit | None = None,
    layers: Layers | None = None,
    surface: PageSurface | None = None,
) -> None:
    """Writes a Python script that builds the sketch in Blender (3.6 or newer), whole or not at all.

    `blender --python scene.py` opens it; `blender -b --python scene.py -- picture.png` renders one picture, and
    `... -- turn.mp4 --turntable` a turn of 120 frames. As curves each stroke is an object that has the stroke's name,
    or "stroke 0" and so on: one NURBS spline of order 4 with the stroke's control points and weights in the float32
    that Blender keeps, its widths as radii within a hundredth. In Grease Pencil (4.3 or newer) all strokes are one
    object; they are Bézier strokes within a thousandth of the sketch's radius, with radii and opacities, cyclic where
    they are closed. All lies in a collection "sketch" of the open scene. What else there is stays as it is: camera,
    light and world are made where there are none, and only the scene that Blender begins with gives way.

    Args:
        path: the file.
        sketch: what is built.
        strokes: "curves" or "grease-pencil".
        unit: what a world unit is, in Blender's metres by the scale of the open scene; None makes it a Blender unit.
        layers: of each stroke the names of the collections within each other that it lies in, or of its Grease Pencil
            layer; by default things, parts and kinds where the sketch knows them, else colours.
        surface: what hides lines, as a mesh of the colour of the world.

    Raises:
        ValueError: values that have become invalid since the sketch was made; other strokes or units.
        OSError: the file cannot be written.
    """
    sketch.check_values()
    cameras = framed(sketch, AZIMUTH, ELEVATION)
    text = blender_script(sketch, cameras, strokes=strokes, unit=unit, layers=layers, surface=surface)
    write_text(Path(path), text)


def blender_script(
    sketch: Sketch,
    cameras: Cameras,
    fov: float = FOV,
    frames: int = FRAMES,
    fps: int = 24,
    *,
    strokes: Strokes = "curves",
    unit: Unit | None = None,
    layers: Layers | None = None,
    surface: PageSurface | None = None,
    views: Sequence[tuple[Sketch, Layers]] | None = None,
) -> str:
    """The script, whose camera stands where the first of these does and looks at the sketch's middle.

    Args:
        sketch: what is built.
        cameras: from where it is seen.
        fov: the camera's vertical field of view, degrees.
        frames: of a turn.
        fps: frames a second.
        strokes: as the rest, of `save_blender`.
        unit: as there.
        layers: as there.
        surface: as there.
        views: of Grease Pencil what each frame of the turn shows in place of the sketch, and its layers.

    Raises:
        ValueError: other strokes or units; frames that are curves.
    """
    if strokes not in get_args(Strokes):
        raise ValueError(f"strokes must be {' or '.join(map(repr, get_args(Strokes)))}, got {strokes!r}")
    if unit is not None:
        check_unit(unit)
    if views is not None and strokes == "curves":
        raise ValueError("each frame has other strokes only in Grease Pencil: give strokes='grease-pencil'")
    middle, radius = ball_of(sketch)
    wide = 1.0 if sketch.width_space == "world" else 2 * radius / FILLED
    given = known_layers(sketch) if layers is None else layers
    scene: dict[str, Any] = {"middle": middle.tolist(), "radius": radius, "eye": cameras.centers[0].tolist()}
    scene |= {"fov": fov, "frames": frames, "fps": fps, "turns": views is not None}
    scene["metres"] = None if unit is None else MILLIMETRES[unit] / 1000
    if strokes == "curves":
        scene["strokes"] = _curves(sketch, given, wide, radius)
    else:
        scene["layers"] = _pencil_layers([(sketch, given)] if views is None else views, wide, radius)
    if surface is not None:
        corners = surface.mesh.vertices
        scene["surface"] = {"corners": _short(torch.as_tensor(corners)), "faces": surface.mesh.faces.tolist()}
    script = Path(__file__).with_name("in_blender.py").read_text(encoding="utf-8")
    # What the file says of itself is said to those who write the package.
    script = script.replace("@VERSION@", __version__)
    return script.replace("@SCENE@", json.dumps(scene, separators=(",", ":")))


def _curves(sketch: Sketch, layers: Layers, wide: float, radius: float) -> list[dict[str, Any]]:
    """Each stroke as a NURBS curve of order 4."""
    pieces, first = _by_stroke(sketch, rational_pieces(_cubics(sketch), wide))
    steps = pieces.steps(CHORDS * radius)
    strokes = []
    for n, look in enumerate(_looks(sketch)):
        rows = slice(first[n], first[n + 1])
        points, weights, _ = to_nurbs(*from_homogeneous(pieces.control[rows]))
        radii = pieces.radii[rows]
        strokes.append(
            {
                "name": sketch.names[n] if sketch.names and sketch.names[n] else f"stroke {n}",
                "layers": layers[n],
                "points": torch.cat([points, weights[:, None]], 1).tolist(),
                "radii": _short(torch.cat([radii[:1, 0], radii[:, 1:].flatten()])),
                "steps": int(steps[rows].max()),
                "color": look,
            }
        )
    return strokes


def _pencil_layers(views: Sequence[tuple[Sketch, Layers]], wide: float, radius: float) -> list[dict[str, Any]]:
    """The layers of Grease Pencil, each with the strokes of each frame, none where a frame has none on it."""
    found: dict[str, list[list[dict[str, Any]]]] = {}
    for frame, (sketch, layers) in enumerate(views):
        strokes = _pencil_strokes(sketch, wide, radius)
        for name, stroke in zip(flat_layers(layers) or (), strokes, strict=True):
            found.setdefault(name, [[] for _ in views])[frame].append(stroke)
    return [{"name": name, "frames": frames} for name, frames in found.items()]


def _pencil_strokes(sketch: Sketch, wide: float, radius: float) -> list[dict[str, Any]]:
    """Each stroke as Bézier curves: (handle before, point, handle after) of each point, and radii there."""
    if not len(sketch):
        return []
    pieces, first = _by_stroke(sketch, polynomial_pieces(_cubics(sketch), wide, CURVES * radius))
    steps = pieces.steps(CHORDS * radius)
    closed = [False] * len(sketch) if sketch.chains is None else sketch.chains.closed.tolist()
    strokes = []
    for n, look in enumerate(_looks(sketch)):
        rows = slice(first[n], first[n + 1])
        points, radii = pieces.control[rows, :, :3], pieces.radii[rows]
        ends = points[-1, 2] if closed[n] else 2 * points[0, 0] - points[0, 1]
        before = torch.cat([ends[None], points[:, 2]])
        after = torch.cat([points[:, 1], 2 * points[-1:, 3] - points[-1:, 2]])
        knots = torch.stack([before, torch.cat([points[:, 0], points[-1:, 3]]), after], 1)
        along = torch.cat([radii[:, 0], radii[-1:, 1]])
        count = len(knots) - closed[n]
        stroke = {"points": _short(knots[:count]), "radii": _short(along[:count])}
        strokes.append(stroke | {"steps": int(steps[rows].max()), "cyclic": closed[n], "color": look})
    return strokes


def _cubics(sketch: Sketch) -> Sketch:
    return sketch.detach().to("cpu").to(torch.float64).elevate(3).with_widths_along()


def _by_stroke(sketch: Sketch, pieces: Pieces) -> tuple[Pieces, list[int]]:
    """The pieces, and where those of each stroke begin."""
    chains = sketch.chains or Chains.plain(len(sketch))
    counts = torch.bincount(chains.stroke.cpu()[pieces.segment], minlength=len(sketch))
    return pieces, [0, *counts.cumsum(0).tolist()]


def _looks(sketch: Sketch) -> list[list[float]]:
    """Straight sRGB and opacity of each stroke."""
    return torch.cat([sketch.color.detach().clamp(0, 1), sketch.opacity.detach()[:, None]], 1).tolist()


def _short(values: Tensor) -> Any:
    """Numbers with the digits that Blender's float32 keeps."""
    if values.ndim > 1:
        return [_short(row) for row in values]
    return [float(f"{value:.9g}") for value in values.tolist()]
