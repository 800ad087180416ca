"""The object of a photograph, found by the network U-2-Net of the package rembg."""

from collections.abc import Callable

import numpy as np
import torch

from diff3ds._shapes import Float, Tensor

# Apache 2.0, as rembg's default is not (its licence is for non-commercial use). rembg fetches it once: 176 MB.
NETWORK = "u2net"


def foreground(colors: Float[Tensor, "H W 3"]) -> Float[Tensor, "H W 1"]:
    """Share of each pixel that is the object in front, in [0, 1]; arguments and errors as for `load_foreground`."""
    return load_foreground("--mask, a picture that is white where the object is")(colors)


def require_rembg(instead: str) -> None:
    """Raises ImportError where rembg is not installed.

    Args:
        instead: what can be given in place of `--cut-out`.
    """
    try:
        import rembg  # noqa: F401
    except ImportError as error:
        raise ImportError(
            "--cut-out takes rembg: pip install 'rembg[cpu]' (it fetches a network of 176 MB when first used), or give "
            f"{instead}"
        ) from error


def load_foreground(instead: str) -> Callable[[Float[Tensor, "H W 3"]], Float[Tensor, "H W 1"]]:
    """The network, as a function of RGB in [0, 1] that says which share of each pixel is the object in front.

    Args:
        instead: what can be given in place of `--cut-out`.

    Raises:
        ImportError: rembg is not installed.
        OSError: its network is neither here nor can be fetched.
    """
    require_rembg(instead)
    import rembg

    try:
        network = rembg.new_session(NETWORK)
    except Exception as error:
        # The errors of its downloads and of its runtime have no common kind.
        raise OSError(
            f"rembg cannot load its network {NETWORK}: {error}. In place of --cut-out give {instead}"
        ) from error

    def found(colors: Float[Tensor, "H W 3"]) -> Float[Tensor, "H W 1"]:
        pixels = (colors * 255).round().to(torch.uint8).numpy()
        mask = np.asarray(rembg.remove(pixels, session=network, only_mask=True))
        return torch.from_numpy(mask.astype(np.float32) / 255)[..., None]

    return found
