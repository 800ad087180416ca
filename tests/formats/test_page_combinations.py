"""Every page with every fit in every format, as other programs measure it: size, box and margins."""

import itertools
import math
import re

import numpy as np
import pytest
import torch
from needs import needs
from paper import pdf_pages, png_page, svg_page

import diff3ds as ds
from diff3ds.cli import main
from diff3ds.page.sheet.page_setup import PageSetup
from diff3ds.styles.pens import ISO_WIDTHS

pytestmark = [
    pytest.mark.slow,
    needs("svgelements", "svgpathtools", "pypdfium2", "ezdxf", "pathops"),
]
# Half the sides of a rectangle in the plane x = 0, and the height of what the picture shows, world units.
ACROSS, UP, SHOWN = 1.0, 0.4, 4.0
WIDE, PEN = 0.02, 0.5
PAGES = [
    ("A4",),
    ("A3", "--landscape", "--margin", "0"),
    ("letter", "--margin", "0.5in"),
    ("210x148", "--margin", "7mm"),
]
SETUPS = [
    PageSetup.of("A4"),
    PageSetup.of("A3", landscape=True, margin=0),
    PageSetup.of("letter", margin=12.7),
    PageSetup.of("210x148", margin=7),
]
STYLED = ("--style", "technical")
# A white ground is a shape too.
BARE = ("--background", "transparent")
# Of each format its suffix and options, and how exactly a file of it can say a place, mm: an HPGL file in fortieths, a
# picture in pixels, of which the file says how many are an inch.
FORMATS = {
    "svg": (".svg", (), 0.01),
    "pdf": (".pdf", BARE, 0.01),
    "svg in a style": (".svg", STYLED, 0.01),
    "pdf in a style": (".pdf", (*STYLED, *BARE), 0.01),
    "svg for pens": (".svg", ("--centerline", "--pen-mm", PEN), 0.01),
    "dxf": (".dxf", (), 0.01),
    "hpgl": (".plt", ("--pen-mm", PEN), 0.025),
    "png": (".png", (), 0.11),
}


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    a, b, c, d = ([0.0, y, z] for y, z in ((-ACROSS, -UP), (ACROSS, -UP), (ACROSS, UP), (-ACROSS, UP)))
    file = tmp_path_factory.mktemp("rectangle") / "a.json"
    ds.save(file, ds.Sketch(torch.tensor([[a, b], [b, c], [c, d], [d, a]], dtype=torch.float64), width=WIDE))
    return file


def measured(file, page):
    """Size of the page, and of what is drawn on it half the sides and the middle, mm; a DXF file has no page."""
    if file.suffix == ".svg":
        size, box = svg_page(file)
    elif file.suffix == ".pdf":
        ((size, box),) = pdf_pages(file)
    elif file.suffix == ".png":
        size, box = png_page(file)
    else:
        size, box = (page.width, page.height), _box_of_plot(file) if file.suffix == ".plt" else _box_of_dxf(file)
    return size, (box[2:] - box[:2]) / 2, (box[2:] + box[:2]) / 2


def _box_of_dxf(file):
    import ezdxf
    import ezdxf.bbox

    box = ezdxf.bbox.extents(ezdxf.readfile(file).modelspace(), fast=False)
    return np.array([box.extmin.x, box.extmin.y, box.extmax.x, box.extmax.y])


def _box_of_plot(file):
    words = re.findall(r"P[UD]([-\d.,]+);", file.read_text())
    places = np.concatenate([np.array(numbers.split(","), float).reshape(-1, 2) for numbers in words]) / 40
    # Half a pen on all sides.
    return np.concatenate([places.min(0) - PEN / 2, places.max(0) + PEN / 2])


def wanted(page, fit, name):
    """Half the sides of what is drawn, of an ink of its own width around the rectangle."""
    room = page.width - 2 * page.margin, page.height - 2 * page.margin
    side = min(room)
    if fit == "none":
        ink = WIDE * side / 2
        if "style" in name:
            ink = min(ISO_WIDTHS, key=lambda width: abs(math.log(width / (2 * ink)))) / 2
        ink = PEN / 2 if "pens" in name or name == "hpgl" else 0 if name == "dxf" else ink
        return ACROSS * side / SHOWN + ink, UP * side / SHOWN + ink
    # The rectangle is wider than all of the pages: as wide as the margins allow.
    return room[0] / 2, None


@pytest.mark.parametrize("name", FORMATS)
def test_every_page_with_every_fit(source, tmp_path, name):
    suffix, options, near = FORMATS[name]
    for (setup, page), fit in itertools.product(zip(SETUPS, PAGES, strict=True), ("page", "width", "none")):
        file = tmp_path / f"a{suffix}"
        how = [
            "--azimuth",
            0,
            "--elevation",
            0,
            "--height",
            SHOWN,
            "--size",
            300,
            "--page",
            *page,
            "--fit",
            fit,
            *options,
        ]
        main(["render", str(source), "-o", str(file), "--quiet", *map(str, how)])
        size, half, middle = measured(file, setup)
        where = f"{name} {page} {fit}"
        assert size == pytest.approx((setup.width, setup.height), abs=near), where
        assert middle == pytest.approx((setup.width / 2, setup.height / 2), abs=near), where
        across, up = wanted(setup, fit, name)
        assert half[0] == pytest.approx(across, abs=near), where
        assert half[1] == pytest.approx(up, abs=near) if up else half[1] < setup.height / 2 - setup.margin, where
