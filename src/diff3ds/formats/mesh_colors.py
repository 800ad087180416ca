"""Colours that a mesh file gives to its faces: of vertices, faces and materials, and textures."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Bool, Float, Int
from diff3ds.formats.png import MAX_PIXELS

# Kinds of pictures that are decoded: others, such as PostScript, have programs run.
PICTURES = ("PNG", "JPEG", "WEBP", "BMP", "TGA", "TIFF", "GIF")
# Textures are looked up by so much nearer to the middle of a triangle: at its edge the next texel is another's.
INWARDS = 1e-3
_NONE = -1


@dataclass(frozen=True, eq=False)
class MeshColors:
    """Colours of triangles, sRGB in [0, 1].

    Attributes:
        corners: at the corners of each, in the order of its vertices; NaN where the file gives none.
        uv: places of the corners in the texture, (0, 0) at the lower left; NaN where there is none.
        texture: the texture of each, or -1. Where there is one it replaces, in glTF multiplies, the corners' colour.
        textures: pictures, 8 bits a channel.
        multiplied: whether corners hold linear factors of the texture's colours, as in glTF.
        missing: what the file names and is not there, or cannot be read: "the texture bark.png" and the like.
    """

    corners: Float[Array, "F 3 3"]
    uv: Float[Array, "F 3 2"]
    texture: Int[NDArray[np.int64], " F"]
    textures: tuple[NDArray[np.uint8], ...]
    multiplied: bool
    missing: tuple[str, ...]

    @property
    def known(self) -> Bool[NDArray[np.bool_], " F"]:
        """Which triangles have a colour."""
        known: NDArray[np.bool_] = (self.texture != _NONE) | np.isfinite(self.corners).all((1, 2))
        return known

    def at(self, face: Int[NDArray[np.int64], " N"], shares: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
        """The colours of points of triangles, by their barycentric coordinates; NaN where there is none."""
        color = np.einsum("nk,nkc->nc", shares, self.corners[face])
        uv = np.einsum("nk,nkc->nc", shares + INWARDS * (1 / 3 - shares), self.uv[face])
        for number, picture in enumerate(self.textures):
            row = np.flatnonzero(self.texture[face] == number)
            height, width = picture.shape[:2]
            # Textures repeat beyond their borders.
            x = np.floor(np.mod(uv[row, 0], 1.0) * width).astype(np.int64) % width
            y = np.floor(np.mod(1.0 - uv[row, 1], 1.0) * height).astype(np.int64) % height
            texel = picture[y, x] / 255.0
            color[row] = color[row] * to_linear(texel) if self.multiplied else texel
        return to_srgb(color) if self.multiplied else color


def to_linear(color: Float[Array, "*N C"]) -> Float[Array, "*N C"]:
    """From sRGB (IEC 61966-2-1)."""
    linear: Array = np.where(color <= 0.04045, color / 12.92, ((np.maximum(color, 0) + 0.055) / 1.055) ** 2.4)
    return linear


def to_srgb(color: Float[Array, "*N C"]) -> Float[Array, "*N C"]:
    """From linear light."""
    clamped = np.clip(color, 0, 1)
    encoded: Array = np.where(clamped <= 0.0031308, 12.92 * clamped, 1.055 * clamped ** (1 / 2.4) - 0.055)
    return encoded


class ColorReader:
    """Collects the colours of the meshes of a scene, as trimesh has read it."""

    def __init__(self, linear: bool) -> None:
        """Has none yet.

        Args:
            linear: whether colours of vertices and materials are linear light, as in glTF.
        """
        self._linear = linear
        self._parts: list[tuple[Array, Array, NDArray[np.int64]]] = []
        self._pictures: list[Any] = []
        self._textures: list[NDArray[np.uint8]] = []

    def add(self, mesh: Any, flipped: bool) -> None:
        """The next mesh.

        Args:
            flipped: its triangles are wound the other way round.

        Raises:
            ValueError: a texture that cannot be read, or colours of other faces than there are.
        """
        count = len(mesh.faces)
        uv, texture = np.full((count, 3, 2), np.nan), np.full(count, _NONE)
        corners = self._plain(mesh)
        material = getattr(mesh.visual, "material", None)
        picture = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
        places = getattr(mesh.visual, "uv", None)
        # A picture of no format comes from no file: trimesh makes it up where a material is missing.
        if getattr(picture, "format", None) and places is not None and len(places) == len(mesh.vertices):
            uv = np.asarray(places, np.float64)[mesh.faces]
            texture[np.isfinite(uv).all((1, 2))] = self._number(picture)
            if self._linear:
                corners = np.where(np.isfinite(corners), corners, 1.0)
        order = [2, 1, 0] if flipped else [0, 1, 2]
        self._parts.append((corners[:, order], uv[:, order], texture))

    def colors(self, missing: tuple[str, ...]) -> MeshColors:
        """All of them, in the order in which they were added."""
        columns = (np.concatenate(column) for column in zip(*self._parts, strict=True))
        corners, uv, texture = columns
        return MeshColors(corners, uv, texture, tuple(self._textures), self._linear, missing)

    def _plain(self, mesh: Any) -> Float[Array, "F 3 3"]:
        """Colours without a texture: of vertices or faces, times the material's; NaN where there are none."""
        faces, visual = np.asarray(mesh.faces), mesh.visual
        found = np.full((len(faces), 3, 3), np.nan)
        material = getattr(visual, "material", None)
        if material is None:
            if visual.kind == "vertex":
                found = _shares(visual.vertex_colors)[faces]
            elif visual.kind == "face":
                found = np.repeat(_of_faces(_shares(visual.face_colors), faces)[:, None], 3, 1)
            return found
        # What trimesh makes up for materials without a colour is none.
        own = getattr(material, "baseColorFactor", None)
        if own is None and "kd" in getattr(material, "kwargs", {}):
            own = material.diffuse
        if own is not None:
            found[:] = _shares(np.asarray(own)[None])[0]
        for values in (mesh.vertex_attributes.get("color"), visual.vertex_attributes.get("color")):
            if values is not None and len(values) == len(mesh.vertices):
                factor = np.where(np.isfinite(found), found, 1.0) if self._linear else 1.0
                return np.asarray(_shares(np.asarray(values))[faces] * factor)
        return found

    def _number(self, picture: Any) -> int:
        """Which texture a picture is; it is decoded where it is met first."""
        for number, known in enumerate(self._pictures):
            if known is picture:
                return number
        self._pictures.append(picture)
        self._textures.append(_decoded(picture, sum(t.shape[0] * t.shape[1] for t in self._textures)))
        return len(self._textures) - 1


def _decoded(picture: Any, before: int) -> NDArray[np.uint8]:
    """An opened picture's pixels, with so many of others before.

    Raises:
        ValueError: another kind of picture, too many pixels, or a broken one.
    """
    width, height = picture.size
    if picture.format not in PICTURES:
        raise ValueError(f"a texture is of the kind {picture.format}, only {', '.join(PICTURES)} are read")
    if width * height + before > MAX_PIXELS:
        raise ValueError(f"textures have more than the {MAX_PIXELS} pixels that are read: {width} x {height}")
    try:
        return np.asarray(picture.convert("RGB"), np.uint8)
    # Broken files make pillow's decoders raise nearly anything.
    except Exception as error:
        raise ValueError(f"a texture of {width} x {height} cannot be read ({error})") from error


def _shares(values: Any) -> Float[Array, "N 3"]:
    """RGB in [0, 1] of RGB or RGBA values: whole numbers are shares of the largest one of their type."""
    colors = np.asarray(values)
    if colors.ndim != 2 or colors.shape[1] < 3:
        raise ValueError(f"colours must be RGB or RGBA, got an array of shape {colors.shape}")
    most = np.iinfo(colors.dtype).max if np.issubdtype(colors.dtype, np.integer) else 1
    return np.clip(colors[:, :3].astype(np.float64) / most, 0, 1)


def _of_faces(colors: Float[Array, "P 3"], faces: NDArray[np.int64]) -> Float[Array, "F 3"]:
    """Colours of triangles from those of the file's faces: triangles, or quadrangles that trimesh has cut in two."""
    count = len(colors)
    if count == len(faces):
        return colors
    one, other = faces[:count], faces[count:]
    if len(other) == count and (one[:, [2, 0]] == other[:, [0, 2]]).all():
        return np.concatenate([colors, colors])
    raise ValueError(
        f"{count} colours are of faces of which some have more than three corners, {len(faces)} triangles: "
        "save it with triangles or with colours of vertices"
    )
