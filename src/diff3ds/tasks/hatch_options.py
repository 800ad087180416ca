"""Options of hatching, for the commands that draw sketches with their surfaces."""

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast, get_args

if TYPE_CHECKING:
    from diff3ds._shapes import Array, Float
    from diff3ds.surfaces.hatching.tones import Hatch

# Pixels of a millimetre where nothing says how wide the page is: SVG's, 96 to an inch.
PIXELS = 96 / 25.4


@dataclass(frozen=True)
class HatchOptions:
    """Tone by lines on the surface.

    Attributes:
        hatch: lines that make the surface darker where it is turned away from a light at the upper left (light), where
            it is near (depth), or where a picture is dark: its file, laid over the box of the surface as it is seen.
            They go around what is round.
        tones: 1 to 4: lines, others across them, then lines between both, each where it is darker.
        spacing: from line to line on the page: 5 or 5px, pixels, or .8mm; by default a hundredth of the picture's
            height.
        stipple: dots in place of lines, half a spacing wide, and the nearer to each other the darker it is.
    """

    hatch: str | None = None
    tones: int = 3
    spacing: str | None = None
    stipple: bool = False

    def __post_init__(self) -> None:
        if self.hatch is None and (self.tones, self.spacing, self.stipple) != (3, None, False):
            raise ValueError(
                "--tones, --spacing and --stipple are for hatching: give --hatch light or --hatch depth too"
            )
        if self.hatch is not None:
            from diff3ds.surfaces.hatching.tones import Hatch

            # Files are read when the command runs.
            Hatch(tones=self.tones, spacing=self.pixels(PIXELS))

    def pixels(self, per_mm: float) -> float | None:
        """The spacing, None for the default.

        Raises:
            ValueError: it is no length, or less than a pixel.
        """
        if self.spacing is None:
            return None
        found = re.fullmatch(r"(\d+\.?\d*|\.\d+)(mm|px)?", self.spacing.strip())
        length = float(found[1]) * (per_mm if found[2] == "mm" else 1.0) if found else math.nan
        if not 1 <= length < math.inf:
            told = "a length of at least a pixel, as 5, 5px or .8mm"
            got = f"{self.spacing!r}" + ("" if math.isnan(length) else f", {length:.3g} pixels here")
            raise ValueError(f"spacing must be {told}, got {got}")
        return length

    def made(self, per_mm: float = PIXELS) -> "Hatch | None":
        """What drawing takes, where so many pixels are a millimetre; None where nothing is hatched.

        Raises:
            ValueError: as `pixels`, and as `load_upright`.
        """
        if self.hatch is None:
            return None
        from diff3ds.surfaces.hatching.tones import By, Hatch

        named = self.hatch in get_args(By)
        by = cast(By, self.hatch) if named else _grey(Path(self.hatch), get_args(By))
        return Hatch(by, self.tones, self.pixels(per_mm), self.stipple)


def _grey(path: Path, words: tuple[str, ...]) -> "Float[Array, 'H W']":
    """How bright a picture is on white paper, from 0 to 1."""
    from diff3ds.formats.orientation import load_upright
    from diff3ds.surfaces.shape.colors import BRIGHTNESS

    if not path.is_file():
        raise ValueError(f"hatch must be {', '.join(words)} or the file of a picture, got {str(path)!r}: no such file")
    image = load_upright(path).double().numpy()
    color = image[..., :3] @ BRIGHTNESS if image.shape[2] > 1 else image[..., 0]
    return 1 - (1 - color) * image[..., 3] if image.shape[2] == 4 else color
