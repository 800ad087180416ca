"""Pictures to files, as DiffVG writes them."""

from pathlib import Path
from typing import Any

import numpy as np

from diff3ds._files import replacing
from diff3ds._shapes import Tensor


def imwrite(img: Tensor | Any, filename: str | Path, gamma: float = 2.2, normalize: bool = False) -> None:
    """Writes a picture (H, W) or (H, W, C) with values in [0, 1]; folders are made.

    Args:
        img: a tensor, on any device, or an array; colours are linear and what is beyond [0, 1] is cut off.
        filename: its suffix says the format.
        gamma: of the file; 1 writes the values as they are.
        normalize: stretches the values to [0, 1].

    Raises:
        ValueError: another shape, NaN or infinity, or a format that is not known or has no such channels.
        OSError: the file cannot be written.
    """
    from PIL import Image

    values = np.array(img.detach().cpu().numpy() if isinstance(img, Tensor) else img, dtype=np.float64)
    values = values[..., None] if values.ndim == 2 else values
    if values.ndim != 3 or values.shape[2] not in (1, 3, 4) or not values.size:
        raise ValueError(f"img must have shape (H, W) or (H, W, 1, 3 or 4), got {tuple(values.shape)}")
    if not np.isfinite(values).all():
        raise ValueError("img must be finite, got NaN or infinity")
    if normalize and np.ptp(values) > 0:
        values = (values - values.min()) / np.ptp(values)
    values = values.clip(0, 1)
    values[..., :3] **= 1 / gamma
    pixels = (values * 255).astype(np.uint8)
    picture = Image.fromarray(pixels[..., 0] if pixels.shape[2] == 1 else pixels)
    try:
        with replacing(Path(filename)) as temporary:
            picture.save(temporary)
    except (KeyError, ValueError) as error:
        raise ValueError(f"{filename}: {error}") from error
    except OSError as error:
        if "cannot write mode" not in str(error):
            raise
        raise ValueError(f"{filename}: {error}: write PNG, or the first three channels") from error
