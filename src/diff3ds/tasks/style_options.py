"""Options of styles, for the commands that draw sketches in one."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Literal

from diff3ds._settings import require_finite

StyleName = Literal[
    "ink", "pencil", "charcoal", "marker", "nib", "watercolour", "dashed", "technical", "stretched", "scattered"
]
OF_BRUSHES = ("stretched", "scattered")


@dataclass(frozen=True)
class StyleOptions:
    """How strokes are drawn: by default as they are.

    Attributes:
        style: as ink, pencil and so on; stretched and scattered draw with --brush.
        brush: an SVG file whose filled shapes are stretched along each stroke, or scattered on it.
        style_width: times the widths that the style gives to strokes.
        style_seed: of all that is random in a style.
        depth_cue: from 0 to 1, how much lighter and thinner strokes become with their depth.
        paper: fibres on the ground.
    """

    style: StyleName | None = None
    brush: Path | None = None
    style_width: float = 1.0
    style_seed: int = 0
    depth_cue: float = 0.0
    paper: bool = False

    def __post_init__(self) -> None:
        require_finite(self)
        if self.style is None and self.brush is not None:
            object.__setattr__(self, "style", "stretched")
        if self.style is None:
            for field in fields(self):
                if getattr(self, field.name) != field.default:
                    name = field.name.replace("_", "-")
                    raise ValueError(f"--{name} is for styles: give a --style too, such as ink")
        if (self.brush is None) == (self.style in OF_BRUSHES):
            fault = "needs --brush FILE.svg" if self.brush is None else "has a brush of its own: leave --brush out"
            raise ValueError(f"--style {self.style} {fault}")
        if self.style_width <= 0:
            raise ValueError(f"style_width must be positive, got {self.style_width:g}")
        if not 0 <= self.depth_cue <= 1:
            raise ValueError(f"depth_cue must be from 0 to 1, got {self.depth_cue:g}")
