"""Views as pictures, by themselves and on pages."""

from collections.abc import Iterator, Sequence

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.page.drawn_paths import ink_boxes
from diff3ds.page.sheet.page_layout import lay_out
from diff3ds.page.sheet.page_setup import PageSetup
from diff3ds.render import render
from diff3ds.sketch import Sketch

# Pixels that are drawn in one call: some 200 MB.
PIXELS_AT_ONCE = 1 << 22
Image = Float[Tensor, "H W C"]
Color = tuple[float, float, float]
WHITE: Color = (1.0, 1.0, 1.0)


def view_pictures(
    sketches: Sequence[Sketch], cameras: Cameras, color: Color | None = WHITE, alike: bool = False
) -> Iterator[Image]:
    """Each view as an RGB picture, or where there is no background as straight RGBA.

    Args:
        sketches: of each view.
        cameras: the views.
        color: of the background, or None for none.
        alike: whether the sketches are one: then a few views are drawn at once.
    """
    at_once = max(1, PIXELS_AT_ONCE // (cameras.size[0] * cameras.size[1])) if alike else 1
    for first in range(0, len(cameras), at_once):
        sketch = sketches[first]
        ground = torch.tensor(color or (0.0, 0.0, 0.0), dtype=sketch.color.dtype)
        drawn = render(sketch, cameras[first : first + at_once], background=ground)
        images = drawn.color
        if color is None:
            alpha = drawn.alpha[..., None]
            images = torch.cat([images / alpha.clamp(min=1e-6), alpha], -1)
        yield from images


def page_pictures(
    sketches: Sequence[Sketch],
    cameras: Cameras,
    page: PageSetup,
    pixels_per_mm: float,
    color: Color | None = WHITE,
    alone: bool = False,
) -> Iterator[Image]:
    """Pictures of pages, as `view_pictures`.

    Args:
        sketches: of each view.
        cameras: the views.
        page: that they lie on.
        pixels_per_mm: of the pictures.
        color: of the background, or None for none.
        alone: whether each view has a page of its own; otherwise there is one, of all.
    """
    layout = lay_out(cameras, page, ink_boxes(sketches), alone=alone, pixels_per_mm=pixels_per_mm)
    width, height = (max(round(side), 1) for side in layout.size)

    def blank() -> Image:
        return torch.tensor(color or (0.0, 0.0, 0.0, 0.0)).repeat(height, width, 1)

    sheet = blank()
    for view, sketch in enumerate(sketches):
        alone_there, (x, y) = layout.in_pixels(view)
        (image,) = view_pictures([alone_there.widened(sketch)], alone_there.cameras, color)
        place = sheet[y : y + image.shape[0], x : x + image.shape[1]]
        place[:] = image[: place.shape[0], : place.shape[1]]
        if alone:
            yield sheet
            sheet = blank()
    if not alone:
        yield sheet
