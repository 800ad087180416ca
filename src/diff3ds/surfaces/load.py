"""Surfaces from files of triangle meshes; needs the extra `mesh`."""

from pathlib import Path

from diff3ds.formats.mesh import UP_IS_KNOWN, load_parts
from diff3ds.surfaces.mesh import CREASE, TriangleMesh


def load_surface(path: str | Path, *, up: str = "z", crease: float = CREASE) -> TriangleMesh:
    """The surface in a mesh file (OBJ, STL, PLY, OFF, GLB), in the file's own units.

    The soup of triangles that STL files are is welded; open meshes, several objects and edges of many faces are taken
    as they are. glTF says what is up; it comes with z up and x in front.

    Args:
        up: the axis that points up in files of the other formats, "z" or "y"; what is seen has z up.
        crease: as of `TriangleMesh`.

    Raises:
        ImportError: the extra `mesh` is not installed.
        ValueError: another suffix; larger than 256 MiB or 8 million triangles, broken, without triangles of any area or
            with coordinates that are not finite; another axis.
        OSError: the file cannot be read.
    """
    if up not in ("y", "z"):
        raise ValueError(f'up must be "y" or "z", got {up!r}')
    path = Path(path)
    vertices, faces, part = load_parts(path)
    if up == "y" and path.suffix.lower() not in UP_IS_KNOWN:
        vertices = vertices[:, [2, 0, 1]]
    try:
        return TriangleMesh(vertices, faces, part, crease)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
