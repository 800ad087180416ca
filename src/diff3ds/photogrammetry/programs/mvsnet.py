"""The folder cams of MVSNet, BlendedMVS and DTU: a file 00000000_cam.txt for each picture."""

from pathlib import Path

from diff3ds._files import read_text
from diff3ds.photogrammetry.shot import Shot, pinhole, rigid

TAIL = "_cam.txt"
FOLDERS = ("cams", "cams_1", "cameras")


def is_mvsnet(folder: Path) -> bool:
    """Whether a folder holds such files."""
    return folder.is_dir() and any(folder.glob(f"*{TAIL}"))


def read_mvsnet(folder: Path) -> list[Shot]:
    """The cameras: world to camera with OpenCV axes, in the order of their names. Sizes are those of the pictures.

    Raises:
        ValueError: a damaged file.
    """
    shots = []
    for i, path in enumerate(sorted(folder.glob(f"*{TAIL}"))):
        words = read_text(path).split()
        if "extrinsic" not in words or "intrinsic" not in words:
            raise ValueError(f"{path}: expected the words extrinsic and intrinsic, with a matrix behind each")
        pose = _numbers(path, words, "extrinsic", 16)
        fx, skew, cx, _, fy, cy, *last = _numbers(path, words, "intrinsic", 9)
        if last != [0, 0, 1]:
            raise ValueError(f"{path}: the last row of intrinsics must be 0 0 1, got {last}")
        to_camera = rigid(path, i, [pose[row : row + 4] for row in range(0, 16, 4)], "extrinsic")
        name = path.name.removesuffix(TAIL)
        shots.append(Shot(name, None, to_camera, pinhole(str(path), fx, fy, cx, cy, skew)))
    return shots


def _numbers(path: Path, words: list[str], after: str, count: int) -> list[float]:
    start = words.index(after) + 1
    try:
        found = [float(word) for word in words[start : start + count]]
    except ValueError:
        found = []
    if len(found) != count:
        raise ValueError(f"{path}: expected {count} numbers behind {after!r}")
    return found
