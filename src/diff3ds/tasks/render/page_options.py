"""Options of the pages that drawings lie on and of the pens that draw them, for the commands that write drawings."""

import re
from dataclasses import dataclass, fields

from diff3ds._settings import require_finite
from diff3ds.page.sheet.page_setup import MARGIN, Fit, PageSetup

# Of a picture of a page: ten pixels to a millimetre, so that what is a whole number of these is exact.
DPI = 254.0
# More takes more than 4 GiB to draw.
MOST_PIXELS = 1 << 26
_MILLIMETRES = {"": 1.0, "mm": 1.0, "cm": 10.0, "in": 25.4}


@dataclass(frozen=True)
class PageOptions:
    """The page that drawings are laid out on: by default the picture.

    Attributes:
        page: A0 to A6, letter, legal, tabloid, or WIDTHxHEIGHT in millimetres, as 210x148; by default the page is the
            picture, a pixel of which is 1/96 inch.
        landscape: the longer side of the page lies across.
        margin: on all four sides and between views: millimetres, or with a unit as .5in or 2cm; by default 10mm.
        fit: what is as large as the margins allow: page, the drawing by its own box; width, the drawing as wide; none,
            the whole picture as the camera sees it. Of a page it is page by default, and of a turntable, which is
            fitted to the boxes of all frames.
        dpi: pixels to an inch of pictures of a page; by default 254, ten to a millimetre.
    """

    page: str | None = None
    landscape: bool = False
    margin: str | None = None
    fit: Fit | None = None
    dpi: float | None = None

    def __post_init__(self) -> None:
        require_finite(self)
        if self.page is None:
            for field in fields(self):
                if field.name != "fit" and getattr(self, field.name) != field.default:
                    raise ValueError(f"--{field.name} is for pages: give a --page too, such as A4")
        if self.dpi is not None and self.dpi <= 0:
            raise ValueError(f"dpi must be positive, got {self.dpi:g}")
        # Refused here, before any work.
        _ = self.setup

    @property
    def setup(self) -> PageSetup | None:
        """The sheet; None of no page.

        Raises:
            ValueError: no such page.
        """
        if self.page is None:
            return None
        margin = MARGIN if self.margin is None else parse_length(self.margin)
        return PageSetup.of(self.page, margin=margin, landscape=self.landscape, fit=self.fit or "page")

    @property
    def pixels_per_mm(self) -> float:
        """Of pictures of the page."""
        return (self.dpi or DPI) / 25.4

    @property
    def picture_per_mm(self) -> float | None:
        """The same, None where there is no page."""
        return None if self.page is None else self.pixels_per_mm

    def check_pixels(self) -> None:
        """Sees that a picture of the page can be drawn.

        Raises:
            ValueError: it has too many pixels.
        """
        if self.setup is not None:
            width, height = (round(side * self.pixels_per_mm) for side in (self.setup.width, self.setup.height))
            if width * height > MOST_PIXELS:
                raise ValueError(f"a page of {width} x {height} pixels, more than {MOST_PIXELS}: give a lower --dpi")

    def check_previews(self) -> None:
        """Sees that the previews of a run can lie on the page, which is all that is laid out on it.

        Raises:
            ValueError: as `check_pixels`; a drawing is to be fitted to no page.
        """
        if self.fit is not None and self.page is None:
            raise ValueError("--fit is for pages: give a --page too, such as A4")
        self.check_pixels()


NO_PAGE = PageOptions()


@dataclass(frozen=True, kw_only=True)
class PenOptions:
    """Drawings for plotters and other machines with pens.

    Attributes:
        centerline: SVG and PDF for plotters, as HPGL files are: nothing is filled or hidden; strokes that meet are one
            path, nothing is drawn twice, and the pen's ways are short; by default a layer a colour is what one pen
            draws. How often it is lifted and how far it goes is said.
        pen_mm: how wide the pen's lines are, millimetres on paper, with --centerline, or in HPGL files, and a --page.
        speed: millimetres a second of the pen, for how long it takes, with these too.
    """

    centerline: bool = False
    pen_mm: float | None = None
    speed: float | None = None

    def __post_init__(self) -> None:
        require_finite(self)
        for name in ("pen_mm", "speed"):
            value = getattr(self, name)
            if value is not None and value <= 0:
                raise ValueError(f"{name} must be positive, got {value:g}")

    def check_on(self, page: PageOptions) -> None:
        """Sees that a pen whose width or speed is given draws on paper.

        Raises:
            ValueError: it does not.
        """
        for name in ("pen_mm", "speed"):
            if getattr(self, name) is not None and not (self.centerline and page.page is not None):
                raise ValueError(f"--{name.replace('_', '-')} is of a pen on paper: give --centerline and a --page")


def parse_length(text: str) -> float:
    """Millimetres of `10`, `10mm`, `1cm` or `.4in`.

    Raises:
        ValueError: it is none of these.
    """
    found = re.fullmatch(r"(\d+\.?\d*|\.\d+)\s*(mm|cm|in|)", text.strip())
    if found is None:
        raise ValueError(f"margin must be a number of millimetres, or one with mm, cm or in, got {text!r}")
    return float(found[1]) * _MILLIMETRES[found[2]]
