"""The reference picture of `diff3ds image`: read, its object cut out, squared, over white."""

from dataclasses import dataclass
from math import inf
from pathlib import Path

import torch

from diff3ds._files import check_there
from diff3ds._shapes import Float, Tensor
from diff3ds.camera import orbit
from diff3ds.formats.orientation import load_upright
from diff3ds.formats.vector.svg_picture import load_svg_picture
from diff3ds.pictures.content.background import parse_background, with_alpha
from diff3ds.pictures.content.cutout import is_inverted, premultiplied
from diff3ds.pictures.content.foreground import foreground
from diff3ds.pictures.content.ink import beside_page, ink_on_paper
from diff3ds.pictures.content.masks import mask_of
from diff3ds.pictures.dataset import PosedPictures
from diff3ds.pictures.picture_options import PictureOptions
from diff3ds.pictures.reading.resample import area_means
from diff3ds.pictures.store import store_of

# The longer side of the object in pixels of a reference of 256, as in the demonstration of Zero-1-to-3.
OBJECT, OF = 200, 256
# Fainter pixels do not tell where the object is.
FAINT = 0.05
# An object of fewer pixels along its longer side shows too little: it would be enlarged over six times. Empirical.
LEAST = 32


@dataclass(frozen=True, eq=False)
class ReferencePicture:
    """A square picture of one object.

    Attributes:
        pixels: RGB times alpha, and alpha, in [0, 1].
    """

    pixels: Float[Tensor, "S S 4"]

    @property
    def image(self) -> Float[Tensor, "S S 3"]:
        """RGB over white."""
        return self.pixels[..., :3] + (1 - self.pixels[..., 3:])

    @property
    def alpha(self) -> Float[Tensor, "S S"]:
        """Share of each pixel that is object."""
        return self.pixels[..., 3]


def read_reference(
    picture: Path | Float[Tensor, "H W C"], size: int = OF, options: PictureOptions | None = None
) -> ReferencePicture:
    """Reads a reference picture: RGBA, or one with a mask, or one with a plain background, or a drawing on paper.

    Pixels are area means where the picture is reduced, bilinear where it is enlarged. A rotation in EXIF is heeded.

    Args:
        picture: a file, of pixels or SVG, or its pixels: gray, RGB or straight RGBA, in [0, 1].
        size: height and width of the result in pixels.
        options: default `PictureOptions()`.

    Raises:
        ValueError: a file that is no picture, or one of more than 2^27 pixels; a mask of another size; nothing visible;
            neither a plain background nor lines on paper; an object of fewer than 32 pixels.
        OSError: a file cannot be read, or rembg's network.
        ImportError: an object is to be cut out, and rembg is not installed; an SVG file, and the extra `svg` is not.
    """
    options = options or PictureOptions()
    if options.mask is not None:
        check_there(options.mask, "a mask, a picture that is white where the object is", inf)
    if isinstance(picture, Path):
        check_there(picture, "a picture of one object, a file such as mug.png", inf)
        name = str(picture)
        image = load_svg_picture(picture) if picture.suffix.lower() == ".svg" else load_upright(picture)
    else:
        name, image = "the picture", picture
    pixels = _cut_out(name, image, options)
    top, bottom, left, right = box = _object_box(name, pixels[..., 3], options)
    if max(bottom - top, right - left) < LEAST:
        raise ValueError(
            f"{name}: the object has {right - left} x {bottom - top} pixels; "
            f"give a picture in which its longer side has {LEAST} or more"
        )
    if options.frame == "picture":
        box = (0, pixels.shape[0], 0, pixels.shape[1])
    return ReferencePicture(_squared(pixels, box, size, size if options.frame == "picture" else size * OBJECT / OF))


def _cut_out(name: str, image: Float[Tensor, "H W C"], options: PictureOptions) -> Float[Tensor, "H W 4"]:
    """RGB times alpha, and alpha, of the object."""
    pixels = premultiplied(image)
    size = (image.shape[0], image.shape[1])
    if options.mask is not None:
        return pixels * _mask(name, options.mask, size)
    if options.cut_out:
        return pixels * foreground(pixels[..., :3] + 1 - pixels[..., 3:])
    color = parse_background(options.background) if options.background else None
    if bool((pixels[..., 3] < 1).any()):
        if is_inverted(pixels[..., 3]):
            raise ValueError(
                f"{name}: opaque all along its borders, and transparent inside, as if its alpha were inverted: invert "
                "it, or give --mask, a picture that is white where the object is"
            )
        highest = float(pixels[..., 3].max())
        if highest <= FAINT:
            raise ValueError(f"{name}: transparent everywhere (alpha is at most {highest:.2g}): it shows no object")
        return pixels
    # The camera says the size and nothing else.
    opaque = PosedPictures(orbit(0.0, size=size), "color", store_of(pixels[None]), (Path(name).name,))
    cut, found = with_alpha(opaque, color)
    # A dark frame around a page is of one colour, and no background.
    if found is None or (color is None and bool(beside_page(pixels[..., :3].numpy()).any())):
        ink = ink_on_paper(pixels[..., :3].numpy())
        if ink is not None:
            pixels[..., :3], pixels[..., 3] = 0, torch.from_numpy(ink)
            return pixels
    if found is None:
        tells = "the picture has no transparency" if image.shape[2] < 4 else "no area of the picture is transparent"
        raise ValueError(
            f"{name}: cannot tell the object from what is behind it: {tells}, and its borders "
            "no single colour. Let a network find the object (--cut-out, with rembg), or cut it out in an image editor "
            "and save it as PNG with transparency, or give --mask, a picture that is white where the object is"
        )
    return cut.batch([0]).pixels[0]


def _mask(name: str, mask: Path, size: tuple[int, int]) -> Float[Tensor, "H W 1"]:
    image = load_upright(mask)
    if image.shape[:2] != size:
        raise ValueError(
            f"{mask}: {image.shape[0]} x {image.shape[1]} (height x width) pixels, but {name} has {size[0]} x {size[1]}"
        )
    return mask_of(image)[..., None]


def _object_box(name: str, alpha: Float[Tensor, "H W"], options: PictureOptions) -> tuple[int, int, int, int]:
    """First row, end of rows, first column and end of columns of what is visible."""
    seen = alpha > FAINT
    rows, columns = seen.any(1).nonzero(), seen.any(0).nonzero()
    if not len(rows):
        what = (
            f"all black where {name} is visible"
            if options.mask
            else "nothing differs from the background by more than 5 %"
        )
        raise ValueError(f"{options.mask or name}: {what}: there is no object to make a sketch of")
    return int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1


def _squared(
    pixels: Float[Tensor, "H W 4"], box: tuple[int, int, int, int], size: int, longer: float
) -> Float[Tensor, "S S 4"]:
    """A box of a picture in the middle of a transparent square, its longer side this many pixels."""
    top, bottom, left, right = box
    scale = longer / max(bottom - top, right - left)
    height, width = (max(1, round(scale * side)) for side in (bottom - top, right - left))
    inside = _resized(pixels[top:bottom, left:right], (height, width))
    square = torch.zeros(size, size, 4)
    row, column = (size - height) // 2, (size - width) // 2
    square[row : row + height, column : column + width] = inside
    return square


def _resized(pixels: Float[Tensor, "H W 4"], size: tuple[int, int]) -> Float[Tensor, "h w 4"]:
    if size[0] <= pixels.shape[0] and size[1] <= pixels.shape[1]:
        return area_means(pixels[None], size)[0]
    channels = pixels.movedim(-1, 0)[None]
    enlarged = torch.nn.functional.interpolate(channels, size, mode="bilinear", align_corners=False)
    return enlarged[0].movedim(0, -1)
