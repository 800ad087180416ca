"""A sheet of paper: its size and margin, and how a drawing is fitted to it."""

from dataclasses import dataclass
from typing import Literal, get_args

Fit = Literal["page", "width", "none"]
# Millimetres, upright: ISO 216, and ANSI/ASME Y14.1.
SIZES = {
    "A0": (841.0, 1189.0),
    "A1": (594.0, 841.0),
    "A2": (420.0, 594.0),
    "A3": (297.0, 420.0),
    "A4": (210.0, 297.0),
    "A5": (148.0, 210.0),
    "A6": (105.0, 148.0),
    "letter": (215.9, 279.4),
    "legal": (215.9, 355.6),
    "tabloid": (279.4, 431.8),
}
MARGIN = 10.0
# Millimetres of a side: rolls are shorter, and pictures have so many pixels at most.
LONGEST = 5000.0


@dataclass(frozen=True)
class PageSetup:
    """A sheet of paper for `save_svg` and the other writers of drawings.

    Attributes:
        width: of the sheet, millimetres.
        height: the same.
        margin: on all four sides, and between several views, millimetres.
        fit: "page": the box of what is drawn, widths of strokes included, is as large as the margins allow, in the
            middle. "width": it is as wide as they allow. "none": the picture, as the cameras see it, is as large as
            they allow. Several views have one scale and one place, those at which all of them fit. Widths of strokes
            grow with the drawing.

    Raises:
        ValueError: sizes that are not positive and finite, margins that leave nothing, another fit.
    """

    width: float
    height: float
    margin: float = MARGIN
    fit: Fit = "page"

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            value = getattr(self, name)
            if not 0 < value <= LONGEST:
                raise ValueError(f"the {name} of a page must be positive and at most {LONGEST:g} mm, got {value:g}")
        if not 0 <= self.margin < min(self.width, self.height) / 2:
            raise ValueError(
                f"margin must be from 0 to less than half of the page's shorter side, "
                f"{min(self.width, self.height) / 2:g} mm, got {self.margin:g} mm"
            )
        if self.fit not in get_args(Fit):
            raise ValueError(f"fit must be one of {', '.join(get_args(Fit))}, got {self.fit!r}")

    @staticmethod
    def of(size: str, *, margin: float = MARGIN, landscape: bool = False, fit: Fit = "page") -> "PageSetup":
        """A sheet by its name, such as "A4", or by its width and height in millimetres, such as "210x148".

        Args:
            size: one of `SIZES`, in capitals or not, or two numbers.
            margin: millimetres.
            landscape: whether the longer side lies across.
            fit: see the class.

        Raises:
            ValueError: another name, or as the class.
        """
        named = {name.lower(): sides for name, sides in SIZES.items()}
        width, height = named.get(size.strip().lower()) or _sides(size)
        if landscape:
            width, height = max(width, height), min(width, height)
        return PageSetup(width, height, margin, fit)


def _sides(size: str) -> tuple[float, float]:
    try:
        width, height = (float(side) for side in size.lower().replace("×", "x").removesuffix("mm").split("x"))
    except ValueError as error:
        raise ValueError(f"page must be {', '.join(SIZES)} or WIDTHxHEIGHT in millimetres, got {size!r}") from error
    return width, height
