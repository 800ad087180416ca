"""Edge maps that users bring: a folder with one for each photograph, by its name."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from os.path import commonpath
from pathlib import Path

from diff3ds.formats.png import size_of
from diff3ds.frames import SUFFIXES
from diff3ds.photogrammetry.picture_files import pictures_in
from diff3ds.transforms import NAMED, View, is_copy_of_size

RULE = "An edge map has the name of its photograph, with any suffix: 001.png is the map of 001.jpg"
# What detectors write behind the names of photographs.
TAILS = ("", "_edges", "_edge")


def with_edge_maps(views: Sequence[View], folder: Path) -> list[View]:
    """The views with edge maps in place of their photographs; cameras, lenses and masks are those of the photographs.

    Args:
        views: of photographs that are there.
        folder: as for `edge_maps_of`.

    Raises:
        FileNotFoundError, ValueError: as `edge_maps_of`.
    """
    maps = edge_maps_of([view.picture for view in views], [view.size for view in views], folder)
    return [replace(view, picture=file, photograph=view.picture) for view, file in zip(views, maps, strict=True)]


def edge_maps_of(pictures: Sequence[Path], sizes: Sequence[tuple[int, int]], folder: Path) -> list[Path]:
    """The edge map of each photograph.

    Photographs in several folders have their maps in folders of the same names, or, where all names differ, in one.
    Maps may be smaller or larger than the photographs, but show all of them.

    Args:
        pictures: the photographs.
        sizes: (height, width) of each.
        folder: with the maps.

    Raises:
        FileNotFoundError: no such folder, or photographs without a map.
        ValueError: a map of no photograph, two maps of one, one map of two, or a map of another shape.
    """
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder of edge maps")
    base = Path(commonpath([picture.absolute().parent for picture in pictures]))
    found = [_maps(picture.absolute(), base, folder) for picture in pictures]
    _check_names(pictures, found, folder)
    maps = [some[0] for some in found]
    for picture, size, file in zip(pictures, sizes, maps, strict=True):
        there = size_of(file)
        if not is_copy_of_size(there, size):
            raise ValueError(
                f"{file}: an edge map of {there[1]} x {there[0]} pixels is not all of its photograph {picture.name}, "
                f"which has {size[1]} x {size[0]}: cut or enlarge it to the same shape"
            )
    return maps


def _maps(picture: Path, base: Path, folder: Path) -> list[Path]:
    """What may be the map of a picture: in the folder of its name, or else in the one of all."""
    inside = picture.parent.relative_to(base)
    for place in dict.fromkeys((folder / inside, folder)):
        # Some programs write .png behind the whole name.
        stems = [picture.name, *(picture.stem + tail for tail in TAILS)]
        named = [place / f"{stem}{suffix}" for stem in stems for suffix in SUFFIXES]
        if found := [file for file in named if file.is_file() and file.resolve() != picture.resolve()]:
            # Where capitals do not count, .png and .PNG are one file.
            return [f for i, f in enumerate(found) if not any(f.samefile(other) for other in found[:i])]
    return []


def _check_names(pictures: Sequence[Path], found: Sequence[list[Path]], folder: Path) -> None:
    missing = [picture.name for picture, maps in zip(pictures, found, strict=True) if not maps]
    there = pictures_in(folder)
    if missing:
        raise FileNotFoundError(
            f"{folder}: {len(missing)} of {len(pictures)} photographs have no edge map there: {_some(missing)}. "
            f"{_instead(there, folder)}. {RULE}"
        )
    for picture, maps in zip(pictures, found, strict=True):
        if len(maps) > 1:
            raise ValueError(f"{folder}: {maps[0].name} or {maps[1].name} for {picture.name}? Leave one there")
    taken = Counter(maps[0].resolve() for maps in found)
    for picture, maps in zip(pictures, found, strict=True):
        if taken[maps[0].resolve()] > 1:
            raise ValueError(
                f"{maps[0]}: of several photographs of this name? Put maps into folders named as those of the "
                f"photographs: {folder / picture.absolute().parent.name / maps[0].name}"
            )
    # Photographs that have no camera may have a map as well.
    beside = {other.stem for place in {picture.parent for picture in pictures} for other in pictures_in(place)}
    known = {stem + tail for stem in beside for tail in TAILS}
    stray = [f.name for f in there if f.resolve() not in taken and not {f.stem, Path(f.stem).stem} & known]
    if stray:
        raise ValueError(f"{folder}: {len(stray)} edge maps are of no photograph: {_some(stray)}. {RULE}")


def _instead(there: list[Path], folder: Path) -> str:
    """What a folder holds in place of what was looked for."""
    if there:
        return f"There are {len(there)} pictures: {_some([file.name for file in there])}"
    inner = [place.name for place in sorted(folder.iterdir()) if place.is_dir() and pictures_in(place)]
    return f"There are pictures in its folders {_some(inner)}: name one of these" if inner else "It has no pictures"


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:NAMED]) + (", ..." if len(names) > NAMED else "")
