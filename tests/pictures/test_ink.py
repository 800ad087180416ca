"""Drawings on paper, as a camera sees them: shadows and grain are no ink, photographs are no drawings."""

import numpy as np
import pytest
import torch
from PIL import Image, ImageDraw

from diff3ds.formats import save_png
from diff3ds.pictures.content.ink import beside_page, ink_on_paper
from diff3ds.pictures.reference_picture import read_reference
from diff3ds.recognition.picture_lines import lines_of

SIZE = 400


def distance() -> torch.Tensor:
    centres = torch.arange(SIZE) + 0.5 - SIZE / 2
    return torch.hypot(centres[None], centres[:, None])


def sheet(grain: float = 0.03) -> torch.Tensor:
    """Yellowish paper, half as bright in one corner as in the other."""
    slope = torch.linspace(0, 1, SIZE)
    light = (0.45 + 0.25 * slope[None] + 0.2 * slope[:, None])[..., None] * torch.tensor([1.0, 0.95, 0.85])
    return light + grain * torch.randn(SIZE, SIZE, 3, generator=torch.Generator().manual_seed(0))


def circle(width: float) -> torch.Tensor:
    return ((width / 2 - (distance() - 130).abs()) + 0.5).clamp(0, 1)[..., None]


@pytest.mark.parametrize("width", [3.0, 8.0])
def test_a_photographed_drawing(tmp_path, width):
    """A pencil takes away two thirds of the light; the circle of 130 pixels is found, in the middle of its box."""
    save_png(tmp_path / "a.png", (sheet() * (1 - 0.67 * circle(width))).clamp(0, 1))
    lines = lines_of(read_reference(tmp_path / "a.png"))
    assert lines.kind == "drawing"
    assert np.abs(np.linalg.norm(lines.points, axis=1) - 0.5).max() < 0.015


def test_ink_is_where_the_pencil_was():
    ink = ink_on_paper((sheet() * (1 - 0.67 * circle(6.0))).clamp(0, 1).numpy())
    drawn = circle(6.0)[..., 0].numpy()
    assert ink[drawn == 1].min() > 0.3
    assert ink[np.abs(distance().numpy() - 130) > 8].max() == 0


def beside(*shapes) -> torch.Tensor:
    """1 where shapes lie over the sheet: polygons of several points, ellipses of two."""
    image = Image.new("L", (SIZE, SIZE), 0)
    for points in shapes:
        (ImageDraw.Draw(image).ellipse if len(points) == 2 else ImageDraw.Draw(image).polygon)(points, 255)
    return torch.from_numpy(np.asarray(image) / 255.0).float()[..., None]


def band(left, top, right, bottom):
    return [(left, top), (right, top), (right, bottom), (left, bottom)]


# What scanners and phones show beside a page or over its edge, and how dark.
BESIDE = {
    "two sides with the lid open": (beside(band(0, 0, 14, SIZE), band(0, SIZE - 9, SIZE, SIZE)), 0.03),
    "a broad band": (beside(band(0, 0, 50, SIZE)), 0.03),
    "all around": (
        beside(*(band(*b) for b in ((0, 0, 9, SIZE), (0, 0, SIZE, 7), (380, 0, 400, 400), (0, 394, 400, 400)))),
        0.1,
    ),
    "a page that lies askew": (beside([(0, 0), (SIZE, 0), (SIZE, 18)], [(0, 0), (0, SIZE), (18, SIZE)]), 0.05),
    "a corner": (beside([(0, 0), (70, 0), (0, 45)]), 0.05),
    "a finger": (beside([(-40, 180), (40, 250)]), 0.4),
}
QUICK = ("all around", "a page that lies askew", "a finger")


@pytest.mark.parametrize(
    "what", [*QUICK, *(pytest.param(what, marks=pytest.mark.slow) for what in BESIDE if what not in QUICK)]
)
def test_what_lies_beside_a_page_is_no_ink(what, tmp_path):
    there, gray = BESIDE[what]
    drawing = sheet(0.01) / sheet(0.01).amax() * (1 - 0.67 * circle(6.0))
    picture = (drawing * (1 - there) + gray * there).clamp(0, 1)
    ink = ink_on_paper(picture.numpy())
    assert ink is not None
    drawn = circle(6.0)[..., 0].numpy()
    assert ink[drawn == 1].min() > 0.3
    assert ink[np.abs(distance().numpy() - 130) > 8].max() == 0
    save_png(tmp_path / "a.png", picture)
    lines = lines_of(read_reference(tmp_path / "a.png"))
    assert np.abs(np.linalg.norm(lines.points, axis=1) - 0.5).max() < 0.015


@pytest.mark.parametrize("darkest", [0.5, 0.25])
def test_a_shadow_over_all_of_a_page_is_no_ink(darkest):
    light = torch.linspace(1, darkest, SIZE)[None, :, None]
    noise = 0.01 * torch.randn(SIZE, SIZE, 3, generator=torch.Generator().manual_seed(2))
    ink = ink_on_paper((light * (1 - 0.67 * circle(6.0)) + noise).clamp(0, 1).numpy())
    assert ink is not None
    assert ink[circle(6.0)[..., 0].numpy() == 1].min() > 0.3
    assert ink[np.abs(distance().numpy() - 130) > 8].max() == 0


def test_holes_of_a_page_are_no_ink():
    """Punched along one side; a spot in the drawing stays."""
    holes, spot = beside([(10, 120), (24, 134)], [(10, 270), (24, 284)]), beside([(193, 193), (207, 207)])
    page = 0.95 * (1 - 0.8 * circle(6.0)) * (1 - holes) * (1 - 0.8 * spot) * torch.ones(SIZE, SIZE, 3)
    ink = ink_on_paper(page.numpy())
    assert ink is not None
    assert ink[holes[..., 0].numpy() > 0].max() == 0
    assert ink[200, 200] == 1


def test_rules_of_a_page_are_fainter_than_what_is_drawn():
    rules = ((torch.arange(SIZE) + 14) % 28 < 2).float()[:, None, None]
    ink = ink_on_paper((0.95 * (1 - 0.25 * rules) * (1 - 0.8 * circle(6.0))).expand(SIZE, SIZE, 3).numpy())
    assert ink is not None
    assert ink[circle(6.0)[..., 0].numpy() == 1].min() > 0.5
    # A rule of two pixels, blurred by one, away from the circle.
    assert ink[14 + 28 * 12 + 1, 30] < 0.5


def test_a_thing_that_a_border_cuts_stays():
    """What reaches far in, or ends softly, is no band beside the page."""
    far = beside(band(0, 0, 120, SIZE))
    soft = (torch.linspace(0, 8, SIZE).clamp(max=1))[None, :, None]
    for picture in (0.9 * (1 - far), 0.9 * (0.3 + 0.7 * soft).expand(SIZE, SIZE, 1)):
        assert not beside_page(picture.expand(SIZE, SIZE, 3).numpy()).any()


def test_bare_paper_is_no_drawing():
    assert ink_on_paper(sheet().clamp(0, 1).numpy()) is None


@pytest.mark.parametrize("inside", [0.2, 0.5])
def test_a_thing_on_a_table_is_no_drawing(inside):
    """A disc: an area, however dark."""
    thing = (distance() < 100).float()[..., None]
    assert ink_on_paper((sheet() * (1 - thing) + inside * thing).clamp(0, 1).numpy()) is None


def test_what_goes_on_beyond_the_picture_is_no_drawing():
    """Bars of a fence."""
    bars = (torch.arange(SIZE) % 40 < 6).float()[None, :, None]
    assert ink_on_paper((sheet() * (1 - 0.67 * bars)).clamp(0, 1).numpy()) is None


def test_texture_is_no_drawing():
    chance = torch.rand(SIZE, SIZE, 3, generator=torch.Generator().manual_seed(1))
    assert ink_on_paper(chance.numpy()) is None
