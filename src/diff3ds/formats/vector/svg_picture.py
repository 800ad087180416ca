"""SVG drawings read as pictures."""

from pathlib import Path

from diff3ds._files import read_text
from diff3ds._shapes import Float, Tensor
from diff3ds._svg import svg_pixels

# Of the longer side, pixels: more than pictures of one object are looked at. What a file says of its size may be a
# stamp's or a wall's.
LONGER = 1024


def load_svg_picture(path: Path) -> Float[Tensor, "H W 4"]:
    """A vector drawing as a picture, straight RGBA, 1024 pixels along its longer side.

    Raises:
        ImportError: the extra `svg` is not installed; says so, and what else to do.
        ValueError: the file is no SVG, or has no text.
        OSError: it cannot be read.
    """
    try:
        return svg_pixels(read_text(path), LONGER)
    except ImportError as error:
        raise ImportError(f"{path}: {error}, or save the drawing as PNG") from error
    except ValueError as error:
        raise ValueError(f"{path}: cannot be read as an SVG drawing ({error}): save it as PNG") from error
