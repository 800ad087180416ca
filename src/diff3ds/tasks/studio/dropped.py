"""What is dropped on the studio: files come into its folder under safe names, and what they are is found out."""

import os
import re
import shutil
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from diff3ds.formats.cad.solids import SOLIDS
from diff3ds.formats.clouds.read_cloud import CLOUDS
from diff3ds.formats.mesh import MESHES
from diff3ds.frames import SUFFIXES

SOURCES = "sources"
# What belongs together has a name that the page makes up.
GROUP = re.compile(r"[0-9a-f]{16}")
# Files of a drop, folders in folders, letters of a name, and bytes that a zip may unpack to: a folder of photographs
# has hundreds of files of 10 MB.
MOST_FILES, DEEPEST, LONGEST, MOST_UNPACKED = 5000, 8, 150, 1 << 33
# Read as a sketch, which needs no making.
SKETCHES = (".json", ".dxf", ".3dm", ".usd", ".usda", ".usdc", ".usdz")
PICTURES = (*{suffix.lower() for suffix in SUFFIXES}, ".svg", ".webp", ".gif", ".bmp", ".tif", ".tiff", ".psd")
# What cameras write.
PHOTOGRAPHS = (".jpg", ".jpeg", ".heic", ".heif", ".avif")
# What comes with a mesh.
BESIDE = (".mtl", ".bin", *PICTURES)
# What no name has on every system.
_STRANGE = re.compile(r'[\x00-\x1f\\:*?"<>|]')
# Of the beginning of a file, to see what it holds.
HEAD = 1 << 16


@dataclass(frozen=True)
class Dropped:
    """What something that was dropped is.

    Attributes:
        what: in words.
        title: what it is called.
        command: of diff3ds that draws it; "" of a sketch, which is there.
        source: the file or folder.
        options: of the command besides.
    """

    what: str
    title: str
    command: str
    source: Path
    options: dict[str, Any] = field(default_factory=dict)


def take(out: Path, group: str, name: str, file: Path) -> None:
    """Moves a file that came into the studio's folder, under the name that it had, which is checked.

    Args:
        out: the folder of the studio.
        group: what it belongs to.
        name: its name, or its path in a folder that was dropped.
        file: where it lies.

    Raises:
        ValueError: a name that leads elsewhere, or one file too many.
        OSError: it cannot be moved.
    """
    folder = folder_of(out, group)
    target = folder / _safe(name)
    if folder.is_dir() and sum(len(files) for _, _, files in os.walk(folder)) >= MOST_FILES:
        raise ValueError(f"at most {MOST_FILES} files are taken at a time")
    target.parent.mkdir(parents=True, exist_ok=True)
    file.replace(target)


def folder_of(out: Path, group: str) -> Path:
    """Where the files of a drop lie.

    Raises:
        ValueError: no such name.
    """
    if not GROUP.fullmatch(group):
        raise ValueError(f"{group!r} names nothing that was dropped")
    return out / SOURCES / group


def _safe(name: str) -> PurePosixPath:
    parts = name.split("/")
    good = all(
        part.strip(" .") and len(part) <= LONGEST and not re.search(r'[\x00-\x1f\\:*?"<>|]', part) for part in parts
    )
    if not good or len(parts) > DEEPEST:
        raise ValueError(f"a file cannot be called {name[:LONGEST]!r} here: give it a plain name")
    return PurePosixPath(*parts)


def what_is(out: Path, group: str) -> Dropped:
    """Finds out what was dropped.

    Raises:
        ValueError: it is nothing that can be drawn, with what can.
        OSError: it cannot be read.
    """
    folder = folder_of(out, group)
    files = _files(folder)
    if not files:
        raise ValueError("nothing has come: drop the file once more")
    if len(files) == 1 and files[0].suffix.lower() == ".zip":
        archive, title = files[0], files[0].stem
        _unpack(archive, folder)
        archive.unlink()
        files = _files(folder)
        if len(files) > 1:
            return _of_folder(folder, files, title)
    return _of_file(files[0]) if len(files) == 1 else _of_folder(folder, files, "")


def _files(folder: Path) -> list[Path]:
    """The files of a drop, without what systems put beside them."""
    found = [path for path in sorted(folder.rglob("*")) if path.is_file() and not path.is_symlink()]
    return [path for path in found if "__MACOSX" not in path.parts and not path.name.startswith(("._", ".DS_"))]


def _of_file(file: Path) -> Dropped:
    suffix, title = file.suffix.lower(), file.stem
    if suffix in PICTURES:
        return Dropped("a picture", title, "image", file)
    if suffix in SOLIDS and (suffix not in (".step", ".stp") or _holds(file, b"_FACE")):
        return Dropped("solids", title, "mesh", file)
    if suffix in MESHES and not (suffix == ".ply" and not _holds(file, b"element face")):
        return Dropped("a mesh", title, "mesh", file)
    if suffix in CLOUDS:
        return Dropped("a cloud of points", title, "points", file)
    if suffix in SKETCHES or suffix in SOLIDS:
        return Dropped("a sketch", title, "", file)
    raise ValueError(
        f"{file.name} is nothing that can be drawn here: drop a picture (PNG, JPEG, SVG), a mesh (OBJ, STL, PLY, OFF, "
        "GLB), solids (STEP, IGES), a cloud of points (PLY, XYZ, LAS), a sketch (sketch.json, DXF, 3DM, USD), or a "
        "folder or zip of photographs"
    )


def _holds(file: Path, word: bytes) -> bool:
    """Whether a word stands in a file: of a PLY in its head, of a STEP anywhere."""
    most = HEAD if file.suffix.lower() == ".ply" else 1 << 28
    with file.open("rb") as opened:
        before, read = b"", 0
        while read < most and (part := opened.read(min(1 << 20, most))):
            if word in before + part:
                return True
            before, read = part[-len(word) :], read + len(part)
    return False


def _of_folder(folder: Path, files: list[Path], title: str) -> Dropped:
    """A mesh with what comes with it, or photographs."""
    meshes = [file for file in files if file.suffix.lower() in MESHES and file.suffix.lower() != ".ply"]
    if len(meshes) == 1 and all(file == meshes[0] or file.suffix.lower() in BESIDE for file in files):
        return Dropped("a mesh", meshes[0].stem, "mesh", meshes[0])
    pictures = sum(file.suffix.lower() in PICTURES for file in files)
    if pictures < 3:
        raise ValueError(
            f"{len(files)} files, {pictures} of them pictures, make no set of photographs, which takes three and more: "
            "drop one thing at a time, or the whole folder"
        )
    inner = [path for path in folder.iterdir() if not path.name.startswith((".", "__MACOSX"))]
    root = inner[0] if len(inner) == 1 and inner[0].is_dir() else folder
    taken = sum(file.suffix.lower() in PHOTOGRAPHS for file in files)
    # Of photographs people want the lines; of drawings and renderings the command sees by itself what they are.
    options = {"target": "color-edges"} if 2 * taken > pictures else {}
    name = title or (root.name if root != folder else "photographs")
    return Dropped(f"{pictures} {'photographs' if options else 'pictures'} of one thing", name, "views", root, options)


def _unpack(archive: Path, folder: Path) -> None:
    """Unpacks a zip beside itself, with bounds.

    Raises:
        ValueError: it is no zip, is too large, or has names that lead elsewhere.
    """
    try:
        with zipfile.ZipFile(archive) as opened:
            members = [member for member in opened.infolist() if not member.is_dir()]
            _check_size(members)
            for member in members:
                target = folder / _safe(member.filename)
                target.parent.mkdir(parents=True, exist_ok=True)
                with opened.open(member) as source, target.open("wb") as written:
                    # No more than the zip says: it is read by that.
                    shutil.copyfileobj(source, written, 1 << 20)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError) as error:
        raise ValueError(f"{archive.name} is no zip that can be unpacked ({error})") from error


def _check_size(members: Iterable[zipfile.ZipInfo]) -> None:
    sizes = [member.file_size for member in members]
    if len(sizes) > MOST_FILES or sum(sizes) > MOST_UNPACKED:
        raise ValueError(
            f"the zip unpacks to {len(sizes)} files of {sum(sizes)} bytes: at most {MOST_FILES} files of "
            f"{MOST_UNPACKED} bytes are taken"
        )
