"""Colours that a mesh file gives to its faces: of vertices, faces and materials, and textures."""

import io
import warnings
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float, Int
from diff3ds.formats.png import MAX_PIXELS

# Kinds of pictures that are decoded: others, such as PostScript, have programs run.
PICTURES = ("PNG", "JPEG", "WEBP", "BMP", "TGA", "TIFF", "GIF")
# Textures are looked up by so much nearer to the middle of a triangle: at its edge the next texel is another's.
INWARDS = 1e-3
NO_TEXTURE = -1
Wrap = Literal["repeat", "clamp", "mirror"]


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture on triangles.

    Attributes:
        picture: 8 bits a channel.
        wrap: what it does beyond its borders, along u and v.
    """

    picture: NDArray[np.uint8]
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")


@dataclass(frozen=True, eq=False)
class MeshColors:
    """Colours of triangles, sRGB in [0, 1].

    Attributes:
        corners: at the corners of each, in the order of its vertices; NaN where the file gives none.
        uv: places of the corners in the texture, (0, 0) at the lower left; NaN where there is none.
        texture: the texture of each, or -1. Where there is one it replaces, in glTF multiplies, the corners' colour.
        textures: what these are.
        multiplied: whether corners hold linear factors of the texture's colours, as in glTF.
        missing: what the file names and is not there, or cannot be read: "the texture bark.png" and the like.
    """

    corners: Float[Array, "F 3 3"]
    uv: Float[Array, "F 3 2"]
    texture: Int[NDArray[np.int64], " F"]
    textures: tuple[Texture, ...]
    multiplied: bool
    missing: tuple[str, ...]

    @property
    def known(self) -> Bool[NDArray[np.bool_], " F"]:
        """Which triangles have a colour."""
        known: NDArray[np.bool_] = (self.texture != NO_TEXTURE) | np.isfinite(self.corners).all((1, 2))
        return known

    def at(self, face: Int[NDArray[np.int64], " N"], shares: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
        """The colours of points of triangles, by their barycentric coordinates; NaN where there is none."""
        color = np.einsum("nk,nkc->nc", shares, self.corners[face])
        uv = np.einsum("nk,nkc->nc", shares + INWARDS * (1 / 3 - shares), self.uv[face])
        for number, texture in enumerate(self.textures):
            row = np.flatnonzero(self.texture[face] == number)
            height, width = texture.picture.shape[:2]
            x = _texels(uv[row, 0], width, texture.wrap[0])
            y = _texels(1.0 - uv[row, 1], height, texture.wrap[1])
            texel = texture.picture[y, x] / 255.0
            color[row] = color[row] * to_linear(texel) if self.multiplied else texel
        return to_srgb(color) if self.multiplied else color


def _texels(place: Float[Array, " N"], count: int, wrap: Wrap) -> Int[NDArray[np.int64], " N"]:
    """Which of so many texels of a row lie at places, of which [0, 1] is the whole row."""
    if wrap == "clamp":
        place = np.clip(place, 0, 1)
    elif wrap == "mirror":
        place = 1 - np.abs(1 - np.mod(place, 2.0))
    else:
        place = np.mod(place, 1.0)
    return np.minimum(np.floor(place * count).astype(np.int64), count - 1)


def to_linear(color: Float[Array, "*N C"]) -> Float[Array, "*N C"]:
    """From sRGB (IEC 61966-2-1)."""
    linear: Array = np.where(color <= 0.04045, color / 12.92, ((np.maximum(color, 0) + 0.055) / 1.055) ** 2.4)
    return linear


def to_srgb(color: Float[Array, "*N C"]) -> Float[Array, "*N C"]:
    """From linear light."""
    clamped = np.clip(color, 0, 1)
    encoded: Array = np.where(clamped <= 0.0031308, 12.92 * clamped, 1.055 * clamped ** (1 / 2.4) - 0.055)
    return encoded


class Pictures:
    """Textures of a file as they are met: each is decoded once."""

    def __init__(self) -> None:
        """Has none yet."""
        self.textures: list[Texture] = []
        self._numbers: dict[tuple[object, tuple[Wrap, Wrap]], int] = {}

    def number(self, key: object, content: bytes, wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")) -> int:
        """Which texture a picture is, or `NO_TEXTURE` where it is no picture.

        Args:
            key: what tells the picture from others of the file.
            content: of the picture's file.
            wrap: as of `Texture`.

        Raises:
            ValueError: another kind of picture, more pixels than are read, or a broken one.
        """
        if (key, wrap) not in self._numbers:
            before = sum(texture.picture.shape[0] * texture.picture.shape[1] for texture in self.textures)
            known = next((n for (other, _), n in self._numbers.items() if other == key), None)
            picture = _decoded(content, before) if known is None else self.textures[known].picture
            if picture is None:
                return NO_TEXTURE
            self._numbers[key, wrap] = len(self.textures)
            self.textures.append(Texture(picture, wrap))
        return self._numbers[key, wrap]


def _decoded(content: bytes, before: int) -> NDArray[np.uint8] | None:
    """The pixels of a picture's file, with so many of others before; None where it is no picture."""
    from PIL import Image

    with warnings.catch_warnings():
        # Pillow warns of large pictures below the bound of ours.
        warnings.simplefilter("ignore")
        try:
            picture = Image.open(io.BytesIO(content))
        # Broken files make pillow raise nearly anything.
        except Exception:
            return None
        width, height = picture.size
        if picture.format not in PICTURES:
            raise ValueError(f"a texture is of the kind {picture.format}, only {', '.join(PICTURES)} are read")
        if width * height + before > MAX_PIXELS:
            raise ValueError(f"textures have more than the {MAX_PIXELS} pixels that are read: {width} x {height}")
        try:
            return np.asarray(picture.convert("RGB"), np.uint8)
        except Exception as error:
            raise ValueError(f"a texture of {width} x {height} cannot be read ({error})") from error
