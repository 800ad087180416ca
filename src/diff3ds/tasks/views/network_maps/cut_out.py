"""Masks of the object that a network finds in posed photographs: `diff3ds views --cut-out`."""

from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.pictures.content.foreground import load_foreground
from diff3ds.pictures.picture_options import Target
from diff3ds.tasks.progress import Report
from diff3ds.tasks.views.network_maps.kept_maps import Size, keep_maps, views_of
from diff3ds.transforms import NAMED

# The folder of the masks in that of the results.
MASKS = "masks_rembg"
INSTEAD = "masks of your own: a folder 'masks' beside the photographs, and --masks object"


def cut_out(path: Path, target: Target | None, out: Path, size: int, resume: bool, report: Report) -> list[Path]:
    """Writes a mask of each photograph, white where the object is, and returns their files, for `load_posed`.

    Args:
        path: project of the photographs.
        target: what is wanted of them.
        out: folder of the results.
        size: photographs are reduced to this many pixels along the longer side.
        resume: masks that are there are kept.
        report: called for each photograph.

    Raises:
        ValueError: the photographs have masks; one cannot be read.
        ImportError, FileNotFoundError, OSError: as `load_foreground` and `views_of`; the folder cannot be written.
    """
    views = views_of(path, target)
    if masked := [view.picture.name for view in views if view.mask]:
        some = ", ".join(masked[:NAMED]) + (", ..." if len(masked) > NAMED else "")
        raise ValueError(f"{path}: {len(masked)} pictures have masks ({some}): leave --cut-out out, or take them away")
    found = load_foreground(INSTEAD)

    def mask(colors: Float[Tensor, "h w 3"], wanted: Size) -> Float[Tensor, "H W 1"]:
        share = found(colors).permute(2, 0, 1)[None]
        larger: Tensor = torch.nn.functional.interpolate(share, wanted, mode="bilinear", align_corners=False)
        return larger[0].permute(1, 2, 0)

    return keep_maps(views, out / MASKS, size, mask, True, "masks by rembg", resume, report)
