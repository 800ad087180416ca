"""What a user says of pictures: what they show, their masks, what lies behind, where the object is."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

# Edge maps and line drawings; coloured pictures; coloured pictures of which the edges are wanted.
Target = Literal["edges", "color", "color-edges"]

# What black pixels of a `mask_path` mean: left out, as in nerfstudio, or not the object.
Masks = Literal["ignore", "object"]

Frame = Literal["object", "picture"]

NAMED = {"white": (1.0, 1.0, 1.0), "black": (0.0, 0.0, 0.0)}


def parse_color(text: str) -> tuple[float, float, float]:
    """The colour that `white`, `black` or `R,G,B` (each from 0 to 1) names.

    Raises:
        ValueError: the text names no colour.
    """
    try:
        values = NAMED[text] if text in NAMED else tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != 3 or not all(0 <= value <= 1 for value in values):
        raise ValueError(f"background must be white, black or R,G,B with numbers from 0 to 1, got {text!r}")
    return values


def parse_color_or_path(text: str) -> tuple[float, float, float] | Path:
    """The colour that `parse_color` finds in a text, or else the file or folder of this name.

    Raises:
        ValueError: it is neither.
    """
    try:
        return parse_color(text)
    except ValueError as error:
        if text and Path(text).exists():
            return Path(text)
        raise ValueError(f"{error}; nor is there a picture or folder of this name") from None


@dataclass(frozen=True)
class PictureOptions:
    """Where the object of a picture is, and how it is framed.

    Attributes:
        mask: a picture of the same size, white where the object is; otherwise the picture's own alpha, or else a plain
            background, tells.
        background: a plain background's colour: white, black or R,G,B, each from 0 to 1. By default the one along the
            borders.
        frame: object brings the object to the middle, its longer side 200 / 256 of the reference; picture keeps its
            place and size, and makes the picture square.
        cut_out: have rembg's network find the object, as in a photograph with all that is around it.
    """

    mask: Path | None = None
    background: str | None = None
    frame: Frame = "object"
    cut_out: bool = False

    def __post_init__(self) -> None:
        if self.background is not None:
            parse_color(self.background)
            if self.mask is not None:
                raise ValueError("give either a mask or a background: both tell where the object is")
        if self.cut_out and (self.mask is not None or self.background is not None):
            raise ValueError("give either --cut-out, or a mask or background: each tells where the object is")
