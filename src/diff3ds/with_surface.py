"""`ds.render` and `ds.save`: those of `render` and `formats`, which also take a surface that hides lines."""

from pathlib import Path

from diff3ds import formats
from diff3ds._units import Unit
from diff3ds.camera import Cameras
from diff3ds.render import Antialiasing, Backend, Rendering
from diff3ds.render import render as render_sketch
from diff3ds.render.checks import Background, check_scene
from diff3ds.sketch import Sketch
from diff3ds.surfaces.draw import Hidden, Surface, draw
from diff3ds.surfaces.hatching.tones import By, Hatch
from diff3ds.surfaces.on_page import SurfaceOnPage
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh


def render(
    sketch: Sketch,
    cameras: Cameras,
    *,
    background: Background = 1.0,
    antialiasing: Antialiasing = "analytic",
    backend: Backend | None = None,
    surface: Surface | None = None,
    hidden: Hidden = "drop",
    contours: bool = True,
    hatch: Hatch | By | None = None,
) -> Rendering:
    """Draws a sketch as all cameras see it.

    Differentiable with respect to every tensor of the sketch, the cameras' poses and intrinsics, and the background.
    Strokes are sorted by depth in every pixel, where they cross as well. No gradient knows of two things: of the places
    where overlapping strokes change their order in depth, and of where the near plane cuts a stroke.

    Kernels have first derivatives in reverse mode (autograd, `torch.func.grad`, `vjp`, `jacrev`). Second derivatives
    and forward mode are for `backend="reference"` with analytic antialiasing, and an error elsewhere.

    In `torch.compile`, with `fullgraph=True` too, in `torch.export` and in `make_fx` a drawing by kernels is one
    operator, `diff3ds::draw`; its backward draws again. The reference is drawn outside of such graphs.

    Kernels draw sketches in float16 and bfloat16 in float32; images and gradients come in the sketch's dtype.

    Where a device lacks float64, as Apple's GPUs do, strokes are drawn on the CPU and the images moved back, with a
    warning once a process.

    Args:
        background: gray or RGB value, or a tensor that broadcasts to (V, H, W, 3).
        antialiasing: `Analytic(blur=0.0)` or `MonteCarlo(samples=4, generator=None)`, which say what they do; or
            "analytic" or "montecarlo", short for them.
        backend: "reference", "cpu", "cuda", or None for the best there is for these tensors.
        surface: what hides what lies behind it, such as `load_surface` gives; its own contours are drawn too. No
            gradient knows of the places where strokes begin to be hidden.
        hidden: what becomes of hidden parts of strokes where there is a surface: "drop" leaves them out, "faint" draws
            them with a quarter of their opacity, "dashed" in dashes, and "show" as if they were visible.
        contours: whether the surface's contours are drawn, and the lines where its solids or pieces meet, black and as
            wide as the sketch's strokes.
        hatch: lines that make the surface darker: `Hatch(...)`, or "light" or "depth", short for it.

    Raises:
        TypeError, ValueError: arguments that do not fit each other, or values out of range; the message names the
            argument, the stroke, the value and what was expected.
        RuntimeError: batched by `torch.vmap`, recorded by `torch.jit.trace`, or, when the gradients are used, a
            derivative that there is not.
    """
    if surface is None:
        return render_sketch(sketch, cameras, background=background, antialiasing=antialiasing, backend=backend)
    check_scene(sketch, cameras)
    return draw(
        sketch,
        cameras,
        surface,
        hidden=hidden,
        contours=contours,
        hatch=hatch,
        background=background,
        antialiasing=antialiasing,
        backend=backend,
    )


def save(
    path: str | Path,
    sketch: Sketch,
    cameras: Cameras | None = None,
    *,
    unit: Unit | None = None,
    surface: TriangleMesh | None = None,
) -> None:
    """Writes a sketch, whole or not at all, in the format of the suffix.

    * `.json`: everything, bit for bit.
    * `.step`, `.stp`: exact curves and weights, and colours, for CAD programs (see `save_step`).
    * `.dxf`: the same as lines, arcs, circles, ellipses and splines on a layer a colour (see `save_dxf`).
    * `.3dm`: exact curves and weights for Rhino (see `save_3dm`).
    * `.glb`: tubes with round ends for viewers and scenes (see `save_glb`).
    * `.ply`: the same tubes as one mesh with colours, z up (see `save_ply`).
    * `.obj`: polylines with colours, z up (see `save_obj`).
    * `.usd`, `.usda`, `.usdc`, `.usdz`: exact curves, and polylines for viewers (see `save_usd`).
    * `.iges`, `.igs`: the curves of `.step` for old CAD programs (see `save_iges`).
    * `.stl`: the tubes of `.ply` for printers of things (see `save_stl`).
    * `.py`: a script that builds the sketch in Blender (see `save_blender`).
    * `.html`: a page for browsers on which the sketch is turned (see `save_html`).
    * `.svg`: the views of `cameras` in a grid, as editable paths (see `save_svg`).
    * `.pdf`: the same paths (see `save_pdf`).
    * `.png`: the views of `cameras` in a grid, rendered over white.

    Args:
        cameras: the views of a picture; formats that hold the sketch itself need none.
        unit: what a world unit is, in formats that know units of length: "mm", "cm", "m", "in" or "ft"; by default mm
            in those for CAD, m in GLB and USD, and in Blender its own unit.
        surface: what hides lines on a `.html` page, or in Blender, such as `load_surface` gives; pictures with hidden
            lines are drawn by `render`.

    Raises:
        TypeError: not a sketch, or another surface than a `TriangleMesh`.
        ValueError: another suffix; a picture without cameras; a unit for a format that has none, or one that is not
            known; a surface for another format, or one of more than 200,000 triangles; values that have become invalid
            since the sketch was made.
        ImportError: the extra that writes this format is not installed.
        OSError: the file cannot be written.
    """
    formats.save(path, sketch, cameras, unit=unit, surface=SurfaceOnPage.of(surface))
