"""The object of a photograph, found by the network U-2-Net of the package rembg."""

import numpy as np
import torch

from diff3ds._shapes import Float, Tensor

# Apache 2.0, as rembg's default is not (its licence is for non-commercial use). rembg fetches it once: 176 MB.
NETWORK = "u2net"


def foreground(colors: Float[Tensor, "H W 3"]) -> Float[Tensor, "H W 1"]:
    """Share of each pixel that is the object in front, in [0, 1].

    Args:
        colors: RGB in [0, 1].

    Raises:
        ImportError: rembg is not installed.
        OSError: its network is neither here nor can be fetched.
    """
    try:
        import rembg
    except ImportError as error:
        raise ImportError(
            "--cut-out takes rembg: pip install 'rembg[cpu]' (it fetches a network of 176 MB when first used), or give "
            "--mask, a picture that is white where the object is"
        ) from error
    try:
        network = rembg.new_session(NETWORK)
    except Exception as error:
        # The errors of its downloads and of its runtime have no common kind.
        raise OSError(f"rembg cannot load its network {NETWORK}: {error}. Give --mask in place of --cut-out") from error
    pixels = (colors * 255).round().to(torch.uint8).numpy()
    found = np.asarray(rembg.remove(pixels, session=network, only_mask=True))
    return torch.from_numpy(found.astype(np.float32) / 255)[..., None]
