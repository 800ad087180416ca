"""The pictures and masks of a project on this disk: found by their names, in the folders where programs keep them."""

import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath

from diff3ds._files import is_file
from diff3ds.formats.png import size_of
from diff3ds.frames import SUFFIXES
from diff3ds.photogrammetry.shot import Shot
from diff3ds.transforms import LEAST, NAMED, SMALLER, View

UNDISTORTED = "undistorted_images"
# Where pictures lie, beside the file with the cameras or above it; the first that has most of them is taken. Smaller
# copies, as nerfstudio and Gaussian splatting make them, come last.
FOLDERS = ("images", "image", "input", "rgb", "color", "photos", "blended_images", UNDISTORTED, ".")
# Pictures as cameras have taken them, where Gaussian splatting has put straightened ones into "images".
DISTORTED = ("input", *FOLDERS)
PHOTOGRAPHS = (".jpg", ".jpeg", ".heic", ".heif")
# How far a principal point that is told without the size of the picture may be from the middle, of a side: intrinsics
# of copies of half the size put it at a quarter. Of cut pictures it may be off by less.
NEAR_MIDDLE = 0.2
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
    if UNDISTORTED in base.parts and any(shot.distortion for shot in shots):
        raise ValueError(
            f"{path}: the cameras have lens distortion, which the pictures in {base} have no more: put those that the "
            "cameras have taken into a folder 'images' beside it, or name the cameras that were written with these"
        )
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


def in_order(path: Path, count: int) -> list[str]:
    """The names of the pictures that a file means which does not name them: all of a folder, in the order of names.

    Raises:
        ValueError: no folder has so many.
    """
    held = [(folder, sorted(file.name for file in _files(folder))) for folder in _folders(path, None)]
    held = [(folder, names) for folder, names in held if names]
    found = next((names for _, names in held if len(names) == count), None)
    if found is None:
        there = ", ".join(f"{len(names)} in {folder}" for folder, names in held) or "none beside it"
        raise ValueError(f"{path}: cameras of {count} pictures, but there are {there}: it needs all, and no others")
    return found


def _files(folder: Path) -> list[Path]:
    """The pictures in a folder, by their suffixes."""
    return [file for file in folder.iterdir() if file.suffix in SUFFIXES and file.is_file()]


def _view(shot: Shot, picture: Path) -> View:
    size, intrinsics = shot.size, shot.intrinsics
    if size is None:
        size = size_of(picture)
        middle = intrinsics.new_tensor([size[1] / 2, size[0] / 2])
        if not shot.centered and bool(((intrinsics[:2, 2] - middle).abs() > NEAR_MIDDLE * 2 * middle).any()):
            x, y = intrinsics[:2, 2].tolist()
            raise ValueError(
                f"{picture}: {size[1]} x {size[0]} pixels, and its camera looks at ({x:.1f}, {y:.1f}): these are the "
                "numbers of copies of another size, or of a part"
            )
    if shot.centered:
        intrinsics = intrinsics.clone()
        intrinsics[0, 2], intrinsics[1, 2] = size[1] / 2, size[0] / 2
    return View(picture, None, size, shot.world_to_camera, intrinsics, shot.distortion)


def _folders(path: Path, target: str | None) -> list[Path]:
    """Where pictures may lie, the likeliest first."""
    here = path if path.is_dir() else path.parent
    names = (*(DISTORTED if "distorted" in here.parts else FOLDERS), *(f"images{times}" for times in SMALLER))
    names = (*EDGES, *names) if target == "edges" else names
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
    # Metashape's labels lack the suffix, and pictures may have been written anew in another format.
    stems: dict[str, list[Path]] = {}
    for file in sorted(_files(folder)):
        stems.setdefault(file.stem, []).append(file)
    found: list[tuple[str, Path, bool]] = []
    several: dict[str, list[Path]] = {}
    for shot in shots:
        name = PurePosixPath(shot.name.replace("\\", "/"))
        # The folders of another machine may be the same below that of the pictures.
        tails = (folder.joinpath(*name.parts[first:]) for first in range(len(name.parts)))
        if named := next((file for file in tails if is_file(file)), None):
            found.append((shot.name, named, named == folder / name))
        elif similar := stems.get(name.name) or stems.get(name.stem):
            several[shot.name] = similar
    found += [(name, file, False) for name, file in _of_one_suffix(several).items()]
    # One 1.jpg is not both cam1/1.jpg and cam2/1.jpg, and nobody knows which.
    count = Counter(file for _, file, _ in found)
    for written, file, is_named in found:
        if is_named or count[file] == 1:
            yield written, file


def _of_one_suffix(several: Mapping[str, list[Path]]) -> dict[str, Path]:
    """Of files that differ in their suffixes alone, as photographs and masks may, those of the suffix that most have.

    Args:
        several: for each name the files that may be meant.

    Raises:
        ValueError: no suffix is that of a photograph and has most; names two files.
    """
    count = Counter(suffix for files in several.values() for suffix in {file.suffix.lower() for file in files})

    def rank(file: Path) -> tuple[bool, int]:
        return file.suffix.lower() in PHOTOGRAPHS, count[file.suffix.lower()]

    found: dict[str, Path] = {}
    left: list[Path] = []
    for name, files in several.items():
        best, *others = sorted(files, key=rank, reverse=True)
        if rival := next((file for file in others if rank(file) == rank(best) or rank(file)[1] > rank(best)[1]), None):
            raise ValueError(
                f"{best} or {rival.name} for {name}? Put masks into a folder 'masks', and other copies elsewhere"
            )
        found[name], left = best, left + others
    if left:
        some = ", ".join(file.name for file in left[:NAMED]) + (", ..." if len(left) > NAMED else "")
        warnings.warn(
            f"{left[0].parent}: {len(left)} files are named as pictures that lie beside them, and left out: {some}. "
            "Put masks into a folder 'masks'",
            stacklevel=6,
        )
    return found


def _mask(picture: Path, base: Path, folders: list[Path]) -> Path | None:
    """COLMAP writes .png behind the whole name, others this or another suffix in place of the picture's."""
    # What "../" leads out of the folder of pictures would lead out of that of masks as well, perhaps to the picture.
    inside = picture.is_relative_to(base) and ".." not in picture.relative_to(base).parts
    place = picture.relative_to(base) if inside else Path(picture.name)
    names = (place.with_name(place.name + ".png"), *(place.with_suffix(suffix) for suffix in SUFFIXES))
    return next((file for folder in folders for name in names if (file := folder / name).is_file()), None)
