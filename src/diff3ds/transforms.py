"""transforms.json files in and out: cameras and pictures in the dialects of nerfstudio, instant-ngp, NeRF synthetic."""

import json
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch

from diff3ds._files import is_file, read_json, write_text
from diff3ds._shapes import Float, Tensor
from diff3ds.camera import DEFAULT_NEAR, Cameras
from diff3ds.distortion import NO_DISTORTION, Distortion
from diff3ds.formats.png import size_of
from diff3ds.frames import (
    ADVICE,
    DIVISOR,
    ORTHOGRAPHIC,
    PRISM,
    RADIAL,
    TANGENTIAL,
    Values,
    distortion_of,
    frame_size,
    intrinsics_of,
    mask_file,
    named_picture,
    orthographic_of,
    picture_of,
    pose_of,
    similar,
)

# The files hold OpenGL camera axes (x right, y up, looking along -z); ours are OpenCV.
_OPENGL_TO_OPENCV = torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0], dtype=torch.float64))
# What the names of folders end in that hold copies 2, 4 or 8 times smaller, as nerfstudio and Gaussian splatting have
# them; the largest first.
SMALLER = ("_2", "_4", "_8")
# Missing files named in an error.
NAMED = 5
# Where pictures are missing, so many must be left.
LEAST = 3
# What instant-ngp does to pictures or views by keys at the top of the file, and this package does not.
NOT_DONE = {
    "n_frames": "all frames are used",
    "sharpness_discard_threshold": "all frames are used",
    "rolling_shutter": "every picture is taken as of one moment",
    "white_transparent": "--background white does the like",
    "black_transparent": "--background black does the like",
    "sharpen": "pictures are taken as they are",
    "fix_premult": "pictures are taken as they are",
}


@dataclass(frozen=True, eq=False)
class View:
    """One picture with the camera that took it.

    Attributes:
        picture: file.
        mask: file that is black where the picture does not count, or shows background (`pictures/content/masks.py`); or
            None.
        size: (height, width) of the picture in pixels.
        world_to_camera: float64, OpenCV axes.
        intrinsics: float64, in pixels of the picture; of orthographic ones in pixels a world unit.
        distortion: of the lens.
        orthographic: whether the picture is.
        photograph: of which the picture is an edge map that the user has brought; or None.
    """

    picture: Path
    mask: Path | None
    size: tuple[int, int]
    world_to_camera: Float[Tensor, "4 4"]
    intrinsics: Float[Tensor, "3 3"]
    distortion: Distortion = NO_DISTORTION
    orthographic: bool = False
    photograph: Path | None = None


def read_views(path: str | Path) -> list[View]:
    """The frames of a transforms.json (docs/reference/files.md lists the keys), in the order of the file.

    Pictures are opened only where the file does not say their size.

    Raises:
        FileNotFoundError: the file is missing, or pictures whose size is needed.
        ValueError: not such a file; a frame without a pose or a focal length; a lens that is not supported; an
            orthographic picture without its scale.
    """
    path = Path(path)
    data = _read_frames(path)
    frames: list[Values] = data["frames"]
    pictures = [picture_of(path, i, frame) for i, frame in enumerate(frames)]
    if not all("w" in {**data, **frame} and "h" in {**data, **frame} for frame in frames):
        require_files(path, pictures)
    return [_view(path, i, data, frame, pictures[i]) for i, frame in enumerate(frames)]


def present_views(path: str | Path) -> list[View]:
    """The frames that are to be fitted: those whose pictures are there, and that `train_filenames` lists if it is.

    Frames without pictures are left out with a warning that counts and names them, as nerfstudio and instant-ngp leave
    them out; another warns of what instant-ngp would do to the pictures.

    Raises:
        FileNotFoundError: the file is missing; pictures are missing, and fewer than three are left.
        ValueError: as `read_views`; `train_filenames` lists what is no frame's picture.
    """
    path = Path(path)
    data = _read_frames(path)
    frames: list[Values] = data["frames"]
    pictures = {i: picture_of(path, i, frame) for i, frame in enumerate(frames)}
    pictures = _smaller_copies(data, _listed(path, data, pictures))
    there = {i: picture for i, picture in pictures.items() if is_file(picture)}
    missing = [picture for i, picture in pictures.items() if i not in there]
    if missing and len(there) < LEAST:
        raise FileNotFoundError(_missing(path, missing, len(pictures)))
    views = [_view(path, i, data, frames[i], picture) for i, picture in there.items()]
    if missing:
        warnings.warn(f"{_missing(path, missing, len(pictures))}. They are left out", stacklevel=2)
    for key, what in NOT_DONE.items():
        if data.get(key):
            warnings.warn(f"{path}: {key} is for instant-ngp; here {what}", stacklevel=2)
    return views


def of_picture_sizes(path: Path, views: Sequence[View]) -> list[View]:
    """Views whose pictures are there, with the sizes of the pictures.

    Where a picture is a smaller or larger copy of what the cameras say, its focal lengths are scaled with it, and a
    warning says so, but for edge maps; where it has another shape, it is left for the reader of pictures, which looks
    at EXIF.
    """
    fitted = [_of_picture_size(view) for view in views]
    # Edge maps are as large as their detector has made them.
    pairs = zip(views, fitted, strict=True)
    other = [(old, new) for old, new in pairs if old.size != new.size and old.photograph is None]
    if other:
        old, new = other[0]
        said, there = (f"{size[1]} x {size[0]}" for size in (old.size, new.size))
        warnings.warn(
            f"{path}: {len(other)} of {len(views)} pictures are not as large as the cameras say ({new.picture.name}: "
            f"{there} instead of {said} pixels): focal lengths are scaled with them",
            stacklevel=3,
        )
    return fitted


def _of_picture_size(view: View) -> View:
    there = size_of(view.picture)
    if there == view.size or not is_copy_of_size(there, view.size):
        return view
    wider = view.intrinsics.new_tensor([there[1] / view.size[1], there[0] / view.size[0], 1.0])
    return replace(view, size=there, intrinsics=view.intrinsics * wider[:, None])


def is_copy_of_size(there: tuple[int, int], size: tuple[int, int]) -> bool:
    """Whether a picture of one size (height, width) may be a smaller or larger copy of one of the other size."""
    scale = max(there) / max(size)
    # Copies are rounded to whole pixels.
    return max(abs(a - scale * b) for a, b in zip(there, size, strict=True)) <= 1


def require_files(path: Path, files: Sequence[Path], what: str = "pictures") -> None:
    """Checks that the pictures of a transforms.json, or its masks, exist.

    Raises:
        FileNotFoundError: says how many are missing, and names some.
    """
    missing = [file for file in files if not is_file(file)]
    if missing:
        raise FileNotFoundError(_missing(path, missing, len(files), what))


def _missing(path: Path, missing: list[Path], count: int, what: str = "pictures") -> str:
    """Which pictures are missing, and what is there instead."""
    names = ", ".join(str(file) for file in missing[:NAMED]) + (", ..." if len(missing) > NAMED else "")
    like = similar(missing[0])
    advice = (
        f"{like} is there: write names as they are, with their capitals and without %20"
        if like
        else "Paths are relative to the folder of this file; put the pictures there or remove these frames"
    )
    return f"{path}: {len(missing)} of {count} {what} are missing: {names}. {advice}"


def _listed(path: Path, data: Values, pictures: dict[int, Path]) -> dict[int, Path]:
    """The pictures that nerfstudio would train on, where the file says it."""
    names = data.get("train_filenames")
    if names is None:
        return pictures
    if not isinstance(names, list) or not all(isinstance(name, str) and name for name in names):
        raise ValueError(f"{path}: train_filenames must be a list of file names, got {names!r:.40}")
    listed = {named_picture(path, name) for name in names}
    unknown = sorted(str(file) for file in listed - set(pictures.values()))
    if unknown or not listed:
        raise ValueError(f"{path}: train_filenames must list pictures of frames, got {', '.join(unknown[:NAMED])}")
    return {i: picture for i, picture in pictures.items() if picture in listed}


def _smaller_copies(data: Values, pictures: dict[int, Path]) -> dict[int, Path]:
    """Pictures, or copies in a folder beside theirs, such as images_2, where that has more of them.

    Their focal lengths are scaled by what the file says of the size of the pictures; without that nothing is.
    """
    if not all({"w", "h"} <= {*data, *data["frames"][i]} for i in pictures):
        return pictures
    copies = [{i: p.parent.parent / (p.parent.name + times) / p.name for i, p in pictures.items()} for times in SMALLER]
    return max(pictures, *copies, key=lambda files: sum(is_file(file) for file in files.values()))


def load_transforms(path: str | Path) -> tuple[Cameras, list[Path]]:
    """Cameras and picture paths of a transforms.json whose pictures have one size and no lens distortion.

    The cameras are float64, as the numbers of the file are: in map coordinates float32 would move them. All frames are
    read, whether their pictures are there or not. Focal lengths come from `fl_x` and `fl_y` or `camera_angle_x` and
    `camera_angle_y`, in the frame or for all frames; a missing principal point is the centre of the image; a missing
    size is read from the picture.

    Raises:
        FileNotFoundError, ValueError: as `read_views`; views of different sizes, or some with perspective and some
            without; lens distortion.
    """
    path = Path(path)
    views = read_views(path)
    sizes = {view.size for view in views}
    if len(sizes) != 1:
        raise ValueError(f"{path}: all views must have one size, got {sorted(sizes)} (height, width)")
    for view in views:
        if view.distortion:
            raise ValueError(f"{path}: {view.picture.name} has lens distortion; {ADVICE}")
    poses = torch.stack([view.world_to_camera for view in views])
    intrinsics = torch.stack([view.intrinsics for view in views])
    cameras = Cameras(poses, intrinsics, sizes.pop(), near_of(poses), one_kind(path, views))
    return cameras, [view.picture for view in views]


def one_kind(path: Path, views: Sequence[View]) -> bool:
    """Whether all views are orthographic.

    Raises:
        ValueError: some are, and some have perspective.
    """
    kinds = [view.orthographic for view in views]
    if len(set(kinds)) > 1:
        raise ValueError(
            f"{path}: all views must be orthographic, or all have perspective; {views[kinds.index(True)].picture} is "
            f"orthographic and {views[kinds.index(False)].picture} is not"
        )
    return all(kinds)


def near_of(world_to_camera: Float[Tensor, "V 4 4"]) -> float:
    """The default near plane, but closer in worlds that are much smaller than a unit."""
    centers = -(world_to_camera[:, :3, :3].mT @ world_to_camera[:, :3, 3:])[..., 0]
    spread = float((centers - centers.mean(0)).norm(dim=1).max())
    return DEFAULT_NEAR * min(1.0, spread or 1.0)


def save_transforms(path: str | Path, cameras: Cameras, pictures: Sequence[str | Path]) -> None:
    """Writes a transforms.json for these cameras; picture paths are written as given.

    Raises:
        ValueError: not one picture a view, or intrinsics with skew, which such a file cannot hold.
    """
    if len(pictures) != len(cameras):
        raise ValueError(f"expected {len(cameras)} pictures, one a view, got {len(pictures)}")
    skewed = cameras.intrinsics[:, 0, 1] != 0
    if bool(skewed.any()):
        view = int(skewed.int().argmax())
        raise ValueError(
            f"a transforms.json holds no skew, and view {view} has {cameras.intrinsics[view, 0, 1].item()}"
        )
    poses = torch.linalg.inv(cameras.world_to_camera.detach().cpu().double()) @ _OPENGL_TO_OPENCV
    intrinsics = cameras.intrinsics.detach().cpu().double()
    height, width = cameras.size
    frames = [
        {
            "file_path": str(picture),
            "fl_x": float(k[0, 0]),
            "fl_y": float(k[1, 1]),
            "cx": float(k[0, 2]),
            "cy": float(k[1, 2]),
            "transform_matrix": pose.tolist(),
        }
        for picture, k, pose in zip(pictures, intrinsics, poses, strict=True)
    ]
    # What nerfstudio asks for, and what instant-ngp does.
    kind = {"camera_model": ORTHOGRAPHIC, "orthographic": True} if cameras.orthographic else {}
    write_text(Path(path), json.dumps({"w": width, "h": height, **kind, "frames": frames}, indent=1))


def save_views(path: str | Path, views: Sequence[View], about: Values | None = None) -> None:
    """Writes a transforms.json of views with lenses, masks and sizes of their own; paths are written as given.

    Args:
        path: the file.
        views: at least one.
        about: more keys for the top of the file.

    Raises:
        ValueError: a view that such a file cannot hold: with skew.
    """
    frames = []
    for view in views:
        (fx, skew, cx), (_, fy, cy), _ = view.intrinsics.tolist()
        if abs(skew) > 0:
            raise ValueError(f"a transforms.json holds no skew, and {view.picture.name} has {skew}")
        frame: Values = {"file_path": view.picture.as_posix()}
        if view.mask:
            frame["mask_path"] = view.mask.as_posix()
        frame |= {"w": view.size[1], "h": view.size[0], "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy}
        pose = _inverse(view.world_to_camera) @ _OPENGL_TO_OPENCV
        kind = {"camera_model": ORTHOGRAPHIC, "orthographic": True} if view.orthographic else _lens(view.distortion)
        frames.append(frame | kind | {"transform_matrix": pose.tolist()})
    write_text(Path(path), json.dumps({**(about or {}), "frames": frames}, indent=1))


def _lens(lens: Distortion) -> Values:
    """The keys of a lens."""
    if not lens:
        return {}
    model = "FULL_OPENCV" if lens.divisor else "OPENCV"
    if lens.fisheye:
        model = "THIN_PRISM_FISHEYE" if any((*lens.prism, *lens.tangential)) else "OPENCV_FISHEYE"
    series = ((RADIAL, lens.radial), (TANGENTIAL, lens.tangential), (DIVISOR, lens.divisor), (PRISM, lens.prism))
    values = {key: value for keys, given in series for key, value in zip(keys, given, strict=False) if value}
    return {"camera_model": model} | values


def _read_frames(path: Path) -> dict[str, Any]:
    """The content, without keys that hold null, which are as good as missing."""
    content = read_json(path)
    data: Values = content if isinstance(content, dict) else {}
    frames = data.get("frames")
    if not isinstance(frames, list) or not frames or not all(isinstance(f, dict) for f in frames):
        raise ValueError(f"{path}: expected an object with a non-empty list 'frames', as in a transforms.json")
    return {**_given(data), "frames": [_given(frame) for frame in frames]}


def _given(values: Values) -> Values:
    return {key: value for key, value in values.items() if value is not None}


def _view(path: Path, index: int, data: Values, frame: Values, picture: Path) -> View:
    values = {**data, **frame}
    size = frame_size(path, values, picture)
    to_world = pose_of(path, index, frame) @ _OPENGL_TO_OPENCV
    orthographic = orthographic_of(path, index, data, frame)
    return View(
        picture,
        mask_file(path, index, frame),
        size,
        _inverse(to_world),
        intrinsics_of(path, index, data, frame, size, orthographic),
        distortion_of(path, index, values, orthographic),
        orthographic,
    )


def _inverse(rigid: Float[Tensor, "*B 4 4"]) -> Float[Tensor, "*B 4 4"]:
    """Of rotations and translations."""
    inverse = rigid.clone()
    inverse[..., :3, :3] = rigid[..., :3, :3].mT
    inverse[..., :3, 3:] = -(rigid[..., :3, :3].mT @ rigid[..., :3, 3:])
    return inverse
