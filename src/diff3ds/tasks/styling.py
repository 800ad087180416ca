"""Sketches drawn in the style that a command is told."""

from collections.abc import Sequence

from diff3ds._shapes import Float, Tensor
from diff3ds._svg import DPI
from diff3ds.camera import Cameras
from diff3ds.page.sheet.page_setup import PageSetup
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
from diff3ds.styles.styled_svg import Styled, styled
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
        return styled(
            sketch,
            cameras,
            self.style,
            width=self.options.style_width,
            seed=self.options.style_seed,
            depth_cue=self.options.depth_cue,
            paper=self.options.paper,
            background=background,
            page=page,
            alone=alone,
            layers=layers,
            numbers=numbers,
        )

    def image(
        self,
        sketch: Sketch | Sequence[Sketch],
        cameras: Cameras,
        background: Sequence[float] | None,
        page: PageSetup | None = None,
        pixels_per_mm: float = DPI / 25.4,
    ) -> Float[Tensor, "H W C"]:
        """One page as RGB, or where there is no background as straight RGBA."""
        text = self.drawn(sketch, cameras, background, page).svg()
        pixels = svg_pixels(text, dpi=pixels_per_mm * 25.4)
        return pixels if background is None else pixels[..., :3]


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
