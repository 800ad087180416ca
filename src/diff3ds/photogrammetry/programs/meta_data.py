"""The meta_data.json of edge data sets, NEF's and EMAP's, which is that of SDFStudio."""

from pathlib import Path

import numpy as np

from diff3ds._files import read_json
from diff3ds.photogrammetry.shot import Shot, inverse, picture_size, pinhole, rigid

NAME = "meta_data.json"


def read_meta_data(path: Path) -> list[Shot]:
    """The frames: camera to world with OpenCV axes, and intrinsics of each.

    Raises:
        ValueError: not such a file.
    """
    data = read_json(path)
    frames = data.get("frames") if isinstance(data, dict) else None
    if not isinstance(frames, list) or not frames or not all(isinstance(frame, dict) for frame in frames):
        raise ValueError(f"{path}: expected an object with a non-empty list 'frames'")
    size = picture_size(str(path), data["width"], data["height"]) if {"width", "height"} <= data.keys() else None
    shots = []
    for i, frame in enumerate(frames):
        name = frame.get("rgb_path")
        if not isinstance(name, str) or not name:
            raise ValueError(f"{path}: frame {i} has no rgb_path")
        try:
            matrix = np.array(frame["intrinsics"], np.float64)
            k = [[float(n) for n in row[:3]] for row in matrix[:3].tolist()]
            (fx, skew, cx), (_, fy, cy), _ = k
        except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
            raise ValueError(f"{path}: frame {i} has no intrinsics of 3x3 or 4x4 numbers") from error
        pose = rigid(path, i, frame.get("camtoworld"), "camtoworld")
        shots.append(Shot(name, size, inverse(pose), pinhole(f"{path}: frame {i}", fx, fy, cx, cy, skew)))
    return shots
