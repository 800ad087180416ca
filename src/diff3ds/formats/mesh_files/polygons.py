"""What every reader of a mesh file gives: faces of any number of corners, and what their corners look like."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.formats.mesh_colors import NO_TEXTURE, Texture
from diff3ds.formats.mesh_files.same_rows import different

# Triangles, vertices and corners; a scene that shows one mesh many times has more than are in the file.
MOST = 1 << 23


@dataclass(frozen=True, eq=False)
class Paint:
    """Colours of polygons.

    Attributes:
        color: of each corner, sRGB in [0, 1], in glTF linear light; NaN where there is none.
        uv: of each corner, the place in its texture, (0, 0) at the lower left; NaN where there is none.
        texture: of each polygon, or `NO_TEXTURE`.
        textures: what these are.
        multiplied: whether colours are factors of the texture's, in linear light, as in glTF.
        missing: what the file names and is not there: "the texture bark.png" and the like.
    """

    color: Float[Array, "C 3"]
    uv: Float[Array, "C 2"]
    texture: Int[Index, " P"]
    textures: tuple[Texture, ...] = ()
    multiplied: bool = False
    missing: tuple[str, ...] = ()

    @staticmethod
    def none(corners: int, polygons: int) -> "Paint":
        """Of polygons without colours."""
        return Paint(np.full((corners, 3), np.nan), np.full((corners, 2), np.nan), np.full(polygons, NO_TEXTURE))


@dataclass(frozen=True, eq=False)
class Polygons:
    """The faces of a file.

    Attributes:
        vertices: in the file's units and axes.
        corners: vertices of all faces, one face after the other.
        sizes: corners of each face.
        part: which object of the file each face is of.
        paint: colours, where they were asked for.
        left_out: what was passed over and should be said, in a sentence each.
    """

    vertices: Float[Array, "V 3"]
    corners: Int[Index, " C"]
    sizes: Int[Index, " P"]
    part: Int[Index, " P"]
    paint: Paint | None = None
    left_out: tuple[str, ...] = field(default=())


def check_corners(corners: Int[Index, " C"], vertices: int) -> None:
    """Raises ValueError for faces between vertices that there are not, or for more than is read."""
    if max(len(corners), vertices) > 3 * MOST:
        raise ValueError(f"{max(len(corners), vertices)} vertices or corners of faces are more than are read")
    wrong = np.flatnonzero((corners < 0) | (corners >= vertices))
    if len(wrong):
        raise ValueError(f"a face has vertex {corners[wrong[0]]} (counted from 0) of {vertices}")


def numbered_places(vertices: Float[Array, "V 3"]) -> Int[Index, " V"]:
    """A number for each vertex, the same for those in the very same place."""
    # -0 is 0.
    return different(list((vertices + 0.0).view(np.int64).T))[1]


def counted(number: int, one: str, many: str = "") -> str:
    """A number and what it counts."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def shares(colors: NDArray[Any]) -> Float[Array, "N 3"]:
    """Colours in [0, 1]: whole numbers are shares of the largest of their type, others where any is above 1 of 255."""
    values = np.asarray(colors, np.float64)
    if np.issubdtype(colors.dtype, np.integer):
        return np.clip(values / np.iinfo(colors.dtype).max, 0, 1)
    return np.clip(values / (255.0 if np.nan_to_num(values).max(initial=0) > 1 else 1.0), 0, 1)
