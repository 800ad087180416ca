"""Pages of SVG, PDF and PNG files: their size, and where the drawing lies on them, as other programs measure it."""

import dataclasses
import math

import numpy as np
import pytest
import torch
from needs import needs
from paper import pdf_pages, png_page, svg_page

import diff3ds as ds
from diff3ds.formats import save_pdf, save_svg
from diff3ds.page.sheet.page_layout import filled, lay_out
from diff3ds.page.sheet.page_setup import SIZES, PageSetup

pytestmark = needs("svgelements", "svgpathtools", "pypdfium2")
CAMERAS = ds.orbit([20.0, 110.0], 25.0, size=(96, 128))


def rings(space="image"):
    """Slanted circles, as rational curves, and a line, whose widths count."""
    ring, weights = ds.bezier.circle((0.1, 0.0, 0.2), 0.4, (0.3, 0.2, 1.0))
    ring = ds.Sketch(ring, weights, chains=ds.Chains.of([len(ring)], True))
    line = ds.Sketch(torch.tensor([[[0.0, 0.0, 0.0], [0.2, 0.6, 0.5]]], dtype=torch.float64))
    return ds.Sketch.concatenate([ring, line]).replace(width=0.04, width_space=space)


def check(measured, page, near=0.01):
    """The page has its size, and the box of the ink is as large as its margins allow, in the middle."""
    size, box = measured
    assert size == pytest.approx((page.width, page.height), abs=near)
    free = np.array([*box[:2], *(np.array([page.width, page.height]) - box[2:])])
    assert free == pytest.approx(np.roll(free, 2), abs=near)
    least = free.min() if page.fit == "page" else free[0]
    assert least == pytest.approx(page.margin, abs=near)


@pytest.mark.parametrize("fit", ["page", "width"])
@pytest.mark.parametrize(
    "page",
    [
        PageSetup.of("A4"),
        PageSetup.of("A3", landscape=True, margin=0),
        PageSetup.of("letter", margin=12.7),
        PageSetup.of("210x148", margin=7.77),
        PageSetup(33.33, 66.66, 1.11),
    ],
)
@pytest.mark.parametrize("space", ["image", "world"])
def test_the_ink_reaches_the_margins(tmp_path, page, fit, space):
    """Of a slanted ring wider than high, so that at its width it is not higher than the page."""
    page = dataclasses.replace(page, fit=fit)
    save_svg(tmp_path / "a.svg", rings(space), CAMERAS[0], page=page, background=None)
    check(svg_page(tmp_path / "a.svg"), page)
    save_pdf(tmp_path / "a.pdf", rings(space), CAMERAS[0], page=page, background=None)
    check(*pdf_pages(tmp_path / "a.pdf"), page)


def test_a_page_without_a_fit_has_the_picture():
    """A picture four to three on a page three to four is as wide as the margins allow, in the middle."""
    page = PageSetup(120, 160, 10, "none")
    layout = lay_out(CAMERAS[0], page, lambda *how: [])
    assert layout.corners == [(100.0, pytest.approx(800 - 500 * 0.75))]
    assert layout.cameras.size == (750, 1000)
    old, new = CAMERAS[0].intrinsics.double(), layout.cameras.intrinsics
    assert new[0, :2] == pytest.approx(old[0, :2] * 1000 / 128, rel=1e-6)


def test_several_views_have_one_scale_and_pages_or_cells_of_their_own(tmp_path):
    """The union of their boxes touches the margins; on one page views are a margin apart."""
    page = PageSetup.of("A5", margin=5)
    save_pdf(tmp_path / "a.pdf", rings(), CAMERAS, page=page, background=None, alone=True)
    pages = list(pdf_pages(tmp_path / "a.pdf"))
    assert len(pages) == 2
    low, high = np.min([box for _, box in pages], 0), np.max([box for _, box in pages], 0)
    check((pages[0][0], np.array([*low[:2], *high[2:]])), page)
    save_svg(tmp_path / "a.svg", rings(), CAMERAS, page=page, background=None)
    size, box = svg_page(tmp_path / "a.svg")
    assert size == pytest.approx((148, 210), abs=0.01)
    assert box[0] >= 5 - 0.01
    assert box[2] <= 143 + 0.01


def test_pixels_lie_where_the_page_has_them(tmp_path):
    """Ten pixels to a millimetre: a dark pixel's edge is off by half of one."""
    from diff3ds.cli import main

    ds.save(tmp_path / "a.json", rings())
    for options, per_mm in ((["--page", "60x40", "--margin", "0.2in"], 10), (["--page", "A6", "--dpi", "150"], 5.9)):
        main(["render", str(tmp_path / "a.json"), "-o", str(tmp_path / "a.png"), "--quiet", *options])
        margin = 5.08 if "60x40" in options else 10.0
        check(png_page(tmp_path / "a.png"), PageSetup.of(options[1], margin=margin), 1.1 / per_mm)


def test_what_the_picture_cuts_is_on_the_page(tmp_path):
    """The camera stands so near that the picture shows a part: the page has all of it."""
    near = ds.orbit(20.0, 25.0, 2.0, fov=20, size=64)
    page = PageSetup.of("A5")
    save_svg(tmp_path / "a.svg", rings(), near, page=page, background=None)
    check(svg_page(tmp_path / "a.svg"), page)


def test_nothing_and_a_dot_have_a_page(tmp_path):
    dot = ds.Sketch(torch.zeros(1, 2, 3), width=0.0)
    for sketch in (rings()[:0], dot):
        save_svg(tmp_path / "a.svg", sketch, CAMERAS[0], page=PageSetup.of("A4"))
        assert 'width="210mm" height="297mm"' in (tmp_path / "a.svg").read_text()


def test_a_drawing_higher_than_the_page_is_told(tmp_path):
    with pytest.warns(UserWarning, match="higher than it: what lies beyond is left out"):
        save_svg(tmp_path / "a.svg", rings(), CAMERAS[0], page=PageSetup(200, 40, 5, "width"))


def test_films_are_filled():
    """The union of all frames leaves a twentieth of the shorter side free; without a fit nothing moves."""
    boxes = [(10.0, 20.0, 30.0, 24.0), None, (12.0, 10.0, 40.0, 21.0)]
    asked = []
    filled(CAMERAS, "page", lambda cameras, widen: asked.append((cameras.size, widen)) or boxes)
    ((size, widen),) = asked
    # The picture is looked at with as much on each side, and pixels of another size, to which widths keep.
    assert size == (258, 345)
    assert widen == pytest.approx(1 / 3, rel=0.01)
    same, widen = filled(CAMERAS, "none", lambda cameras, widen: [])
    assert (same, widen) == (CAMERAS, 1.0)


@pytest.mark.parametrize("name", SIZES)
def test_pages_of_a_name(name):
    upright, across = PageSetup.of(name.lower()), PageSetup.of(name, landscape=True)
    assert (upright.width, upright.height) == (across.height, across.width) == SIZES[name]
    if name.startswith("A"):
        # ISO 216: half of an A0 of a square metre so many times, sides one to the root of two, to a millimetre.
        area = 1e6 / 2 ** int(name[1:])
        assert upright.width == pytest.approx(math.sqrt(area / math.sqrt(2)), abs=1.1)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PageSetup.of("A9"), "page must be A0, .* or WIDTHxHEIGHT in millimetres, got 'A9'"),
        (lambda: PageSetup.of("210"), "or WIDTHxHEIGHT in millimetres, got '210'"),
        (lambda: PageSetup.of("0x100"), "the width of a page must be positive and at most 5000 mm, got 0"),
        (lambda: PageSetup.of("100xnan"), "the height of a page must be positive"),
        (lambda: PageSetup.of("A4", margin=105), "margin must be from 0 to less than half"),
        (
            lambda: lay_out(ds.orbit([0.0] * 100, size=8), PageSetup.of("A6"), lambda *how: []),
            "100 views with margins of 10 mm have no room on the page",
        ),
    ],
)
def test_pages_that_there_are_not(make, message):
    with pytest.raises(ValueError, match=message):
        make()
