"""Pictures of a run beside what they became: some of the targets, before there are strokes and after."""

from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import evenly_spaced
from diff3ds.formats import save_png, tile_images
from diff3ds.pictures.dataset import PosedPictures
from diff3ds.sketch import Sketch
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.progress import Progress, Report
from diff3ds.with_surface import render

PREVIEWS = 8
# A picture of some of the pictures, there as soon as there are strokes beside which to see it.
TARGETS = "targets.png"
# Gray of what masks leave out, lens distortion takes away, or smaller pictures do not have.
UNKNOWN = 0.5


def preview(sketch: Sketch, pictures: PosedPictures, surface: TriangleMesh | None = None) -> Float[Tensor, "H W 3"]:
    """Eight views, each target beside the rendering of the sketch; gray is what is not known of a target.

    Args:
        sketch: in the world of the cameras.
        pictures: the targets.
        surface: hides lines of the sketch, and is drawn by its contours.
    """
    drawn = render(sketch, pictures.cameras[evenly_spaced(len(pictures), PREVIEWS)], surface=surface).color
    return tile_images(torch.cat([_some(pictures), drawn.clamp(0, 1)], 2), columns=2)


def _some(pictures: PosedPictures) -> Float[Tensor, "B H W 3"]:
    """The pictures of the preview's views; gray is what is not known of them."""
    targets = pictures.batch(evenly_spaced(len(pictures), PREVIEWS))
    return torch.where(targets.known[..., None], targets.images, torch.tensor(UNKNOWN))


def after_targets(pictures: PosedPictures, out: Path, report: Report) -> Report:
    """Reports that write `TARGETS` before the first of them that has strokes."""
    written = False

    def told(progress: Progress) -> None:
        nonlocal written
        if progress.sketch is not None and not written:
            written = True
            save_png(out / TARGETS, tile_images(_some(pictures), columns=4))
        report(progress)

    return told
