"""Pictures of what lies behind the objects: one for all views, or a clean plate of each."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from diff3ds._shapes import Tensor
from diff3ds.distortion import NO_DISTORTION
from diff3ds.formats.png import size_of
from diff3ds.photogrammetry.find_project import present_views
from diff3ds.photogrammetry.lens_change import UNCHANGED, LensChange
from diff3ds.pictures.dataset import reduced
from diff3ds.pictures.picture_options import Masks
from diff3ds.pictures.reading.load_views import Told, load_views
from diff3ds.pictures.reading.read_view import decode, shown
from diff3ds.pictures.store import Store, opaque_views
from diff3ds.transforms import NAMED, View, of_picture_sizes


@dataclass(frozen=True, eq=False)
class CleanPlates:
    """What lies behind the objects of V pictures.

    Attributes:
        source: the picture or the folder.
        store: opaque colour (C = 4), on the canvas of the pictures.
        again: reads all of them again, with lenses that have changed; None if they were not read.
    """

    source: Path
    store: Store
    again: Callable[[LensChange], "CleanPlates"] | None = None

    def chosen(self, views: Sequence[int]) -> "CleanPlates":
        """Those of these pictures alone."""
        return replace(self, store=self.store.chosen(views))

    def refined(self, lens: LensChange, views: Sequence[int]) -> "CleanPlates":
        """Those of these pictures alone, made straight as of lenses with another distortion."""
        plates = self.again(lens) if self.again is not None and lens.k1 else self
        return plates.chosen(views)

    def digest(self) -> str:
        """SHA-256 of the pixels."""
        found = hashlib.sha256()
        for views in self.store.chunks():
            found.update(self.store.pixels[views].numpy().tobytes())
        return found.hexdigest()


def load_clean_plates(
    path: Path,
    source: Path,
    size: int = 512,
    scratch: Path | None = None,
    told: Told = lambda done, total: None,
    change: LensChange = UNCHANGED,
) -> CleanPlates:
    """Loads what lies behind the pictures of a project, reduced and undistorted as `load_posed` does it.

    Args:
        path: what `find_project` has found.
        source: one picture, scaled to the size of each view; or a folder with a picture for each view, of its size, by
            the file name of the view's picture, in that folder or in one of the same name as the picture's.
        size: as for `load_posed`.
        scratch: as for `load_posed`.
        told: as for `load_posed`.
        change: as for `load_posed`.

    Raises:
        FileNotFoundError: the folder lacks pictures.
        ValueError: a picture that cannot be read, is not opaque, or has not the size of its view; pictures of two views
            with one name.
        OSError: no room in the folder.
    """
    views = of_picture_sizes(path, [change.of(view) for view in present_views(path, "color")])
    sizes = [reduced(view.size, size) for view in views]
    if source.is_dir():
        store = load_views(_one_each(source, views), sizes, None, scratch, told=told)
    else:
        picture = decode(_plain(source, views[0]), max(sizes))

        def read(view: View, size: tuple[int, int], masks: Masks) -> tuple[Tensor, Tensor]:
            return shown(picture, view, size)

        store = load_views(_one_for_all(source, views), sizes, None, scratch, told=told, read=read)
    if not opaque_views(store).all():
        raise ValueError(f"{source}: a background must be opaque, but has transparent pixels: lay it over a colour")
    return CleanPlates(source, store, partial(load_clean_plates, path, source, size, scratch, told))


def _one_for_all(picture: Path, views: list[View]) -> list[View]:
    """Views with this picture, as if their cameras had taken it: what has lens distortion takes its own out of it."""
    plain = _plain(picture, views[0])
    height, width = plain.size

    def seen_by(view: View) -> View:
        scale = view.intrinsics.new_tensor([width / view.size[1], height / view.size[0], 1.0])
        return replace(plain, intrinsics=view.intrinsics * scale[:, None], distortion=view.distortion)

    return [seen_by(view) for view in views]


def _plain(picture: Path, view: View) -> View:
    """A view with this picture and without distortion."""
    return replace(view, picture=picture, mask=None, size=size_of(picture), distortion=NO_DISTORTION)


def _one_each(folder: Path, views: list[View]) -> list[View]:
    files = [_plate(folder, view.picture) for view in views]
    missing = [file for file in files if not file.is_file()]
    if missing:
        names = ", ".join(file.name for file in missing[:NAMED]) + (", ..." if len(missing) > NAMED else "")
        raise FileNotFoundError(
            f"{folder}: {len(missing)} of {len(files)} views have no background in this folder: {names}. "
            "Each has the file name of the view's picture; one picture for all views is given as a file"
        )
    owners: dict[Path, Path] = {}
    for file, view in zip(files, views, strict=True):
        if owners.setdefault(file, view.picture) != view.picture:
            raise ValueError(
                f"{file}: background of both {owners[file]} and {view.picture}? Put it into folders of their names: "
                + " and ".join(str(folder / p.parent.name / p.name) for p in (owners[file], view.picture))
            )
    return [replace(view, picture=file, mask=None) for file, view in zip(files, views, strict=True)]


def _plate(folder: Path, picture: Path) -> Path:
    """Finds a plate by name, or by name in a folder of that name, where several cameras count their pictures alike."""
    plate = folder / picture.name
    return plate if plate.is_file() else folder / picture.parent.name / picture.name
