"""Pictures of styles by exact areas: resvg's of their SVG files, compositing in closed form, cuts, pages."""

import math

import numpy as np
import pytest
import torch
from ink import ink_apart
from needs import needs
from style_pages import CAMERA, circle, stroke

import diff3ds as ds
from diff3ds import styles
from diff3ds.page.sheet.page_setup import PageSetup
from diff3ds.styles.inked_areas import Area, painted_pixels
from diff3ds.styles.styled_svg import styled_pixels

pytestmark = needs("pathops")
WHITE = (1.0, 1.0, 1.0)
STYLES = {
    "ink": styles.Ink(),
    "pencil": styles.PENCIL,
    "charcoal": styles.CHARCOAL,
    "marker": styles.Marker(),
    "nib": styles.Nib(),
    "watercolour": styles.Watercolour(),
    "dashed": styles.Dashed(),
    "technical": styles.Technical(),
}
QUICK = (("plain", "ink"), ("plain", "charcoal"), ("plain", "nib"), ("plain", "technical"), ("paper", "watercolour"))
PAPER = {"paper": True, "depth_cue": 0.5}
# A pencil is charcoal with other numbers; paper and depth change the inks of all alike.
QUICK_AND_SLOW = [
    pytest.param(STYLES[name], others, id=f"{name} {kind}", marks=[pytest.mark.slow] * ((kind, name) not in QUICK))
    for name in STYLES
    for kind, others in (("plain", {}), ("paper", PAPER))
]


def asked(**others):
    return {"width": 1.0, "seed": 3, "depth_cue": 0.0, "paper": False, "background": WHITE, "page": None} | others


def drawing():
    wave = stroke((-0.9, -0.7), (-0.2, 0.9), (0.3, -0.9), (0.9, 0.7))
    line = stroke((-0.9, 0.4), (-0.3, 0.1), (0.3, -0.2), (0.9, -0.5))
    some = ds.Sketch.concatenate([circle(0.5), wave, line])
    return some.replace(width=torch.full_like(some.width, 0.02), color=torch.tensor([0.2, 0.3, 0.6]).to(some.color))


def square(x0, y0, x1, y1):
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], float)


@needs("resvg_py")
@pytest.mark.parametrize(("style", "others"), QUICK_AND_SLOW)
def test_pictures_are_those_of_the_svg_file(style, others):
    how = asked(**others)
    picture = styled_pixels(drawing(), CAMERA, style, **how)
    expected = styles.svg_pixels(styles.styled_svg(drawing(), CAMERA, style, **how))[..., :3]
    assert picture.shape == expected.shape
    # Resvg samples 16 places a pixel, each off by 1/32 of it along an edge; outlines in files are fitted to .08 px.
    assert (picture - expected).abs().max() < 0.35
    assert (picture - expected).abs().mean() < 2 / 255
    assert ink_apart(picture, expected) == 0


@needs("resvg_py")
def test_pages_and_views_lie_where_they_do_in_the_file():
    cameras = ds.orbit(torch.tensor([0.0, 30.0]), 10.0, 3.0, height=2.0, size=256)
    how = asked(page=PageSetup.of("60x40", margin=5.0))
    picture = styled_pixels(drawing(), cameras, styles.Ink(), pixels_per_mm=6.0, **how)
    assert picture.shape == (240, 360, 3)
    text = styles.styled_svg(drawing(), cameras, styles.Ink(), **how)
    assert ink_apart(picture, styles.svg_pixels(text, dpi=6 * 25.4)[..., :3]) == 0


def test_colours_lie_over_each_other_and_multiply():
    below = Area([square(0, 0, 2, 2)], (0.2, 0.4, 0.6), 0.5)
    over = Area([square(1, 0, 2, 1)], (0.5, 0.5, 1.0), 0.5, multiplied=True)
    picture = painted_pixels([below, over], (2, 2), WHITE)
    first = 0.5 + 0.5 * np.array([0.2, 0.4, 0.6])
    assert picture[1, 1].numpy() == pytest.approx(first)
    assert picture[0, 1].numpy() == pytest.approx(first * (0.5 + 0.5 * np.array([0.5, 0.5, 1.0])))
    # Without a ground: W3C's compositing, straight colours.
    clear = painted_pixels([below, over], (2, 2), None)
    assert clear[1, 1].numpy() == pytest.approx([0.2, 0.4, 0.6, 0.5])
    backdrop, source = np.array([0.2, 0.4, 0.6]), np.array([0.5, 0.5, 1.0])
    mixed = 0.25 * source + 0.25 * source * backdrop + 0.25 * backdrop
    assert clear[0, 1].numpy() == pytest.approx([*(mixed / 0.75), 0.75])


def test_what_is_taken_out_or_lies_beyond_the_cut_is_left_out():
    ring = Area([square(0, 0, 4, 4)], (0, 0, 0), 1.0, taken=[square(1, 1, 2.5, 3)])
    (dark,) = {float((1 - painted_pixels([ring], (4, 4), WHITE)[..., 0]).sum())}
    assert dark == pytest.approx(16 - 3)
    half = painted_pixels([ring._replace(taken=(), cut=(0, 0, 2, 4))], (4, 4), WHITE)
    assert (half[:, :2] == 0).all()
    assert (half[:, 2:] == 1).all()


def test_areas_that_overlap_themselves_are_filled_once():
    twice = Area([square(0, 0, 3, 2), square(1, 0, 4, 2)], (0, 0, 0), 0.5)
    assert (painted_pixels([twice], (2, 4), WHITE) == 0.5).all()


def test_a_corner_between_long_lines_is_as_wide_as_they_are():
    """Technical pens have samples at corners alone: what lay between the lines was filled, or the lines thinned."""
    points = [[0.0, -0.8, -0.2], [0.0, 0.0, 0.1], [0.0, 0.8, 0.2]]
    sketch = ds.Sketch(
        torch.tensor([points[:2], points[1:]], dtype=torch.float64), width=0.02, chains=ds.Chains.of([2], False)
    )
    picture = styled_pixels(sketch, CAMERA, styles.Technical(), **asked())
    a, b = (128 * math.dist(*pair) for pair in (points[:2], points[1:]))
    width = 1.4 * 96 / 25.4
    turn = math.pi - math.acos(
        np.dot(np.subtract(points[0], points[1]), np.subtract(points[2], points[1])) * 128**2 / (a * b)
    )
    # Two bands, of which the inner sides meet, with round ends and a round joint.
    half = width / 2
    expected = (a + b) * width + math.pi * half**2 + half**2 * (turn / 2 - math.tan(turn / 2))
    assert float((1 - picture[..., 0]).sum()) == pytest.approx(expected, rel=0.01)
