"""Posed pictures: found in a folder, read, and told apart into edge maps and coloured pictures."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.formats.png import load_image
from diff3ds.transforms import load_transforms

Target = Literal["edges", "color"]

# Gray pictures whose background takes more than this share of the pixels are edge maps or line drawings. A drawing's
# lines rarely cover a third; photographs have no single background value.
DRAWING_BACKGROUND = 0.65
# How far channels, or background pixels, may lie apart: 5 % hides the noise of JPEG files.
SAME = 0.05


@dataclass(frozen=True, eq=False)
class PosedPictures:
    """V pictures of one size with their cameras.

    Attributes:
        cameras: in the world of the file.
        target: what the pictures are.
        images: RGB over a white background; of edge maps, black ink on white, whatever the files hold.
        alpha: share of a pixel that is not background: ink of edge maps, the alpha channel of pictures that have one,
            else 1.
        names: file names.
    """

    cameras: Cameras
    target: Target
    images: Float[Tensor, "V H W 3"]
    alpha: Float[Tensor, "V H W"]
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.cameras)


def find_transforms(path: Path, target: Target | None) -> Path:
    """The transforms file of a folder: `transforms.json`, `transforms_train.json`, or the one of the target.

    Raises:
        FileNotFoundError: there is none.
        ValueError: there are several, and none of these names.
    """
    if not path.is_dir():
        if not path.exists():
            raise FileNotFoundError(f"{path}: no such file or folder")
        return path
    kinds = [target] if target else ["edges", "color"]
    for name in ("transforms.json", "transforms_train.json", *(f"transforms_{kind}.json" for kind in kinds)):
        if (path / name).is_file():
            return path / name
    found = sorted(p.name for p in path.glob("transforms*.json"))
    if not found:
        raise FileNotFoundError(f"{path}: no transforms.json in this folder")
    if len(found) > 1:
        raise ValueError(f"{path}: which of {', '.join(found)}? Name the file instead of the folder")
    return path / found[0]


def load_posed(path: Path, target: Target | None = None, size: int = 512) -> PosedPictures:
    """The pictures and cameras of a transforms file.

    Args:
        path: a transforms.json (see `load_transforms`).
        target: what the pictures are; None looks at them.
        size: larger pictures are reduced to this many pixels along the longer side.

    Raises:
        FileNotFoundError, ValueError: a missing or unreadable file; pictures whose size is not that of the cameras.
    """
    cameras, pictures = load_transforms(path)
    scale = min(1.0, size / max(cameras.size))
    reduced = cameras.resize((round(cameras.size[0] * scale), round(cameras.size[1] * scale))) if scale < 1 else cameras
    rgba = torch.stack([_picture(picture, cameras.size, reduced.size) for picture in pictures])
    gray = _drawing(rgba)
    found: Target = target or ("color" if gray is None else "edges")
    names = tuple(picture.name for picture in pictures)
    if found == "color":
        color, alpha = rgba[..., :3], rgba[..., 3]
        return PosedPictures(reduced, found, color * alpha[..., None] + 1 - alpha[..., None], alpha, names)
    ink = _ink(rgba)
    return PosedPictures(reduced, found, (1 - ink)[..., None].expand(*ink.shape, 3), ink, names)


def downsampled(images: Float[Tensor, "V H W"], size: tuple[int, int]) -> Float[Tensor, "V h w"]:
    """Smaller images, each pixel the mean of those it covers."""
    return torch.nn.functional.interpolate(images[:, None], size, mode="area")[:, 0]


def _picture(path: Path, size: tuple[int, int], reduced: tuple[int, int]) -> Float[Tensor, "h w 4"]:
    """RGBA of one file, reduced."""
    image = load_image(path)
    if image.shape[:2] != size:
        got = f"{image.shape[0]} x {image.shape[1]}"
        raise ValueError(f"{path}: {got} (height x width) pixels, but the cameras say {size[0]} x {size[1]}")
    channels = image.shape[2]
    color = image[..., :3] if channels >= 3 else image[..., :1].expand(*size, 3)
    alpha = image[..., -1:] if channels in (2, 4) else torch.ones_like(color[..., :1])
    # Transparent pixels hold any colour: average premultiplied ones.
    small = downsampled(torch.cat([color * alpha, alpha], -1).permute(2, 0, 1), reduced).permute(1, 2, 0)
    return torch.cat([small[..., :3] / small[..., 3:].clamp(min=1e-6), small[..., 3:]], -1)


def _drawing(rgba: Float[Tensor, "V H W 4"]) -> Float[Tensor, "V H W"] | None:
    """Gray values over white if these are edge maps or line drawings, else None."""
    color = rgba[..., :3]
    gray = color.mean(-1) * rgba[..., 3] + 1 - rgba[..., 3]
    colorless = ((color.amax(-1) - color.amin(-1)) * rgba[..., 3] < SAME).float().mean()
    background = _background(gray)
    plain = ((gray - background).abs() < SAME).float().mean()
    extreme = min(background, 1 - background) < SAME
    return gray if colorless > 0.999 and plain > DRAWING_BACKGROUND and extreme else None


def _background(gray: Float[Tensor, "V H W"]) -> float:
    return float(gray.flatten().median())


def _ink(rgba: Float[Tensor, "V H W 4"]) -> Float[Tensor, "V H W"]:
    """Ink of edge maps in either polarity: distance from the background's value, over white."""
    gray = rgba[..., :3].mean(-1) * rgba[..., 3] + 1 - rgba[..., 3]
    return gray if _background(gray) < 0.5 else 1 - gray
