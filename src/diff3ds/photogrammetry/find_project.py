"""Cameras found in a folder, whatever program wrote them, and read with their pictures (docs/reference/cameras.md)."""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import torch

from diff3ds._files import read_json
from diff3ds._shapes import Float, Tensor
from diff3ds.frames import file_of
from diff3ds.photogrammetry.not_read import (
    WANTED,
    cameras_not_read,
    no_cameras,
    pictures_not_read,
    require_no_video,
)
from diff3ds.photogrammetry.picture_files import pictures_in, views_of, with_masks
from diff3ds.photogrammetry.point_files import load_points
from diff3ds.photogrammetry.programs import (
    bundler,
    colmap,
    gaussians,
    llff,
    meshroom,
    meta_data,
    metashape,
    mvsnet,
    neus,
    nvm,
    openmvg,
    opensfm,
)
from diff3ds.photogrammetry.shot import Shot
from diff3ds.transforms import View
from diff3ds.transforms import present_views as views_of_transforms

# Where COLMAP and those who use it keep models, below the folder of a project.
MODELS = ("sparse", "colmap/sparse", "colmap", "dense/sparse", "distorted/sparse", ".")
# Files that are known by their names, the likeliest first.
NAMED = (meta_data.NAME, openmvg.NAME, opensfm.NAME, gaussians.NAME, *neus.NAMES, llff.NAME)


@dataclass(frozen=True)
class NoCameras:
    """A folder without cameras that are read; perhaps with pictures, whose cameras can be found.

    Attributes:
        folder: where they were looked for.
        pictures: in it.
        not_read: what says where they were taken from, and is not read, in a sentence; empty if nothing does.
        others: pictures and videos in it that are not read, in sentences.
    """

    folder: Path
    pictures: list[Path]
    not_read: str
    others: list[str]

    def error(self) -> FileNotFoundError:
        """Says what was found and what would do, to who cannot do without cameras."""
        return FileNotFoundError(no_cameras(self.folder, self.pictures, self.not_read, self.others))


def find_project(path: Path, target: str | None = None) -> Path:
    """As `project_of`, of a folder that has cameras.

    Raises:
        FileNotFoundError: no such folder, or none with cameras; says what was found and what would do.
        ValueError: as `project_of`.
    """
    found = project_of(path, target)
    if isinstance(found, NoCameras):
        raise found.error()
    return found


def project_of(path: Path, target: str | None = None) -> Path | NoCameras:
    """The file, or of COLMAP and MVSNet the folder, with the cameras of a folder, if it has some.

    Of transforms files `transforms.json`, `transforms_train.json`, or the one of the target. Of several models of
    COLMAP the largest, with a warning.

    Args:
        path: a folder, or such a file itself.
        target: edges, color, color-edges, or None for any.

    Raises:
        FileNotFoundError: no such folder.
        ValueError: there are several; a video.
    """
    if not path.is_dir():
        return _file(path)
    kinds = {None: ["edges", "color"], "edges": ["edges"]}.get(target, ["color"])
    for name in ("transforms.json", "transforms_train.json", *(f"transforms_{kind}.json" for kind in kinds)):
        if (path / name).is_file():
            return path / name
    if found := sorted(path.glob("transforms*.json")):
        return _only(path, found)
    if models := _models(path):
        return _largest(path, models)
    for name in NAMED:
        if (path / name).is_file() and _is_of_name(path / name):
            return path / name
    if written := list(_written(path)):
        return _only(path, written)
    if cams := [path / name for name in mvsnet.FOLDERS if mvsnet.is_mvsnet(path / name)]:
        return cams[0]
    pictures = pictures_in(path)
    not_read, others = cameras_not_read(path, pictures), pictures_not_read(path, pictures)
    return NoCameras(path, pictures, not_read, others)


def present_views(path: Path, target: str | None = None) -> list[View]:
    """The views of a project that `find_project` has found, those whose pictures are there.

    Args:
        path: as found.
        target: edges prefers maps of edges to pictures where a project has both; None does so of NEF and EMAP.

    Raises:
        FileNotFoundError: the file is missing; pictures are missing, and fewer than three are left.
        ValueError: a damaged file, or a lens that is not supported; the message names the file and the place.
    """
    reader, _ = _readers(path)
    if reader is None:
        views = views_of_transforms(path)
        return with_masks(views, views[0].picture.parent)
    wanted = "edges" if target is None and path.name == meta_data.NAME else target
    return views_of(path, reader(path), wanted)


def sparse_points(path: Path) -> Float[Tensor, "P 3"]:
    """The points that the program has found with the cameras, float64; none where there are no points.

    Args:
        path: as `find_project` finds it. Of a transforms.json those of its `ply_file_path`, if that file is there.

    Raises:
        ValueError: a damaged file.
    """
    _, points = _readers(path)
    return torch.zeros((0, 3), dtype=torch.float64) if points is None else points(path)


_Readers = tuple[Callable[[Path], list[Shot]] | None, Callable[[Path], Float[Tensor, "P 3"]] | None]


def _readers(path: Path) -> _Readers:
    """What reads the cameras of such a file or folder, and its points, if it can have some.

    No reader of cameras reads a transforms.json.
    """
    if path.is_dir():
        return (mvsnet.read_mvsnet, None) if mvsnet.is_mvsnet(path) else (colmap.read_model, colmap.read_points)
    by_suffix: dict[str, _Readers] = {
        ".xml": (metashape.read_metashape, None),
        ".out": (bundler.read_bundle, bundler.read_bundle_points),
        ".nvm": (nvm.read_nvm, None),
        ".npz": (neus.read_neus, None),
        ".npy": (llff.read_llff, None),
    }
    if path.suffix in by_suffix:
        return by_suffix[path.suffix]
    if path.suffix not in (".json", ".sfm"):
        raise ValueError(f"{path}: not a file with cameras. {cameras_not_read(path) or WANTED}")
    if path.name == meta_data.NAME:
        return meta_data.read_meta_data, None
    data = read_json(path)
    if path.name == openmvg.NAME or (isinstance(data, dict) and "sfm_data_version" in data):
        return openmvg.read_openmvg, openmvg.read_openmvg_points
    if path.name == opensfm.NAME or opensfm.is_opensfm(data):
        return opensfm.read_opensfm, opensfm.read_opensfm_points
    if path.suffix == ".sfm" or meshroom.is_meshroom(data):
        return meshroom.read_meshroom, None
    return (gaussians.read_gaussians, None) if gaussians.is_gaussians(data) else (None, _points_of_transforms)


def _points_of_transforms(path: Path) -> Float[Tensor, "P 3"]:
    """The points of the PLY file that a transforms.json names, as nerfstudio writes it."""
    data = read_json(path)
    name = data.get("ply_file_path") if isinstance(data, dict) else None
    file = file_of(path, name) if isinstance(name, str) and name else None
    there = file is not None and file.is_file()
    return load_points(file) if file is not None and there else torch.zeros((0, 3), dtype=torch.float64)


def _file(path: Path) -> Path:
    """A file that is named itself, or the folder that it is a part of."""
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file or folder")
    require_no_video(path)
    model = path.stem in ("cameras", "images") and path.suffix in (".bin", ".txt") and colmap.is_model(path.parent)
    return path.parent if model or path.name.endswith(mvsnet.TAIL) else path


def _is_of_name(path: Path) -> bool:
    """Whether a file is what its name says, where other programs use that name."""
    if path.name == gaussians.NAME:
        return gaussians.is_gaussians(read_json(path))
    return path.suffix != ".npz" or neus.is_neus(path)


def _written(path: Path) -> Iterator[Path]:
    """Files of any name that begin as those of a program."""
    yield from (file for file in sorted(path.glob(meshroom.PATTERN)))
    yield from (file for file in sorted(path.glob("*.xml")) if metashape.is_metashape(file))
    yield from (file for file in sorted((*path.glob("*.out"), *path.glob("bundle/*.out"))) if bundler.is_bundle(file))
    yield from sorted(path.glob(nvm.PATTERN))


def _models(path: Path) -> list[Path]:
    """The models of COLMAP of a folder."""
    for name in MODELS:
        place = path / name
        found = [folder for folder in (place, *_folders(place)) if colmap.is_model(folder)]
        if found:
            return found
    return []


def _largest(path: Path, models: list[Path]) -> Path:
    """The model with most pictures: COLMAP writes one for each part that it cannot connect with the others."""
    largest = max(models, key=_model_size)
    if len(models) > 1:
        others = ", ".join(str(model.relative_to(path)) for model in models if model != largest)
        warnings.warn(
            f"{path}: {len(models)} models of COLMAP, of which the largest is read, {largest.relative_to(path)}; name "
            f"the folder of another ({others}) for that",
            stacklevel=3,
        )
    return largest


def _folders(path: Path) -> list[Path]:
    return sorted(folder for folder in path.iterdir() if folder.is_dir()) if path.is_dir() else []


def _model_size(folder: Path) -> int:
    return max(file.stat().st_size for file in folder.glob("images.*"))


def _only(path: Path, found: list[Path]) -> Path:
    if len(found) > 1:
        raise ValueError(f"{path}: which of {', '.join(file.name for file in found)}? Name the file")
    return found[0]
