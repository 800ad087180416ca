"""A folder of the user's own sketches as a library: its files are members, their names say what they are."""

import hashlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import torch

from diff3ds.bezier import MAX_DEGREE, elevate
from diff3ds.formats import load
from diff3ds.library.members import fill_ball
from diff3ds.sketch import Sketch
from diff3ds.tasks.folder_phrase import Name, named

SKETCHES = (".json", ".step", ".stp")
MESHES = (".3mf", ".dae", ".fbx", ".glb", ".gltf", ".obj", ".off", ".ply", ".stl", ".usd", ".usda", ".usdc", ".usdz")
# Bounds: every step draws all members four times. Some 20,000 strokes take half a second a step on two cores.
MOST_FILES, MOST_BYTES, MOST_STROKES, MOST_STROKES_IN_ALL = 500, 1 << 24, 2000, 20_000
# Of a sketch, relative to its farthest coordinate: some steps of float32.
LEAST_EXTENT = 1e-6
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


@dataclass(frozen=True, eq=False)
class SketchFolder:
    """What a folder holds.

    Attributes:
        path: as it was given.
        members: in the order of their files' names.
        passed: names of files that are no sketches by their suffix.
        digest: SHA-256 of the members' places and bytes.
    """

    path: Path
    members: tuple[FolderMember, ...]
    passed: tuple[str, ...]
    digest: str

    @property
    def names(self) -> tuple[Name, ...]:
        """What the members are."""
        return tuple(member.name for member in self.members)

    @property
    def identity(self) -> dict[str, object]:
        """What a resumed run must share, in the types of JSON."""
        return {"library": str(self.path), "library_sha256": self.digest}

    def __str__(self) -> str:
        """In words."""
        counts = Counter(name.noun for name in self.names)
        kinds = ", ".join(f"{noun} ({count})" for noun, count in sorted(counts.items()))
        rest = [*self.passed[:SAID], *(["..."] if len(self.passed) > SAID else [])]
        passed = f"; passed over, for they are no sketches: {', '.join(rest)}" if rest else ""
        return f"{len(self.members)} sketches in {self.path}: {kinds}{passed}"


def identity_of(folder: SketchFolder | None) -> dict[str, object]:
    """What a resumed run must share: the folder and its members, or that there is none."""
    return {"library": None, "library_sha256": None} if folder is None else folder.identity


def read_sketches(path: Path) -> SketchFolder:
    """Reads the sketches in a folder and in its sub-folders; hidden files are left alone.

    Raises:
        ValueError: no folder, no sketches or too many, a mesh, a sub-folder in a sub-folder, a file without a name, one
            that is too large or no sketch; the message names the file.
        OSError: a file cannot be read.
        ImportError: there are STEP files, and not the extra that reads them.
    """
    if not path.is_dir():
        raise ValueError(f"a library is a folder of sketches ({', '.join(SKETCHES)}), and {path} is none")
    files = list(_files(path))
    for file in files:
        if file.suffix.lower() in MESHES:
            raise ValueError(
                f"{file}: a mesh, and the members of a library are sketches ({', '.join(SKETCHES)}): put its feature "
                "lines there, as a STEP file of its edges or as what diff3ds views makes of its pictures"
            )
    sketches = [file for file in files if file.suffix.lower() in SKETCHES]
    if not 0 < len(sketches) <= MOST_FILES:
        raise ValueError(
            f"{path} holds {len(sketches) or 'no'} sketches ({', '.join(SKETCHES)}): a library has 1 to {MOST_FILES}"
        )
    names = [_named(file, path) for file in sketches]
    digest, members, strokes = hashlib.sha256(), [], 0
    for file, name in zip(sketches, names, strict=True):
        sketch = _member(file)
        strokes += len(sketch)
        if strokes > MOST_STROKES_IN_ALL:
            raise ValueError(f"{path}: more than {MOST_STROKES_IN_ALL} strokes in all: take some sketches out")
        members.append(FolderMember(sketch, name))
        digest.update(
            f"{file.relative_to(path).as_posix()}\0{hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode()
        )
    passed = tuple(file.name for file in files if file.suffix.lower() not in SKETCHES)
    return SketchFolder(path, tuple(members), passed, digest.hexdigest())


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
    """What a file is: the name of its sub-folder, or its own."""
    said = file.stem if file.parent == root else file.parent.name
    name = named(said)
    if name is None:
        raise ValueError(
            f"{file}: {said!r} does not say what it is: name it so (chair_01{file.suffix}, or chair/01{file.suffix})"
        )
    return name


def _member(file: Path) -> Sketch:
    """A sketch in the unit ball."""
    size = file.stat().st_size
    if size > MOST_BYTES:
        raise ValueError(f"{file}: {size} bytes are more than the {MOST_BYTES} that a member of a library may have")
    try:
        sketch = load(file)
    except ImportError as error:
        raise ImportError(f"{file}: {error}") from error
    if not 0 < len(sketch) <= MOST_STROKES:
        raise ValueError(f"{file}: {len(sketch)} strokes; a member of a library has 1 to {MOST_STROKES}")
    points = sketch.detach().points.double()
    # Of any size: squares of large numbers are none.
    points = points / points.abs().max().clamp(min=torch.finfo(torch.float64).tiny)
    if not (points.amax((0, 1)) - points.amin((0, 1))).max() > LEAST_EXTENT:
        raise ValueError(f"{file}: all strokes are one point, and cannot be brought to the size of the unit ball")
    points, weights = elevate(points, sketch.weights.double(), MAX_DEGREE)
    filled = fill_ball(torch.cat([points * weights[..., None], weights[..., None]], -1))
    return replace(filled, opacity=sketch.opacity.float())
