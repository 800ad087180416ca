"""The pictures and masks of a project on this disk: found by their names, in the folders where programs keep them."""

import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath

from diff3ds.formats.png import size_of
from diff3ds.frames import SUFFIXES
from diff3ds.photogrammetry.shot import Shot
from diff3ds.transforms import LEAST, NAMED, View

# Where pictures lie, beside the file with the cameras or above it; the first that has most of them is taken. Smaller
# copies, as nerfstudio and Gaussian splatting make them, come last.
FOLDERS = ("images", "image", "input", "rgb", "color", "photos", "undistorted_images", ".")
SMALLER = ("images_2", "images_4", "images_8")
# Where maps of edges lie, of NEF and EMAP.
EDGES = ("edges", "edge_*")
MASKS = ("masks", "mask")
# Folders above that of the cameras: sparse/0 is two below the project's.
ABOVE = 3


def views_of(path: Path, shots: Sequence[Shot], target: str | None = None) -> list[View]:
    """The views of a project whose pictures are on this disk, with masks where a folder has some.

    Pictures that are missing are left out with a warning that counts and names them.

    Args:
        path: the file or folder with the cameras.
        shots: what it says.
        target: edges looks for maps of edges, color for pictures; by default pictures.

    Raises:
        FileNotFoundError: fewer than three of the pictures are there; says where they were looked for.
    """
    base, found = _best_folder(path, shots, target)
    missing = [shot.name for shot in shots if shot.name not in found]
    if missing:
        names = ", ".join(missing[:NAMED]) + (", ..." if len(missing) > NAMED else "")
        lack = f"{path}: {len(missing)} of {len(shots)} pictures are missing: {names}"
        if len(found) < LEAST:
            looked = ", ".join(str(folder) for folder in _folders(path, target))
            raise FileNotFoundError(f"{lack}. Looked in {looked}: put them into a folder 'images' beside the cameras")
        warnings.warn(f"{lack}. They are left out", stacklevel=3)
    views = [_view(shot, found[shot.name]) for shot in shots if shot.name in found]
    return with_masks(views, base)


def with_masks(views: Sequence[View], base: Path) -> list[View]:
    """Views that have no mask with those of a folder 'masks' (`masks_for`), if there is such a folder."""
    masks = None if any(view.mask for view in views) else masks_for([view.picture for view in views], base)
    return list(views) if masks is None else [replace(v, mask=m) for v, m in zip(views, masks, strict=True)]


def masks_for(pictures: Sequence[Path], base: Path) -> list[Path | None] | None:
    """The masks of a folder 'masks' in or beside this one; None without such a folder.

    A mask has the path of its picture in the folder of the pictures, with or without the picture's suffix.
    """
    folders = [folder for parent in (base, base.parent) for name in MASKS if (folder := parent / name).is_dir()]
    masks = [_mask(picture, base, folders) for picture in pictures]
    if not any(masks):
        return None
    if lacking := sum(mask is None for mask in masks):
        warnings.warn(f"{folders[0]}: {lacking} of {len(pictures)} pictures have no mask there", stacklevel=3)
    return masks


def pictures_in(folder: Path) -> list[Path]:
    """The pictures of a folder, by name, or else those of a folder 'images' in it; hidden ones are none."""
    for place in (folder, *(folder / name for name in FOLDERS)):
        if place.is_dir():
            found = sorted(file for file in _files(place) if file.name[0] != ".")
            if found:
                return found
    return []


def _files(folder: Path) -> list[Path]:
    """The pictures in a folder, by their suffixes."""
    return [file for file in folder.iterdir() if file.suffix in SUFFIXES and file.is_file()]


def _view(shot: Shot, picture: Path) -> View:
    size, intrinsics = shot.size, shot.intrinsics
    if size is None:
        size = size_of(picture)
        intrinsics = intrinsics.clone()
        intrinsics[0, 2], intrinsics[1, 2] = size[1] / 2, size[0] / 2
    return View(picture, None, size, shot.world_to_camera, intrinsics, shot.distortion)


def _folders(path: Path, target: str | None) -> list[Path]:
    """Where pictures may lie, the likeliest first."""
    here = path if path.is_dir() else path.parent
    names = (*EDGES, *FOLDERS, *SMALLER) if target == "edges" else (*FOLDERS, *SMALLER)
    above = [here, *here.absolute().parents[:ABOVE]] if path.is_dir() else [here, here.absolute().parent]
    found = [folder for name in names for place in above for folder in _of_name(place, name)]
    return list(dict.fromkeys(found))


def _of_name(place: Path, name: str) -> list[Path]:
    return [place] if name == "." else sorted(folder for folder in place.glob(name) if folder.is_dir())


def _best_folder(path: Path, shots: Sequence[Shot], target: str | None) -> tuple[Path, dict[str, Path]]:
    """The folder that has most of the pictures, and those that it has by the names in the project."""
    best: tuple[Path, dict[str, Path]] = (path, {})
    for folder in _folders(path, target):
        found = dict(_found_in(folder, shots))
        if len(found) > len(best[1]):
            best = folder, found
        if len(found) == len(shots):
            break
    return best


def _found_in(folder: Path, shots: Sequence[Shot]) -> Iterator[tuple[str, Path]]:
    files = {file.name: file for file in _files(folder)}
    # Metashape's labels lack the suffix, and pictures may have been written anew in another format.
    stems = {file.stem: file for file in files.values()}
    found: list[tuple[str, Path, bool]] = []
    for shot in shots:
        name = PurePosixPath(shot.name.replace("\\", "/"))
        if (folder / name).is_file():
            found.append((shot.name, folder / name, True))
        elif similar := files.get(name.name) or stems.get(name.name) or stems.get(name.stem):
            found.append((shot.name, similar, False))
    # One 1.jpg is not both cam1/1.jpg and cam2/1.jpg, and nobody knows which.
    count = Counter(file for _, file, _ in found)
    for written, file, is_named in found:
        if is_named or count[file] == 1:
            yield written, file


def _mask(picture: Path, base: Path, folders: list[Path]) -> Path | None:
    """COLMAP writes .png behind the whole name, others in place of the suffix."""
    # What "../" leads out of the folder of pictures would lead out of that of masks as well, perhaps to the picture.
    inside = picture.is_relative_to(base) and ".." not in picture.relative_to(base).parts
    place = picture.relative_to(base) if inside else Path(picture.name)
    names = (place.with_name(place.name + ".png"), place.with_suffix(".png"), place)
    return next((file for folder in folders for name in names if (file := folder / name).is_file()), None)
