"""Surfaces from files of triangle meshes."""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

from diff3ds.formats.cad.solids import SOLIDS
from diff3ds.formats.mesh import UP_IS_KNOWN, MeshFile, read_mesh
from diff3ds.formats.mesh_files.polygons import counted
from diff3ds.formats.mesh_files.strays import strays
from diff3ds.surfaces.shape.colors import SurfaceColors
from diff3ds.surfaces.shape.triangle_mesh import CREASE, TriangleMesh


def load_surface(path: str | Path, *, up: str = "z", crease: float = CREASE) -> TriangleMesh:
    """The surface in a mesh file (OBJ, STL, PLY, OFF, glTF), in the file's own units, or of solids.

    The soup of triangles that STL files are is welded; open meshes, several objects and edges of many faces are taken
    as they are. glTF says what is up; it comes with z up and x in front. Pieces without extent of their own, far from
    the rest, are left out; this, and what else of a file is left out, is said in a warning. STEP, IGES and BREP files
    (extra `cad`) come in millimetres, with the normals and edges of their own faces whatever the crease.

    Args:
        up: the axis that points up in files of the other formats, "z" or "y"; what is seen has z up.
        crease: as of `TriangleMesh`.

    Raises:
        ValueError: another suffix; larger than 256 MiB or 8 million triangles, broken, without triangles of any area or
            with coordinates that are not finite; another axis.
        OSError: the file cannot be read.
        ImportError: solids, and the extra `cad` is not installed.
    """
    path = Path(path)
    if path.suffix.lower() in SOLIDS:
        # With scipy, which the import of the package does without.
        from diff3ds.surfaces.form.solid_mesh import load_solid

        _check_up(up)
        return load_solid(path, up).mesh
    return _surface(path, up, crease, False)[0]


def load_colored_surface(
    path: str | Path, *, up: str = "z", crease: float = CREASE
) -> tuple[TriangleMesh, SurfaceColors]:
    """As `load_surface`, with the colours of its faces.

    Raises:
        ValueError, OSError: as `load_surface`; no face of the file has a colour.
    """
    path = Path(path)
    mesh, read = _surface(path, up, crease, True)
    assert read.colors is not None
    if not read.colors.known.any():
        lost = f"; {', '.join(read.colors.missing)} cannot be read beside it" if read.colors.missing else ""
        raise ValueError(
            f"{path}: no face has a colour{lost}: colours are read from OBJ (materials, textures, vertices), PLY "
            "(vertices, faces, textures), glTF, OFF and binary STL"
        )
    return mesh, SurfaceColors(read.colors, mesh.source, read.vertices[read.faces[mesh.source]])


def _surface(path: Path, up: str, crease: float, colors: bool) -> tuple[TriangleMesh, MeshFile]:
    _check_up(up)
    read = _without_strays(path, read_mesh(path, colors))
    if up == "y" and path.suffix.lower() not in UP_IS_KNOWN:
        read = replace(read, vertices=read.vertices[:, [2, 0, 1]])
    try:
        return TriangleMesh(read.vertices, read.faces, read.part, crease, read.polygon), read
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _check_up(up: str) -> None:
    if up not in ("y", "z"):
        raise ValueError(f'up must be "y" or "z", got {up!r}')


def _without_strays(path: Path, read: MeshFile) -> MeshFile:
    """What a file holds but for tiny pieces that are far away from the rest."""
    away = strays(read.vertices, read.faces)
    if not away.any():
        return read
    warnings.warn(
        f"{path}: left out: {counted(int(away.sum()), 'face')} far away from the rest, less than a 100,000th of it",
        stacklevel=4,
    )
    rows = np.flatnonzero(~away)
    colors = read.colors
    if colors is not None:
        colors = replace(colors, corners=colors.corners[rows], uv=colors.uv[rows], texture=colors.texture[rows])
    return MeshFile(read.vertices, read.faces[rows], read.polygon[rows], read.part[rows], colors)
