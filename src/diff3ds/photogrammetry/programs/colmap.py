"""COLMAP's models, text and binary: cameras, images and points3D."""

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diff3ds._files import read_text
from diff3ds._shapes import Float, Tensor
from diff3ds.photogrammetry.programs.colmap_lenses import MODELS, camera_of
from diff3ds.photogrammetry.shot import Shot, finite_points, picture_size, quaternion_pose

# A model of a thousand pictures takes some 200 MB; more is taken for a mistake or an attack.
MAX_BYTES = 1 << 31
# How far the length of a quaternion that was written with few digits may be from 1; that of anything else is not near.
ROUNDING = 0.01
# Characters of a file name.
LONGEST_NAME = 4096


@dataclass(frozen=True)
class _Camera:
    """As files have it."""

    model: str
    width: int
    height: int
    parameters: tuple[float, ...]


@dataclass(frozen=True)
class _Image:
    """As files have it: the pose is world to camera, with OpenCV axes."""

    camera: int
    quaternion: tuple[float, ...]
    translation: tuple[float, ...]
    name: str


def is_model(folder: Path) -> bool:
    """Whether a folder holds a model."""
    return any((folder / f"cameras{end}").is_file() and (folder / f"images{end}").is_file() for end in (".bin", ".txt"))


def read_model(folder: Path) -> list[Shot]:
    """The registered pictures of a model, by name. Binary files are read where there are both.

    Raises:
        FileNotFoundError: files are missing.
        ValueError: a damaged file; a camera model that is not known; a picture of a camera that is not there.
    """
    binary = (folder / "images.bin").is_file() and (folder / "cameras.bin").is_file()
    end = ".bin" if binary else ".txt"
    cameras = dict(_cameras_binary(folder / f"cameras{end}") if binary else _cameras_text(folder / f"cameras{end}"))
    path = folder / f"images{end}"
    images = sorted(_images_binary(path) if binary else _images_text(path), key=lambda image: image.name)
    if not images:
        raise ValueError(f"{path}: no picture is registered in this model")
    lenses = {}
    for number in {image.camera for image in images}:
        if number not in cameras:
            raise ValueError(f"{path}: a picture was taken by camera {number}, which cameras{end} does not list")
        camera, where = cameras[number], f"{folder / f'cameras{end}'}: camera {number}"
        size = picture_size(where, camera.width, camera.height)
        lenses[number] = (size, camera_of(where, camera.model, camera.parameters))
    shots = []
    for image in images:
        size, (intrinsics, lens) = lenses[image.camera]
        pose = quaternion_pose(f"{path}: {image.name}", image.quaternion, image.translation)
        shots.append(Shot(image.name, size, pose, intrinsics, lens))
    return shots


def read_points(folder: Path) -> Float[Tensor, "P 3"]:
    """The points of a model, float64; none if it has no such file.

    Raises:
        ValueError: a damaged file.
    """
    binary, text = folder / "points3D.bin", folder / "points3D.txt"
    found: list[tuple[float, ...]] = []
    if binary.is_file():
        data = _Binary(binary)
        for _ in range(data.count(51)):
            _, *place = data.take("<Qddd")
            data.take("<BBBd")
            data.skip(8 * data.take("<Q")[0])
            found.append(tuple(place))
    elif text.is_file():
        found = [_numbers(text, line, words[1:4], 3) for line, words in _lines(text)]
    return finite_points(found)


def _cameras_text(path: Path) -> Iterator[tuple[int, _Camera]]:
    for line, words in _lines(path):
        if len(words) < 5:
            raise ValueError(f"{path}, line {line}: expected CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS, got {words}")
        number, width, height = (_whole(path, line, word) for word in (words[0], *words[2:4]))
        yield number, _Camera(words[1], width, height, _numbers(path, line, words[4:], len(words) - 4))


def _images_text(path: Path) -> Iterator[_Image]:
    """Two lines a picture, of which the second lists its points and may be empty; some writers leave it out."""
    lines = read_text(path).splitlines()
    start = 0
    while start < len(lines):
        text = lines[start].strip()
        start += 1
        if not text or text.startswith("#"):
            continue
        # A name may have spaces.
        words = text.split(maxsplit=9)
        if len(words) < 10:
            raise ValueError(
                f"{path}, line {start}: expected IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME, is {text!r:.60}"
            )
        pose = _numbers(path, start, words[1:8], 7)
        if not abs(math.hypot(*pose[:4]) - 1) < ROUNDING:
            raise ValueError(
                f"{path}, line {start}: expected a picture, whose QW, QX, QY, QZ have length 1, is {text!r:.60}"
            )
        yield _Image(_whole(path, start, words[8]), pose[:4], pose[4:], words[9])
        if start < len(lines) and (not lines[start].strip() or _lists_points(lines[start])):
            start += 1


def _lists_points(line: str) -> bool:
    """Whether a line has X, Y and POINT3D_ID of points: threes of numbers. That of a picture has ten words or more."""
    words = line.split()
    try:
        return len(words) % 3 == 0 and all(math.isfinite(float(word)) for word in words[:12])
    except ValueError:
        return False


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Lines with their numbers, in words, without comments."""
    for number, line in enumerate(read_text(path).splitlines(), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, line.split()


def _whole(path: Path, line: int, word: str) -> int:
    try:
        return int(word)
    except ValueError as error:
        raise ValueError(f"{path}, line {line}: expected a whole number, got {word!r:.40}") from error


def _numbers(path: Path, line: int, words: list[str], count: int) -> tuple[float, ...]:
    try:
        found = tuple(float(word) for word in words)
    except ValueError as error:
        raise ValueError(f"{path}, line {line}: expected numbers, got {' '.join(words)!r:.80}") from error
    if len(found) != count:
        raise ValueError(f"{path}, line {line}: expected {count} numbers, got {len(found)}")
    return found


class _Binary:
    """A binary file, read from its beginning on, never beyond its end."""

    def __init__(self, path: Path) -> None:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise ValueError(f"{path}: {size} bytes are more than the {MAX_BYTES} that are read")
        self._path, self._data, self._at = path, path.read_bytes(), 0

    def take(self, form: str) -> tuple[Any, ...]:
        length = struct.calcsize(form)
        self._need(length)
        found = struct.unpack_from(form, self._data, self._at)
        self._at += length
        return found

    def count(self, least: int) -> int:
        """A number of items that take at least so many bytes each."""
        (found,) = self.take("<Q")
        self._need(int(found) * least)
        return int(found)

    def skip(self, length: int) -> None:
        self._need(length)
        self._at += length

    def name(self) -> str:
        end = self._data.find(b"\0", self._at, self._at + LONGEST_NAME)
        if end < 0:
            raise ValueError(f"{self._path}: damaged, no file name at byte {self._at}")
        found = self._data[self._at : end].decode("utf-8", "replace")
        self._at = end + 1
        return found

    def _need(self, length: int) -> None:
        if self._at + length > len(self._data):
            raise ValueError(
                f"{self._path}: damaged, it ends at byte {len(self._data)} where {self._at + length} were expected"
            )


def _cameras_binary(path: Path) -> Iterator[tuple[int, _Camera]]:
    data = _Binary(path)
    for _ in range(data.count(24)):
        number, model, width, height = (int(n) for n in data.take("<iiQQ"))
        if model not in MODELS:
            raise ValueError(f"{path}: camera {number} has model {model}, which is not known (0 to {max(MODELS)} are)")
        name, count = MODELS[model]
        yield number, _Camera(name, width, height, tuple(float(n) for n in data.take(f"<{count}d")))


def _images_binary(path: Path) -> Iterator[_Image]:
    data = _Binary(path)
    for _ in range(data.count(73)):
        _, *pose, camera = data.take("<i7di")
        numbers = tuple(float(n) for n in pose)
        name = data.name()
        data.skip(24 * data.count(24))
        yield _Image(int(camera), numbers[:4], numbers[4:], name)
