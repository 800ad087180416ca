"""Bundler's bundle.out (version 0.3), which RealityCapture and Metashape write too, with its list of names."""

from collections.abc import Iterator
from pathlib import Path

import torch

from diff3ds._files import read_text
from diff3ds._shapes import Float, Tensor
from diff3ds.distortion import Distortion
from diff3ds.photogrammetry.shot import Shot, checked, finite_points, pinhole, rigid, warn_left_out

HEADER = "# Bundle file"
# Its cameras look along -z, with y up.
_AXES = torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0], dtype=torch.float64))


def is_bundle(path: Path) -> bool:
    """Whether a file begins like Bundler's."""
    with path.open("rb") as file:
        return file.read(64).startswith(HEADER.encode())


def read_bundle(path: Path) -> list[Shot]:
    """The registered cameras. Their principal points are the middles of the pictures, whose sizes are not told.

    Raises:
        FileNotFoundError: no list of names is beside it.
        ValueError: a damaged file, or another number of names than of cameras.
    """
    numbers, cameras, _ = _parts(path)
    names = _names(path)
    if len(names) != cameras:
        raise ValueError(f"{path}: {cameras} cameras, but the list of pictures beside it has {len(names)} names")
    shots, lost = [], []
    for i, name in enumerate(names):
        focal, k1, k2, *rest = (_next(path, numbers) for _ in range(15))
        if focal == 0:
            lost.append(name)
            continue
        turn, place = rest[:9], rest[9:]
        pose = _AXES @ rigid(path, i, [[*turn[3 * r : 3 * r + 3], place[r]] for r in range(3)], "R and t")
        lens = checked(f"{path}: camera {i}", Distortion(tuple(k for k in (k1, k2) if k1 or k2)))
        shots.append(Shot(name, None, pose, pinhole(f"{path}: camera {i}", focal, focal, 0.0, 0.0), lens, True))
    if not shots:
        raise ValueError(f"{path}: no camera is registered (all focal lengths are 0)")
    warn_left_out(path, lost, cameras, "not registered")
    return shots


def read_bundle_points(path: Path) -> Float[Tensor, "P 3"]:
    """The points of the file, float64.

    Raises:
        ValueError: a damaged file.
    """
    numbers, cameras, points = _parts(path)
    for _ in range(15 * cameras):
        _next(path, numbers)
    found = []
    for _ in range(points):
        found.append([_next(path, numbers) for _ in range(3)])
        for _ in range(3):
            _next(path, numbers)
        seen = _next(path, numbers)
        if not (seen >= 0 and seen.is_integer()):
            raise ValueError(f"{path}: expected in how many pictures a point is seen, got {seen}")
        for _ in range(4 * int(seen)):
            _next(path, numbers)
    return finite_points(found)


def _parts(path: Path) -> tuple[Iterator[str], int, int]:
    """The words behind the header, and how many cameras and points there are."""
    head, _, rest = read_text(path).partition("\n")
    if not head.startswith(HEADER):
        raise ValueError(f"{path}: not Bundler's: its first line must be {HEADER + ' v0.3'!r}")
    words = iter(rest.split())
    counts = [_next(path, words) for _ in range(2)]
    if not all(n >= 0 and n.is_integer() for n in counts):
        raise ValueError(f"{path}: expected the numbers of cameras and points, got {counts}")
    return words, int(counts[0]), int(counts[1])


def _next(path: Path, words: Iterator[str]) -> float:
    word = next(words, None)
    if word is None:
        raise ValueError(f"{path}: damaged, it ends too early")
    try:
        return float(word)
    except ValueError as error:
        raise ValueError(f"{path}: expected a number, got {word!r:.40}") from error


def _names(path: Path) -> list[str]:
    """The names of the pictures, one a line; behind a name there may be more words."""
    # COLMAP writes NAME.list.txt beside NAME.bundle.out.
    lists = [path.with_name(f"{path.name.removesuffix('.out').removesuffix('.bundle')}.list.txt")]
    lists += [path.with_name("list.txt"), path.with_name(f"{path.name}.list.txt"), path.with_suffix(".txt")]
    lists += [path.with_name("image_list.txt"), path.with_name("imagelist.txt")]
    lone = sorted(path.parent.glob("*.list.txt"))
    found = next((file for file in lists if file.is_file()), lone[0] if len(lone) == 1 else None)
    if found is None:
        raise FileNotFoundError(
            f"{path}: the list of its pictures is missing: {', '.join(dict.fromkeys(file.name for file in lists))}"
        )
    return [_name(line) for line in read_text(found).splitlines() if line.strip()]


def _name(line: str) -> str:
    """Without what Bundler writes behind: 0 and a focal length."""
    words = line.split()
    while len(words) > 1 and _is_number(words[-1]):
        words.pop()
    return " ".join(words)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
