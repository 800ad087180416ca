"""DiffVG's interface on this package's renderer: `import diff3ds.pydiffvg as pydiffvg`.

Scripts written for DiffVG run as they are, without its build: docs/howto/from-pydiffvg.md says what is the same and
what differs. DiffVG is by Tzu-Mao Li, Michal Lukáč, Michaël Gharbi and Jonathan Ragan-Kelley (SIGGRAPH Asia 2020);
nothing of its code is in here.
"""

from typing import TYPE_CHECKING, Any

from diff3ds.pydiffvg import settings
from diff3ds.pydiffvg.install import install
from diff3ds.pydiffvg.render_function import RenderFunction
from diff3ds.pydiffvg.scene_classes import (
    Circle,
    Ellipse,
    LinearGradient,
    OutputType,
    Path,
    PixelFilter,
    Polygon,
    RadialGradient,
    Rect,
    ShapeGroup,
)
from diff3ds.pydiffvg.settings import get_device, get_use_gpu, set_device, set_print_timing, set_use_gpu
from diff3ds.pydiffvg.svg_in import from_svg_path, svg_to_scene
from diff3ds.pydiffvg.svg_out import prettify, save_svg
from diff3ds.pydiffvg.write_picture import imwrite

if TYPE_CHECKING:
    import torch

    device: torch.device
    use_gpu: bool

__all__ = [
    "Circle",
    "Ellipse",
    "LinearGradient",
    "OutputType",
    "Path",
    "PixelFilter",
    "Polygon",
    "RadialGradient",
    "Rect",
    "RenderFunction",
    "ShapeGroup",
    "device",
    "from_svg_path",
    "get_device",
    "get_use_gpu",
    "imwrite",
    "install",
    "prettify",
    "save_svg",
    "set_device",
    "set_print_timing",
    "set_use_gpu",
    "svg_to_scene",
    "use_gpu",
]


_INSTEAD = dict.fromkeys(
    ("OptimizableSvg", "SvgOptimizationSettings"),
    ": read a file with svg_to_scene, and give the tensors of its shapes and groups to an optimiser",
)


def __getattr__(name: str) -> Any:
    """`device` and `use_gpu` as they are now, and what to do without names that are not here."""
    if name in ("device", "use_gpu"):
        return getattr(settings, name)
    # Scripts switch its print_timing off.
    if name == "render_pytorch":
        return settings
    raise AttributeError(f"module 'pydiffvg' of diff3ds has no {name!r}{_INSTEAD.get(name, '')}")
