"""Sketches drawn in the style that a command is told."""

from collections.abc import Sequence

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
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
    styled_svg,
    svg_pixels,
)
from diff3ds.tasks.style_options import StyleOptions


class Styling:
    """A style with what belongs to it, ready to draw.

    Raises:
        ValueError, OSError, ImportError: as `load_brush`.
    """

    def __init__(self, options: StyleOptions) -> None:
        self.options = options
        self.style = _style(options)

    def svg(
        self,
        sketch: Sketch,
        cameras: Cameras,
        background: Sequence[float] | None = (1.0, 1.0, 1.0),
        width_mm: float | None = None,
        layers: Sequence[tuple[str, ...]] | None = None,
        numbers: Sequence[int] | None = None,
    ) -> str:
        """As `styled_svg`."""
        return styled_svg(
            sketch,
            cameras,
            self.style,
            width=self.options.style_width,
            seed=self.options.style_seed,
            depth_cue=self.options.depth_cue,
            paper=self.options.paper,
            background=background,
            width_mm=width_mm,
            layers=layers,
            numbers=numbers,
        )

    def image(self, sketch: Sketch, camera: Cameras, background: Sequence[float] | None) -> Float[Tensor, "H W C"]:
        """One view as RGB, or where there is no background as straight RGBA."""
        pixels = svg_pixels(self.svg(sketch, camera, background))
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
