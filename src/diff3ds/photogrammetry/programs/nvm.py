"""VisualSFM's models, NVM_V3: pictures, focal lengths and poses, with the principal points in the middle."""

from pathlib import Path

from diff3ds._files import read_text
from diff3ds.frames import ADVICE
from diff3ds.photogrammetry.shot import Shot, damaged, pinhole, quaternion_pose

PATTERN, HEADER = "*.nvm", "NVM_V3"


def read_nvm(path: Path) -> list[Shot]:
    """The pictures of the first model.

    Raises:
        ValueError: not such a file; a lens with distortion, which is of another kind than all others here.
    """
    lines = [line.strip() for line in read_text(path).splitlines()]
    lines = [line for line in lines if line and not line.startswith("#")]
    if not lines or lines[0].split()[0] != HEADER or len(lines) < 2 or not lines[1].isdecimal():
        raise ValueError(f"{path}: expected {HEADER} and the number of pictures")
    if lines[0] != HEADER:
        raise ValueError(f"{path}: a model of fixed calibration ({lines[0]!r:.60}) is not read: save it as Bundler's")
    shots = []
    for line in lines[2 : 2 + min(int(lines[1][:9]), len(lines))]:
        # A name may have spaces, written as quotation marks.
        words = line.rsplit(maxsplit=10)
        with damaged(path, f"a picture of VisualSFM's, {line!r:.60}"):
            focal, w, i, j, k, x, y, z, radial, _ = (float(word) for word in words[1:])
        where = f"{path}: {words[0]:.60}"
        if radial:
            raise ValueError(f"{where}: VisualSFM's radial distortion is not read; {ADVICE}")
        pose = quaternion_pose(where, [w, i, j, k], [x, y, z])
        # The file holds where the camera is.
        pose[:3, 3] = -pose[:3, :3] @ pose[:3, 3]
        name, intrinsics = words[0].replace('"', " "), pinhole(where, focal, focal, 0.0, 0.0)
        shots.append(Shot(name, None, pose, intrinsics, centered=True))
    if len(shots) != int(lines[1][:9]):
        raise ValueError(f"{path}: damaged, it ends before its {lines[1]:.20} pictures")
    return shots
