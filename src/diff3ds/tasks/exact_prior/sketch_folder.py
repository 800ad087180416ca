"""A folder of the user's own sketches and meshes as a library: its files are members, their names say what of."""

import hashlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from diff3ds.bezier import MAX_DEGREE, elevate
from diff3ds.curves.shapes.smooth_joints import sketch_of
from diff3ds.formats import load
from diff3ds.formats.mesh import MESHES
from diff3ds.library.members import fill_ball
from diff3ds.sketch import DEFAULT_WIDTH, PLAIN, Sketch, of_parts, parts_of
from diff3ds.surfaces.lines.feature_curves import feature_curves, outline_share
from diff3ds.surfaces.shape.load_surface import load_surface
from diff3ds.tasks.exact_prior.folder_phrase import Name, listed, named
from diff3ds.tasks.exact_prior.up_axis import Up

SKETCHES = (".json", ".step", ".stp")
READ = (*SKETCHES, *MESHES)
# What a folder of results holds beside its sketch.
RUN = "run.json"
# Of meshes that are not read.
OTHER_MESHES = (".3ds", ".3mf", ".blend", ".dae", ".fbx", ".gltf", ".usd", ".usda", ".usdc", ".usdz")
# Bounds (a stroke of several segments counts as so many): every step draws all members four times. 480 members with
# 11,700 strokes took half a second of two cores.
MOST_FILES, MOST_BYTES, MOST_STROKES, MOST_STROKES_IN_ALL = 500, 1 << 24, 2000, 20_000
# Of a sketch, relative to its farthest coordinate: some steps of float32.
LEAST_EXTENT = 1e-6
# Lines that draw less of a mesh's outlines are told of; of a cylinder as high as wide they draw .61. Empirical.
LEAST_OUTLINE = 0.5
# So large a share of the feature lines may end nowhere: of a machine part few do, of an animal most. Empirical.
MOST_LOOSE = 0.5
# So many names of files that are passed over are said.
SAID = 3


@dataclass(frozen=True, eq=False)
class FolderMember:
    """A sketch of a folder.

    Attributes:
        sketch: its shape and opacities, as a member of the library: float32 cubics, black, of the default width, in the
            unit ball.
        name: what it is.
    """

    sketch: Sketch
    name: Name

    def __reduce__(self) -> tuple[Any, ...]:
        """Hands a member to another process as arrays: torch would open a file a tensor, and a thousand are allowed."""
        tensors, rest = parts_of(self.sketch)
        return _unpacked, ({name: value.numpy() for name, value in tensors.items()}, rest, self.name)


def _unpacked(arrays: dict[str, Any], rest: dict[str, Any], name: Name) -> FolderMember:
    return FolderMember(of_parts({part: torch.from_numpy(array) for part, array in arrays.items()}, rest), name)


@dataclass(frozen=True, eq=False)
class SketchFolder:
    """What a folder holds.

    Attributes:
        path: as it was given.
        members: in the order of their files' names.
        passed: names of files that are neither sketches nor meshes by their suffix.
        digest: SHA-256 of the members' places and bytes, and of how meshes are turned.
        warnings: of meshes that their lines draw badly, a sentence each.
    """

    path: Path
    members: tuple[FolderMember, ...]
    passed: tuple[str, ...]
    digest: str
    warnings: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[Name, ...]:
        """The names of the members."""
        return tuple(member.name for member in self.members)

    @property
    def identity(self) -> dict[str, object]:
        """What a resumed run must share, in the types of JSON."""
        return {"library": str(self.path), "library_sha256": self.digest}

    def __str__(self) -> str:
        """Says it in words."""
        counts = Counter(name.noun for name in self.names)
        kinds = listed(f"{noun} ({count})" for noun, count in counts.items())
        rest = [*self.passed[:SAID], *(["..."] if len(self.passed) > SAID else [])]
        passed = f"; passed over, for they are no sketches: {', '.join(rest)}" if rest else ""
        return f"{len(self.members)} members in {self.path}: {kinds}{passed}"


def identity_of(folder: SketchFolder | None) -> dict[str, object]:
    """Names what a resumed run must share: the folder and its members, or that there is none."""
    return {"library": None, "library_sha256": None} if folder is None else folder.identity


def read_sketches(path: Path, up: Up = "z") -> SketchFolder:
    """Reads the sketches and meshes in a folder and in its sub-folders; hidden files are left alone.

    Args:
        up: the axis that points up in meshes of formats that do not say: all but glTF.

    Raises:
        ValueError: no folder, no members or too many, a sub-folder in a sub-folder, a file without a name, one that is
            too large, broken or no sketch, a mesh without feature lines; the message names the file.
        OSError: a file cannot be read.
        ImportError: there are STEP files or meshes, and not the extra that reads them.
    """
    if not path.is_dir():
        raise ValueError(f"a library is a folder of sketches or meshes ({', '.join(READ)}), and {path} is none")
    files = list(_files(path))
    for file in files:
        if file.suffix.lower() in OTHER_MESHES:
            raise ValueError(f"{file}: not a kind of mesh that is read: save it as one of {', '.join(MESHES)}")
    read = [file for file in files if file.suffix.lower() in READ and file.name != RUN]
    if not 0 < len(read) <= MOST_FILES:
        raise ValueError(
            f"{path} holds {len(read) or 'no'} sketches or meshes ({', '.join(READ)}): a library has 1 to {MOST_FILES}"
        )
    names = [_named(file, path) for file in read]
    digest, members, strokes, warnings = hashlib.sha256(), [], 0, []
    if up != "z":
        digest.update(f"up {up}\n".encode())
    for file, name in zip(read, names, strict=True):
        sketch, warning = _member(file, up)
        warnings += [warning] if warning else []
        strokes += len(sketch.points)
        if strokes > MOST_STROKES_IN_ALL:
            raise ValueError(f"{path}: more than {MOST_STROKES_IN_ALL} strokes in all: take some sketches out")
        members.append(FolderMember(sketch, name))
        digest.update(
            f"{file.relative_to(path).as_posix()}\0{hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode()
        )
    passed = tuple(file.name for file in files if file.suffix.lower() not in READ or file.name == RUN)
    return SketchFolder(path, tuple(members), passed, digest.hexdigest(), tuple(warnings))


def _files(folder: Path, deep: bool = False) -> Iterator[Path]:
    """Files of a folder, then of its sub-folders, each in the order of their names."""
    entries = sorted(entry for entry in folder.iterdir() if not entry.name.startswith("."))
    folders = [entry for entry in entries if entry.is_dir()]
    yield from (entry for entry in entries if not entry.is_dir())
    for inner in folders:
        if deep:
            raise ValueError(f"{inner}: a library has sub-folders of sketches, and no folders in them: move it up")
        yield from _files(inner, deep=True)


def _named(file: Path, root: Path) -> Name:
    """Reads what a file shows from the name of its sub-folder, or from its own."""
    said = file.stem if file.parent == root else file.parent.name
    name = named(said)
    if name is None:
        raise ValueError(
            f"{file}: {said!r} does not say what it is: name it so (chair_01{file.suffix}, or chair/01{file.suffix})"
        )
    return name


def _member(file: Path, up: Up) -> tuple[Sketch, str]:
    """A sketch in the unit ball, and a warning or nothing."""
    size = file.stat().st_size
    if size > MOST_BYTES:
        raise ValueError(f"{file}: {size} bytes are more than the {MOST_BYTES} that a member of a library may have")
    sketch, warning = _feature_lines(file, up) if file.suffix.lower() in MESHES else (_loaded(file), "")
    count, what = len(sketch.points), "strokes" if sketch.chains is None else "segments of strokes"
    if not 0 < count <= MOST_STROKES:
        raise ValueError(f"{file}: {count} {what}; a member of a library has 1 to {MOST_STROKES}")
    points = sketch.detach().points.double()
    # Of any size: squares of large numbers are none.
    points = points / points.abs().max().clamp(min=torch.finfo(torch.float64).tiny)
    if not (points.amax((0, 1)) - points.amin((0, 1))).max() > LEAST_EXTENT:
        raise ValueError(f"{file}: all strokes are one point, and cannot be brought to the size of the unit ball")
    points, weights = elevate(points, sketch.weights.double(), MAX_DEGREE)
    try:
        filled = fill_ball(torch.cat([points * weights[..., None], weights[..., None]], -1))
    except ValueError as error:
        raise ValueError(f"{file}: its numbers leave the range of float32 ({error})") from error
    shape = {"points": filled.points, "weights": filled.weights, "opacity": sketch.opacity.detach().float()}
    return sketch.replace(**shape, **PLAIN), warning


def _loaded(file: Path) -> Sketch:
    try:
        return load(file)
    except ImportError as error:
        raise ImportError(f"{file}: {error}") from error


def _feature_lines(file: Path, up: Up) -> tuple[Sketch, str]:
    mesh = load_surface(file, up=up)
    try:
        found = feature_curves(mesh, MOST_STROKES)
        if not len(found):
            raise ValueError("the mesh has no sharp edges and no borders: of smooth shapes there are no feature lines")
        if found.loose > MOST_LOOSE * found.runs:
            raise ValueError(
                f"the mesh is smooth: {found.loose} of its {found.runs} sharp edges end nowhere, and scraps are no "
                "drawing of it"
            )
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error
    sketch, fraction = sketch_of(found.curves, DEFAULT_WIDTH), outline_share(mesh)
    if fraction >= LEAST_OUTLINE:
        return sketch, ""
    return sketch, (
        f"warning: {file}: its sharp edges and borders draw {fraction:.0%} of its outlines; the others lie on its "
        "smooth parts and change with the view: they are not drawn"
    )
