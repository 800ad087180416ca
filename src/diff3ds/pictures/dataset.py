"""Posed pictures: brought onto one canvas, told apart into drawings and coloured pictures."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.camera import Cameras
from diff3ds.distortion import Distortion
from diff3ds.photogrammetry.edge_maps import with_edge_maps
from diff3ds.photogrammetry.find_project import present_views, sparse_points
from diff3ds.photogrammetry.lens_change import UNCHANGED, LensChange, shared_lens
from diff3ds.pictures.content.cutout import CLEAR
from diff3ds.pictures.content.ink import is_thin
from diff3ds.pictures.content.masks import has_left_out
from diff3ds.pictures.picture_options import Masks, Target
from diff3ds.pictures.reading.load_views import Told, canvas_of, load_some, load_views
from diff3ds.pictures.reading.read_view import decode, shown
from diff3ds.pictures.sight import check_sight
from diff3ds.pictures.store import Batch, Store
from diff3ds.transforms import NAMED, View, near_of, of_picture_sizes, one_kind, require_files

# Gray pictures whose background takes more than this fraction of the pixels are edge maps or line drawings. A drawing's
# lines rarely cover a third; photographs have no single background value.
DRAWING_BACKGROUND = 0.65
# How far channels, or background pixels, may lie apart: 5 % hides the noise of JPEG files.
SAME = 0.05
# What pictures are is told from some of them, evenly spread, at a reduced size. Enough for a median.
LOOKED_AT, LOOKED_SIZE = 16, 512


@dataclass(frozen=True, eq=False)
class PosedPictures:
    """V pictures with their cameras, on one canvas: pictures smaller than it lie at its top left.

    Attributes:
        cameras: in the world of the file, float64, without lens distortion, of the canvas's size.
        target: what the pictures are.
        store: ink (C = 1) of edge maps, whatever their polarity; else colour with alpha (C = 4), alpha 1 in pictures
            that have none.
        names: file names.
        masked: how many of them have a `mask_path`.
        points: of the reconstruction that found the cameras, in their world, float64, unless colours are wanted; None
            where there are none.
        lens: that was taken out of all of them; None if several cameras have taken them.
        again: reads all of them again, with lenses that have changed; None if they were not read.
    """

    cameras: Cameras
    target: Target
    store: Store
    names: tuple[str, ...]
    masked: int = 0
    points: Float[Tensor, "P 3"] | None = None
    lens: Distortion | None = None
    again: Callable[[LensChange], "PosedPictures"] | None = None

    def __len__(self) -> int:
        return len(self.cameras)

    def digest(self) -> str:
        """The digest of the pictures and their cameras: a run of others is another run."""
        matrices = (self.cameras.world_to_camera, self.cameras.intrinsics)
        posed = b"".join(m.detach().cpu().contiguous().numpy().tobytes() for m in matrices)
        posed += b"orthographic" if self.cameras.orthographic else b""
        return hashlib.sha256(posed + self.store.digest().encode()).hexdigest()

    def chosen(self, views: Sequence[int]) -> "PosedPictures":
        """These pictures alone, with their cameras; `masked` is still of all."""
        names = tuple(self.names[view] for view in views)
        return replace(self, cameras=self.cameras[list(views)], store=self.store.chosen(views), names=names)

    def batch(self, views: Sequence[int] | Int[Tensor, " B"]) -> Batch:
        """These views as floating point numbers."""
        return self.store.batch(views)


def load_posed(
    path: Path,
    target: Target | None = None,
    size: int = 512,
    scratch: Path | None = None,
    masks: Masks = "ignore",
    told: Told = lambda done, total: None,
    edges: Path | None = None,
    cut: Sequence[Path] | None = None,
) -> PosedPictures:
    """The pictures and cameras of a project; those whose pictures are missing are left out with a warning.

    Each picture is decoded once, several at a time on as many threads as torch has. They are kept with 8 bits a
    channel, in memory or, if they and their pyramid take more than 1 GiB, in a file without a name that goes with them.

    Args:
        path: a transforms.json, or what else `find_project` finds.
        target: what the pictures are; None looks at them and finds edges or colour.
        size: each picture is reduced to at most this many pixels along its longer side.
        scratch: folder for such a file, existing or to be made; default the system's for temporary files.
        masks: what black pixels of a `mask_path` mean: ignore leaves them out of all losses and scores, object takes
            them for background.
        told: called with the number of pictures that have been read, and of all.
        edges: folder with edge maps of the pictures (`with_edge_maps`), which take their place: the target is edges.
        cut: a mask of each picture, white where the object is, in place of its own; `masks` is object then.

    Raises:
        FileNotFoundError, ValueError: a missing or unreadable file; cameras that look at nothing in common, before any
            picture is read (see `check_sight`); pictures whose size is not that of the cameras, or that all show
            nothing.
        OSError: no room in the folder.
    """
    return _Order(path, target, size, scratch, masks, told, edges, cut).read()


@dataclass(frozen=True)
class _Order:
    """What is to be read; arguments as of `load_posed`."""

    path: Path
    target: Target | None
    size: int
    scratch: Path | None
    masks: Masks
    told: Told
    edges: Path | None
    cut: Sequence[Path] | None

    def read(self, change: LensChange = UNCHANGED) -> PosedPictures:
        """The pictures, with lenses that differ so from what the project says."""
        views, sizes = self._views(change)
        cameras = _cameras(self.path, views, sizes)
        masks: Masks = self.masks if self.cut is None else "object"
        drawn = self.edges is not None or self.target == "edges"
        background, first = None, None
        if drawn or self.target is None:
            some = [i * len(views) // min(len(views), LOOKED_AT) for i in range(min(len(views), LOOKED_AT))]
            looks = _Looks()
            looked = [looked_size(view, size) for view, size in zip(views, sizes, strict=True)]
            first = load_some(views, sizes, looked, some, looks, self.scratch, masks, self.told)
            background = _background([views[i] for i in some], looks, drawn, masks)
            if self.edges and not _is_gray(torch.cat(looks.pixels)):
                raise ValueError(
                    f"{self.edges}: the pictures are coloured, and edge maps are gray, such as white on black"
                )
        store = load_views(views, sizes, background, self.scratch, masks, self.told, first)
        if not _shows(store):
            raise ValueError(f"{self.path}: the pictures show nothing: {_nothing(store, views, masks)}")
        if background is not None:
            _require_one_polarity(store, views, background)
        found: Target = "edges" if self.edges else self.target or ("color" if background is None else "edges")
        names, masked = tuple(view.picture.name for view in views), sum(view.mask is not None for view in views)
        points = None if found == "color" else sparse_points(self.path)
        points = points if points is not None and len(points) else None
        return PosedPictures(cameras, found, store, names, masked, points, shared_lens(views), self.read)

    def _views(self, change: LensChange) -> tuple[list[View], list[tuple[int, int]]]:
        """The views, and the (height, width) of their reduced pictures."""
        views = [change.of(view) for view in present_views(self.path, "color" if self.edges else self.target)]
        if self.cut is not None:
            views = [replace(view, mask=mask) for view, mask in zip(views, self.cut, strict=True)]
        if self.edges:
            views = with_edge_maps(views, self.edges)
        require_files(self.path, [view.mask for view in views if view.mask], "masks")
        sizes = [reduced(view.size, self.size) for view in views]
        check_sight(self.path, _cameras(self.path, views, sizes), sizes)
        views = of_picture_sizes(self.path, views)
        return views, [reduced(view.size, self.size) for view in views]


def reduced(full: tuple[int, int], size: int) -> tuple[int, int]:
    """(height, width) of a picture reduced to at most this many pixels along its longer side."""
    scale = min(1.0, size / max(full))
    return max(1, round(full[0] * scale)), max(1, round(full[1] * scale))


def looked_size(view: View, size: tuple[int, int]) -> tuple[int, int]:
    """(height, width) for which a picture is decoded that is looked at and kept in this size."""
    return max(reduced(view.size, LOOKED_SIZE), size)


def _cameras(path: Path, views: list[View], sizes: list[tuple[int, int]]) -> Cameras:
    """Cameras of the canvas that holds all the reduced pictures."""
    intrinsics = []
    for view, (height, width) in zip(views, sizes, strict=True):
        scale = view.intrinsics.new_tensor([width / view.size[1], height / view.size[0], 1.0])
        intrinsics.append(view.intrinsics * scale[:, None])
    poses = torch.stack([view.world_to_camera for view in views])
    orthographic = one_kind(path, views)
    try:
        return Cameras(poses, torch.stack(intrinsics), canvas_of(sizes), near_of(poses), orthographic)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _shows(store: Store) -> bool:
    """Whether the pictures have more than one colour."""
    low, high = torch.ones(store.pixels.shape[3]), torch.zeros(store.pixels.shape[3])
    for views in store.chunks():
        batch = store.batch(views)
        values = batch.pixels[batch.known]
        if len(values):
            low, high = torch.minimum(low, values.amin(0)), torch.maximum(high, values.amax(0))
        if bool((high - low > SAME).any()):
            return True
    return False


def _nothing(store: Store, views: list[View], masks: Masks) -> str:
    """Why pictures show nothing."""
    seen = [store.batch([view]) for view in range(len(store))]
    values = torch.cat([batch.pixels[batch.known] for batch in seen])
    if not len(values):
        return _left_nothing(views, masks)
    if values.shape[1] == 4 and float(values[:, 3].max()) == 0:
        return f"all {len(views)} are transparent everywhere" + (", by their masks" if views[0].mask else "")
    spread = float((values.amax(0) - values.amin(0)).max())
    if spread == 0:
        return f"all pixels of all {len(views)} have one colour"
    return (
        f"all pixels of all {len(views)} have one colour, but for {spread:.1g} of the range from black to white"
        " (were numbers of 8 bits saved as 16 bits?)"
    )


def _left_nothing(views: list[View], masks: Masks) -> str:
    """Says what leaves no pixel of these views known."""
    if any(has_left_out(view, masks) for view in views):
        return "masks leave out everything: black pixels do not count, or the others of a dynamic_mask_*.png"
    return "lens distortion leaves nothing: check k1 to k3"


class _Looks:
    """Reads views, and looks at what they are: colours with alpha, at a reduced size."""

    def __init__(self) -> None:
        self.pixels: list[Tensor] = []
        # Whether what is opaque is lines, of pictures with transparent areas.
        self.thin: list[bool] = []

    def __call__(self, view: View, size: tuple[int, int], masks: Masks) -> tuple[Tensor, Tensor]:
        """As `read_view`."""
        small = reduced(view.size, LOOKED_SIZE)
        picture = decode(view, looked_size(view, size), masks)
        # What a mask of the object hides has the background's value, which is not known yet.
        rgba, known = shown(picture, view, small, cut=False)
        self.pixels.append(rgba[known])
        if float(rgba[..., 3].min()) < CLEAR and bool((rgba[..., 3] > 0).any()):
            self.thin.append(is_thin(rgba[..., 3].numpy()))
        return shown(picture, view, size)


def _background(views: list[View], looks: _Looks, drawn: bool, masks: Masks) -> float | None:
    """Value of the background, 0 or 1, if the pictures are edge maps or line drawings (known or found), else None.

    A transparent ground is white, but for lines that are light themselves: ink is what is opaque.

    Args:
        looks: at these views.
        drawn: whether they are drawings is known.
        masks: as for `load_posed`.
    """
    pixels = torch.cat(looks.pixels)
    gray = pixels[:, :3].mean(1) + 1 - pixels[:, 3]
    if not len(gray):
        raise ValueError(f"{views[0].picture}: of this and other pictures {_left_nothing(views, masks)}")
    inked = pixels[pixels[:, 3] > CLEAR]
    if looks.thin and all(looks.thin) and len(inked) < (1 - DRAWING_BACKGROUND) * len(pixels):
        light = float((inked[:, :3].mean(1) / inked[:, 3]).median()) > 0.5
        if light and (drawn or _is_gray(pixels)):
            return 0.0
    middle = float(gray.median())
    plain = float(((gray - middle).abs() < SAME).float().mean()) > DRAWING_BACKGROUND
    extreme = min(middle, 1 - middle) < SAME
    return float(middle >= 0.5) if drawn or (plain and extreme and _is_gray(pixels)) else None


def _is_gray(pixels: Float[Tensor, "M 4"]) -> bool:
    """Whether hardly any of these pixels has a colour."""
    tint = pixels[:, :3].amax(1) - pixels[:, :3].amin(1)
    return float((tint < SAME).float().mean()) > 0.999


def _require_one_polarity(store: Store, views: list[View], background: float) -> None:
    """Sees that all drawings are dark on light, or all light on dark.

    Raises:
        ValueError: some are mostly ink: these are the other way round.
    """
    names = []
    for view in range(len(store)):
        batch = store.batch([view])
        ink = batch.alpha[batch.known]
        if len(ink) and float(ink.median()) > 0.5:
            names.append(views[view].picture.name)
    if names:
        kinds = ("light on dark", "dark on light")
        this, other = kinds if background == 0 else kinds[::-1]
        raise ValueError(
            f"{len(names)} of {len(views)} drawings are {other}, the others {this}: {', '.join(names[:NAMED])}"
            f"{', ...' if len(names) > NAMED else ''}. Invert them"
        )
