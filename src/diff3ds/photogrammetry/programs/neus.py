"""The cameras_*.npz of NeuS, IDR and DTU: a projection of each picture, in a world where the object fills a sphere."""

import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.photogrammetry.picture_files import in_order
from diff3ds.photogrammetry.shot import Shot, pinhole, rigid

NAMES = ("cameras_sphere.npz", "cameras_large.npz", "cameras.npz")
WORLD, SCALE = "world_mat_", "scale_mat_"
# [px; rounding] Products of float32 numbers leave so much skew of pictures of some thousand pixels.
ROUNDING = 0.01
# A matrix has 16 numbers; more in a file's header is taken for damage.
MAX_BYTES = 1 << 12


def is_neus(path: Path) -> bool:
    """Whether a file has a projection of the first picture."""
    try:
        with zipfile.ZipFile(path) as archive:
            return f"{WORLD}0.npy" in archive.namelist()
    except (zipfile.BadZipFile, NotImplementedError, ValueError):
        # Damaged, as reading it says.
        return True


def read_neus(path: Path) -> list[Shot]:
    """One shot for each picture beside the file, in the order of their names: the projection world_mat times scale_mat.

    Raises:
        ValueError: a damaged file, or another number of pictures than of cameras.
    """
    matrices = list(_matrices(path))
    names = in_order(path, len(matrices))
    shots = []
    for i, (name, matrix) in enumerate(zip(names, matrices, strict=True)):
        intrinsics, pose = _decomposed(path, i, matrix)
        shots.append(Shot(name, None, pose, intrinsics))
    return shots


def _matrices(path: Path) -> Iterator[Float[Tensor, "3 4"]]:
    try:
        with zipfile.ZipFile(path) as archive, np.load(path, allow_pickle=False) as data:
            sizes = {entry.filename: entry.file_size for entry in archive.infolist()}
            count = sum(name.startswith(WORLD) for name in data.files)
            for i in range(count):
                names = [f"{WORLD}{i}", *([f"{SCALE}{i}"] if f"{SCALE}{i}" in data.files else [])]
                if any(sizes[f"{name}.npy"] > MAX_BYTES for name in names):
                    raise ValueError(f"{names[0]} is no matrix")
                found = [torch.from_numpy(data[name].astype(np.float64)).reshape(-1, 4) for name in names]
                if not all(matrix.shape in ((3, 4), (4, 4)) and bool(matrix.isfinite().all()) for matrix in found):
                    raise ValueError(f"{names[0]} is no matrix of 4 x 4 finite numbers")
                whole, *scale = found
                yield (whole[:3] @ scale[0] if scale else whole[:3]).double()
    # Broken archives make zipfile and numpy raise nearly anything.
    except Exception as error:
        raise ValueError(f"{path}: damaged, or not the cameras of NeuS ({error!r:.80})") from error


def _decomposed(path: Path, index: int, matrix: Float[Tensor, "3 4"]) -> tuple[Float[Tensor, "3 3"], Tensor]:
    """Intrinsics, and rotation and translation, of a projection of any scale."""
    matrix = matrix * matrix[:, :3].det().sign()
    # Rows upside down and transposed, a QR decomposition is the one into an upper triangle and a rotation.
    q, r = torch.linalg.qr(matrix[:, :3].flip(0).mT)
    upper, turn = r.mT.flip(0, 1), q.mT.flip(0)
    signs = upper.diagonal().sign()
    upper, turn = upper * signs, turn * signs[:, None]
    if not bool((upper.diagonal() > 0).all()):
        raise ValueError(f"{path}: the matrix of picture {index} is no projection")
    place = torch.linalg.solve_triangular(upper, matrix[:, 3:], upper=True)
    (fx, skew, cx), (_, fy, cy), _ = (upper / upper[2, 2]).tolist()
    skew = skew if abs(skew) > ROUNDING else 0.0
    intrinsics = pinhole(f"{path}: picture {index}", fx, fy, cx, cy, skew)
    return intrinsics, rigid(path, index, torch.cat([turn, place], 1).tolist(), WORLD)
