"""Cameras found in a folder, whatever program wrote them, and read with their pictures (docs/reference/cameras.md)."""

from collections.abc import Callable
from pathlib import Path

import torch

from diff3ds._files import read_json
from diff3ds._shapes import Float, Tensor
from diff3ds.frames import file_of
from diff3ds.photogrammetry import bundler, colmap, meta_data, metashape, openmvg
from diff3ds.photogrammetry.picture_files import pictures_in, views_of, with_masks
from diff3ds.photogrammetry.point_files import load_points
from diff3ds.photogrammetry.shot import Shot
from diff3ds.transforms import View
from diff3ds.transforms import present_views as views_of_transforms

# Where COLMAP and those who use it keep models, below the folder of a project.
MODELS = ("sparse", "colmap/sparse", "colmap", "dense/sparse", "distorted/sparse", ".")
WANTED = (
    "a transforms.json (nerfstudio, instant-ngp), a COLMAP model (sparse/0), Metashape's cameras.xml, Bundler's "
    "bundle.out, OpenMVG's sfm_data.json, or the meta_data.json of NEF and EMAP"
)
# What else a folder may hold, and what to do with it.
OTHERS = {
    "*.psx": "a Metashape project: export its cameras as Agisoft XML",
    "*.rcproj": "a RealityCapture project: export its registration as COLMAP or Bundler",
    "*.rsproj": "a RealityScan project: export its registration as COLMAP or Bundler",
    "*.nvm": "a model of VisualSfM: save it as Bundler's",
    "database.db": 'COLMAP\'s database, which has no poses: run its mapper, or "diff3ds cameras" on the pictures',
    "*.p4d": "a Pix4D project: export it as Bundler's",
    "project.ini": "COLMAP's settings",
}


class NoCamerasError(FileNotFoundError):
    """A folder without cameras; perhaps with pictures, whose cameras can be found.

    Attributes:
        pictures: in it.
    """

    def __init__(self, message: str, pictures: list[Path]) -> None:
        super().__init__(message)
        self.pictures = pictures


def find_project(path: Path, target: str | None = None) -> Path:
    """The file, or of COLMAP the folder, with the cameras of a folder.

    Of transforms files `transforms.json`, `transforms_train.json`, or the one of the target.

    Args:
        path: a folder, or such a file itself.
        target: edges, color, color-edges, or None for any.

    Raises:
        NoCamerasError: there is none; says what was found and what would do.
        FileNotFoundError: no such folder.
        ValueError: there are several.
    """
    if not path.is_dir():
        if not path.exists():
            raise FileNotFoundError(f"{path}: no such file or folder")
        return path.parent if path.stem in ("cameras", "images") and colmap.is_model(path.parent) else path
    kinds = {None: ["edges", "color"], "edges": ["edges"]}.get(target, ["color"])
    for name in ("transforms.json", "transforms_train.json", *(f"transforms_{kind}.json" for kind in kinds)):
        if (path / name).is_file():
            return path / name
    if found := sorted(path.glob("transforms*.json")):
        return _only(path, found)
    if models := _models(path):
        # COLMAP writes one for each part that it cannot connect with the others.
        return max(models, key=_model_size)
    for name in (meta_data.NAME, openmvg.NAME):
        if (path / name).is_file():
            return path / name
    written = [file for file in sorted(path.glob("*.xml")) if metashape.is_metashape(file)]
    written += [file for file in sorted((*path.glob("*.out"), *path.glob("bundle/*.out"))) if bundler.is_bundle(file)]
    if not written:
        raise NoCamerasError(*_nothing(path))
    return _only(path, written)


def present_views(path: Path, target: str | None = None) -> list[View]:
    """The views of a project that `find_project` has found, those whose pictures are there.

    Args:
        path: as found.
        target: edges prefers maps of edges to pictures where a project has both; None does so of NEF and EMAP.

    Raises:
        FileNotFoundError: the file is missing; pictures are missing, and fewer than three are left.
        ValueError: a damaged file, or a lens that is not supported; the message names the file and the place.
    """
    reader = _reader(path)
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
    if path.is_dir():
        return colmap.read_points(path)
    if path.name == openmvg.NAME:
        return openmvg.read_openmvg_points(path)
    if path.suffix == ".out":
        return bundler.read_bundle_points(path)
    file = _points_file(path) if _reader(path) is None else None
    return torch.zeros((0, 3), dtype=torch.float64) if file is None else load_points(file)


def _points_file(path: Path) -> Path | None:
    """The PLY file that a transforms.json names, as nerfstudio writes it."""
    data = read_json(path)
    name = data.get("ply_file_path") if isinstance(data, dict) else None
    file = file_of(path, name) if isinstance(name, str) and name else None
    return file if file is not None and file.is_file() else None


def _reader(path: Path) -> Callable[[Path], list[Shot]] | None:
    """What reads such a file or folder; None reads a transforms.json."""
    if path.is_dir():
        return colmap.read_model
    if path.suffix == ".xml":
        return metashape.read_metashape
    if path.suffix == ".out":
        return bundler.read_bundle
    if path.suffix != ".json":
        raise ValueError(f"{path}: not a file with cameras. What would do: {WANTED}")
    if path.name == openmvg.NAME or path.name == meta_data.NAME:
        return openmvg.read_openmvg if path.name == openmvg.NAME else meta_data.read_meta_data
    data = read_json(path)
    if isinstance(data, dict) and "sfm_data_version" in data:
        return openmvg.read_openmvg
    return None


def _models(path: Path) -> list[Path]:
    """The models of COLMAP of a folder."""
    for name in MODELS:
        place = path / name
        found = [folder for folder in (place, *_folders(place)) if colmap.is_model(folder)]
        if found:
            return found
    return []


def _folders(path: Path) -> list[Path]:
    return sorted(folder for folder in path.iterdir() if folder.is_dir()) if path.is_dir() else []


def _model_size(folder: Path) -> int:
    return max(file.stat().st_size for file in folder.glob("images.*"))


def _only(path: Path, found: list[Path]) -> Path:
    if len(found) > 1:
        raise ValueError(f"{path}: which of {', '.join(file.name for file in found)}? Name the file")
    return found[0]


def _nothing(path: Path) -> tuple[str, list[Path]]:
    """Says what a folder without cameras holds."""
    pictures = pictures_in(path)
    held = [f"{name.name} is {what}" for pattern, what in OTHERS.items() for name in sorted(path.glob(pattern))[:1]]
    if pictures:
        where = pictures[0].parent
        held.insert(0, f"{len(pictures)} pictures" + ("" if where == path else f" in {where.name}"))
    found = "; ".join(held) or "no pictures either"
    advice = f'"diff3ds cameras {path}" finds cameras of photographs. ' if pictures else ""
    lack = f"{path}: no file that says where pictures were taken from. Found: {found}"
    return f"{lack}. {advice}What would do: {WANTED}", pictures
