"""Pictures: tensors to PNG files, picture files to tensors, and grids of views."""

import io
import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import torch

from diff3ds._files import write_bytes
from diff3ds._shapes import Float, Tensor
from diff3ds.formats.pixels import described, pixels_of, prepare, require_one_frame
from diff3ds.page.sheet.views_grid import grid_columns

# 11585 x 11585; as float32 RGBA that takes 2 GiB. More is taken for a mistake or an attack.
MAX_PIXELS = 1 << 27
# Rows that are made whole numbers at once.
ROWS = 32
_MODES = {1: "L", 3: "RGB", 4: "RGBA"}


def save_png(path: str | Path, image: Float[Tensor, "H W C"], *, pixels_per_mm: float | None = None) -> None:
    """Writes a picture, whole or not at all, with 8 bits a channel.

    Args:
        image: gray, RGB or straight RGBA (C = 1, 3 or 4) in [0, 1]; what lies outside is clamped.
        pixels_per_mm: on paper, which the file says to a thousandth; None for a file that says nothing of it.

    Raises:
        TypeError, ValueError: not such an image, or one with values that are not finite.
        OSError: the file cannot be written.
    """
    write_bytes(Path(path), encoded(image, pixels_per_mm))


def encoded(image: object, pixels_per_mm: float | None = None) -> bytes:
    """A picture as `save_png` takes it, as the bytes of a PNG file.

    Raises:
        TypeError, ValueError: as `save_png`.
    """
    file = io.BytesIO()
    dpi = {} if pixels_per_mm is None else {"dpi": (pixels_per_mm * 25.4,) * 2}
    as_pillow(image).save(file, format="PNG", **dpi)
    return file.getvalue()


def as_pillow(image: object) -> Any:
    """A picture as `save_png` takes it, as one of Pillow's with 8 bits a channel.

    Raises:
        TypeError, ValueError: as `save_png`.
    """
    from PIL import Image

    if not isinstance(image, Tensor) or not image.is_floating_point():
        got = str(image.dtype) if isinstance(image, Tensor) else type(image).__name__
        raise TypeError(f"image must be a floating point tensor in [0, 1], got {got}")
    if image.ndim != 3 or image.shape[2] not in _MODES or 0 in image.shape:
        hint = ": several views make one picture with tile_images" if image.ndim == 4 else ""
        raise ValueError(f"image must have shape (H, W, C), C = 1, 3 or 4, got {tuple(image.shape)}{hint}")
    content = np.empty(image.shape, np.uint8)
    # A few rows at once stay in the cache: a page is then done in a twentieth of the time.
    for first in range(0, len(image), ROWS):
        values = image[first : first + ROWS].detach().cpu().double().numpy()
        if not np.isfinite(values.sum()):
            row, column, channel = np.argwhere(~np.isfinite(values))[0].tolist()
            wrong = values[row, column, channel]
            raise ValueError(f"image must be finite, got {wrong} at row {first + row}, column {column}")
        content[first : first + ROWS] = np.rint(255 * values.clip(0, 1))
    return Image.fromarray(content[..., 0] if content.shape[2] == 1 else content)


def load_image(path: str | Path) -> Float[Tensor, "H W C"]:
    """A picture file (any format that pillow reads) as float32 in [0, 1].

    C is 1 for gray, 3 for RGB, 4 for straight RGBA; palettes and other colour models become RGB or RGBA. 16 bits a
    channel are kept for gray, and so are floating point numbers in [0, 1]. Pixels are taken as they are stored: no EXIF
    rotation, no colour profile, no gamma.

    Raises:
        ValueError: more than 2^27 pixels; a file that is no picture, a broken one, or one of several frames or pages of
            one size; numbers whose white is not told: floating point outside [0, 1], or whole numbers of 32 bits.
        OSError: the file cannot be read.
    """
    return load_reduced(path, None)[0]


def size_of(path: str | Path) -> tuple[int, int]:
    """(height, width) of a picture file, of which only the beginning is read.

    Raises:
        ValueError: no picture.
        OSError: the file cannot be read.
    """
    from PIL import Image, UnidentifiedImageError

    prepare(Path(path))
    try:
        with Image.open(path) as picture:
            return picture.height, picture.width
    except UnidentifiedImageError as error:
        raise ValueError(f"{path}: cannot be read as a picture ({described(Path(path))})") from error
    except Image.DecompressionBombError as error:
        raise ValueError(f"{path}: cannot be read as a picture ({error})") from error


def load_reduced(
    path: str | Path, least: tuple[int, int] | None
) -> tuple[Float[Tensor, "H W C"], tuple[int, int], int]:
    """As `load_image`, but a JPEG file may come 2, 4 or 8 times smaller, which is faster and takes less memory.

    Args:
        least: (height, width) that the picture keeps; None keeps its size.

    Returns:
        The picture, the (height, width) of the file, and how many times smaller the picture is. Where that does not
        divide the size, the last row and column lie partly outside the file's pixels.

    Raises:
        ValueError, OSError: as `load_image`.
    """
    from PIL import Image, UnidentifiedImageError

    path = Path(path)
    prepare(path)
    with path.open("rb") as file, warnings.catch_warnings():
        # Pillow warns below our bound, which is checked here, and refuses above it.
        warnings.simplefilter("ignore")
        try:
            with Image.open(file) as picture:
                width, height = picture.size
                if width * height > MAX_PIXELS:
                    raise ValueError(f"{width} x {height} are more than the {MAX_PIXELS} that are read")
                require_one_frame(picture)
                box = picture.draft(picture.mode, (least[1], least[0])) if least else None
                return pixels_of(picture), (height, width), round(width / box[1][2]) if box else 1
        except UnidentifiedImageError as error:
            raise ValueError(f"{path}: cannot be read as a picture ({described(path)})") from error
        # Broken files make pillow's decoders raise nearly anything.
        except Exception as error:
            raise ValueError(f"{path}: cannot be read as a picture ({error})") from error


def tile_images(images: Float[Tensor, "V H W C"], columns: int | None = None) -> Float[Tensor, "H1 W1 C"]:
    """Pictures side by side in one, row by row from the top left; empty places are white.

    Args:
        columns: pictures in a row; None makes the grid about square.

    Raises:
        ValueError: no pictures, or not a positive number of columns.
    """
    if images.ndim != 4 or len(images) == 0:
        raise ValueError(f"images must have shape (V, H, W, C) with at least one view, got {tuple(images.shape)}")
    columns = grid_columns(len(images)) if columns is None else columns
    if columns < 1:
        raise ValueError(f"columns must be positive, got {columns}")
    count, height, width, channels = images.shape
    rows = math.ceil(count / columns)
    blank = images.new_ones((rows * columns - count, height, width, channels))
    grid = torch.cat([images, blank]).reshape(rows, columns, height, width, channels)
    return grid.transpose(1, 2).reshape(rows * height, columns * width, channels)
