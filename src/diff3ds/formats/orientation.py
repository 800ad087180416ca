"""How a camera was held when it took a picture: the orientation in EXIF."""

from pathlib import Path

from diff3ds._shapes import Float, Tensor
from diff3ds.formats.pixels import prepare
from diff3ds.formats.png import load_image

# EXIF orientation: whether rows and columns change places, then which of them are reversed (TIFF 6.0).
TAG = 0x0112
ORIENTATIONS = {
    2: (False, (1,)),
    3: (False, (0, 1)),
    4: (False, (0,)),
    5: (True, ()),
    6: (True, (1,)),
    7: (True, (0, 1)),
    8: (True, (0,)),
}


def orientation_of(path: Path) -> int:
    """The orientation that the file says, 1 if it says none.

    Raises:
        ValueError: no picture.
        OSError: the file cannot be read.
    """
    from PIL import Image

    prepare(path)
    with path.open("rb") as file:
        # Damaged EXIF makes pillow raise nearly anything.
        try:
            with Image.open(file) as picture:
                found = picture.getexif().get(TAG, 1)
        except Exception as error:
            raise ValueError(f"{path}: its EXIF cannot be read ({error})") from error
    return found if found in ORIENTATIONS else 1


def upright(image: Float[Tensor, "H W C"], orientation: int) -> Float[Tensor, "..."]:
    """A picture turned as viewers show it."""
    transposed, reversed_axes = ORIENTATIONS.get(orientation, (False, ()))
    return (image.transpose(0, 1) if transposed else image).flip(reversed_axes)


def load_upright(path: Path) -> Float[Tensor, "H W C"]:
    """A picture as viewers show it.

    Raises:
        ValueError, OSError: as `load_image` and `orientation_of`.
    """
    return upright(load_image(path), orientation_of(path))


def load_of_size(path: Path, size: tuple[int, int], wanted: str) -> Float[Tensor, "H W C"]:
    """A picture whose size is known: as it is stored, or, where only that has the size, as its EXIF turns it.

    Args:
        size: (height, width) in pixels.
        wanted: who says so, for the error: "the cameras say".

    Raises:
        ValueError: neither has this size; as `load_image`.
        OSError: the file cannot be read.
    """
    image = load_image(path)
    stored = (image.shape[0], image.shape[1])
    if stored == size:
        return image
    orientation = orientation_of(path)
    if orientation > 4 and (stored[1], stored[0]) == size:
        return upright(image, orientation)
    turned = f", or {stored[1]} x {stored[0]} turned as its EXIF says" if orientation > 4 else ""
    swapped = (stored[1], stored[0]) == size
    hint = ". Width and height are exchanged: was the picture turned after the cameras were found?" if swapped else ""
    raise ValueError(
        f"{path}: {stored[0]} x {stored[1]} (height x width) pixels{turned}, but {wanted} {size[0]} x {size[1]}{hint}"
    )
