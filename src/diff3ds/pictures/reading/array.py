"""A picture that is given as an array instead of a file."""

import numpy as np
import torch

from diff3ds._shapes import Float, Tensor

# As for files (`formats.load_image`).
MOST_PIXELS = 1 << 27
WANTED = "give (height, width) or (height, width, channels) with 1, 3 or 4 channels"


def picture_of_array(array: object) -> Float[Tensor, "H W C"]:
    """A picture as float32 in [0, 1] from an array of numpy or a tensor.

    Args:
        array: (H, W), or (H, W, C) with one channel for gray, three for RGB, four for straight RGBA; whole numbers from
            0 to 255 (uint8), floating point numbers from 0 to 1, or true for white.

    Raises:
        TypeError: it is no array.
        ValueError: its shape, its kind of numbers or its values are others.
    """
    if isinstance(array, torch.Tensor):
        array = array.detach().cpu().numpy()
    if not isinstance(array, np.ndarray):
        raise TypeError(f"a picture is the path of a file or an array, got {type(array).__name__}")
    held = array[..., None] if array.ndim == 2 else array
    if held.ndim != 3 or held.shape[2] not in (1, 3, 4) or 0 in held.shape:
        raise ValueError(f"a picture cannot have the shape {array.shape}: {WANTED}")
    if held.shape[0] * held.shape[1] > MOST_PIXELS:
        raise ValueError(f"a picture of {held.shape[0]} x {held.shape[1]} pixels is too large: 2^27 are the most")
    if held.dtype == np.uint8:
        return torch.from_numpy(held.astype(np.float32) / np.float32(255))
    if held.dtype != np.bool_ and not np.issubdtype(held.dtype, np.floating):
        raise ValueError(f"a picture of {held.dtype} does not say what is white: give uint8, or floats from 0 to 1")
    values = held.astype(np.float32)
    if not (np.isfinite(values).all() and values.min() >= 0 and values.max() <= 1):
        low, high = values.min(), values.max()
        raise ValueError(f"a picture of floats has values from 0 to 1, got {low:g} to {high:g}: divide it by its white")
    return torch.from_numpy(values)
