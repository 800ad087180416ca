"""Sketches drawn in the style that a command is told."""

from collections.abc import Sequence

from diff3ds._shapes import Float, Tensor
from diff3ds._svg import DPI
from diff3ds.camera import Cameras
from diff3ds.page.sheet.page_setup import PageSetup
from diff3ds.render.backends import kernels
from diff3ds.sketch import Sketch
from diff3ds.styles import (
    CHARCOAL,
    PENCIL,
    Dashed,
    Ink,
    Marker,
    Nib,
    Style,
    Technical,
    Watercolour,
    scattered,
    stretched,
    svg_pixels,
)
from diff3ds.styles.styled_svg import Asked, Styled, styled, styled_pixels
from diff3ds.svg.layer_groups import Group
from diff3ds.tasks.style_options import StyleOptions


class Styling:
    """A style with what belongs to it, ready to draw.

    Raises:
        ValueError, OSError, ImportError: as `load_brush`.
    """

    def __init__(self, options: StyleOptions) -> None:
        self.options = options
        self.style = _style(options)

    def drawn(
        self,
        sketch: Sketch | Sequence[Sketch],
        cameras: Cameras,
        background: Sequence[float] | None = (1.0, 1.0, 1.0),
        page: PageSetup | None = None,
        alone: bool = False,
        layers: Sequence[Group] | Sequence[Sequence[Group]] | None = None,
        numbers: Sequence[int] | Sequence[Sequence[int]] | None = None,
    ) -> Styled:
        """As `styled`."""
        asked = self._asked(background, page)
        return styled(sketch, cameras, self.style, alone=alone, layers=layers, numbers=numbers, **asked)

    def image(
        self,
        sketch: Sketch | Sequence[Sketch],
        cameras: Cameras,
        background: Sequence[float] | None,
        page: PageSetup | None = None,
        pixels_per_mm: float = DPI / 25.4,
    ) -> Float[Tensor, "H W C"]:
        """One page as RGB, or where there is no background as straight RGBA."""
        asked = self._asked(background, page)
        if not hasattr(kernels(), "areas_covered"):
            pixels = svg_pixels(styled(sketch, cameras, self.style, **asked).svg(), dpi=pixels_per_mm * 25.4)
            return pixels if background is None else pixels[..., :3]
        return styled_pixels(sketch, cameras, self.style, pixels_per_mm=pixels_per_mm, **asked)

    def _asked(self, background: Sequence[float] | None, page: PageSetup | None) -> Asked:
        return {
            "width": self.options.style_width,
            "seed": self.options.style_seed,
            "depth_cue": self.options.depth_cue,
            "paper": self.options.paper,
            "background": background,
            "page": page,
        }


def _style(options: StyleOptions) -> Style:
    """The style of this name."""
    if options.brush is not None:
        return stretched(options.brush) if options.style == "stretched" else scattered(options.brush)
    styles: dict[str, Style] = {
        "ink": Ink(),
        "pencil": PENCIL,
        "charcoal": CHARCOAL,
        "marker": Marker(),
        "nib": Nib(),
        "watercolour": Watercolour(),
        "dashed": Dashed(),
        "technical": Technical(),
    }
    return styles[str(options.style)]
