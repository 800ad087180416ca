"""SVG texts as pixels, drawn by resvg."""

import importlib.util
import io

import numpy as np
import torch

from diff3ds._shapes import Float, Tensor

# Pixels to an inch, as CSS has them: with none resvg knows no millimetres.
DPI = 96


def svg_pixels(text: str, longer: int | None = None, dpi: float = DPI) -> Float[Tensor, "H W 4"]:
    """An SVG text as resvg draws it, straight RGBA.

    Args:
        longer: side of the picture, pixels; None takes the size that the text says.
        dpi: pixels to an inch, for a text that says its size in millimetres.

    Raises:
        ImportError: the extra `svg` is not installed.
        ValueError: a text that is no SVG.
    """
    if importlib.util.find_spec("resvg_py") is None:
        raise ImportError("SVG is drawn to pixels by resvg: install it with pip install 'diff3ds[svg]'")
    import resvg_py
    from PIL import Image

    drawn = bytes(resvg_py.svg_to_bytes(svg_string=text, width=longer, height=longer, dpi=dpi))
    picture = Image.open(io.BytesIO(drawn)).convert("RGBA")
    return torch.from_numpy(np.asarray(picture).astype(np.float32) / 255)
