"""LLFF's poses_bounds.npy: 17 numbers of each picture, in the order of their names."""

from pathlib import Path

import numpy as np

from diff3ds.photogrammetry.picture_files import in_order
from diff3ds.photogrammetry.shot import Shot, inverse, picture_size, pinhole, rigid

NAME = "poses_bounds.npy"
# A hundred thousand pictures.
MAX_BYTES = 1 << 24


def read_llff(path: Path) -> list[Shot]:
    """One shot for each picture beside the file. Its axes are down, right and backwards.

    Raises:
        ValueError: a damaged file, or another number of pictures than of cameras.
    """
    if path.stat().st_size > MAX_BYTES:
        raise ValueError(f"{path}: {path.stat().st_size} bytes are more than the {MAX_BYTES} that are read")
    # Mapped, a file is not believed to be larger than it is. Broken files make numpy raise nearly anything.
    try:
        table = np.load(path, mmap_mode="r", allow_pickle=False).astype(np.float64)
    except Exception as error:
        raise ValueError(f"{path}: not numbers as numpy writes them ({error!r:.80})") from error
    if table.ndim != 2 or table.shape[1] != 17 or not len(table) or not np.isfinite(table).all():
        raise ValueError(f"{path}: expected 17 finite numbers of each picture, got a table of {table.shape}")
    shots = []
    for i, (name, row) in enumerate(zip(in_order(path, len(table)), table, strict=True)):
        (down, right, back, place, (height, width, focal)) = row[:15].reshape(3, 5).T
        size = picture_size(f"{path}: picture {i}", round(width), round(height))
        pose = rigid(path, i, np.stack([right, down, -back, place], 1).tolist(), "pose")
        intrinsics = pinhole(f"{path}: picture {i}", focal, focal, size[1] / 2, size[0] / 2)
        shots.append(Shot(name, size, inverse(pose), intrinsics))
    return shots
