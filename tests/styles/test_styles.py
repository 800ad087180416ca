"""Styles: widths, dashes and nibs in closed form, and what holds for all of them."""

import math
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest
import torch
from needs import needs
from style_pages import CAMERA, circle, lines, stroke

import diff3ds as ds
from diff3ds import styles
from diff3ds.page.noise import grain, uniform, wander
from diff3ds.page.sheet.ink_boxes import union
from diff3ds.page.sheet.page_setup import PageSetup
from diff3ds.page.union import pathops, united
from diff3ds.styles.brush_file import load_brush
from diff3ds.styles.painted import LARGEST, THIN, SeenStrokes, Strokes
from diff3ds.styles.pens import ISO_WIDTHS, tapered

pytestmark = needs("pathops")

SVG = "{http://www.w3.org/2000/svg}"
LEAF = '<svg xmlns="http://www.w3.org/2000/svg"><path d="M0,0C22,-24 62,-22 100,0C62,22 22,24 0,0Z"/></svg>'
PAGE = styles.Page((256, 256), 4.0, 0)
ALL = ("ink", "pencil", "charcoal", "marker", "nib", "watercolour", "dashed", "technical", "stretched", "scattered")
# Of these all holds that holds of the others, and what is their own has tests above: grain, dashes, widths. A pencil is
# charcoal with other numbers.
SLOW = ("pencil", "charcoal", "marker", "dashed", "stretched")
QUICK_AND_SLOW = [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in ALL]


@pytest.fixture(scope="module")
def every(tmp_path_factory):
    file = tmp_path_factory.mktemp("brush") / "leaf.svg"
    file.write_text(LEAF)
    pens = styles.Ink(), styles.PENCIL, styles.CHARCOAL, styles.Marker(), styles.Nib(), styles.Watercolour()
    return dict(
        zip(
            ALL,
            (*pens, styles.Dashed(), styles.Technical(), styles.stretched(file), styles.scattered(file)),
            strict=True,
        )
    )


def area(marks):
    return sum(mark.path.area for mark in marks)


def one_line(sketch):
    (line,) = lines(sketch)
    return line


LINE = stroke((-0.75, 0.0), (0.75, 0.0), width=8 / 256)  # 192 px long, 8 px wide


# Pens


def test_ink_without_pressure_is_a_strip_with_two_thin_ends():
    style = styles.Ink(width=1.0, pressure=0.0, taper=(5.0, 10.0), tip=0.0)
    # 40 px grow from 0 to 8, 80 px shrink again; cubics round the kinks off within their tolerance.
    assert area(style.marks(one_line(LINE), PAGE, 0)) == pytest.approx(8 * (192 - 60), rel=4e-3)


def test_pressure_takes_width_away_and_seeds_differ():
    full, some = (styles.Ink(pressure=p, taper=(0.0, 0.0)) for p in (0.0, 0.5))
    areas = [area(some.marks(one_line(LINE), PAGE, seed)) for seed in range(4)]
    whole = area(full.marks(one_line(LINE), PAGE, 0))
    assert all(0.5 * whole < a < whole for a in areas)
    assert len(set(areas)) == 4


def test_short_strokes_keep_some_of_their_width():
    line = one_line(LINE)
    assert tapered(line, 10.0, 20.0, 0.2).tolist() == pytest.approx([0.2, 0.2])
    # Half of the thin ends is left of them, so is half of the change.
    short = tapered(line, 128.0, 256.0, 0.2)
    assert short.tolist() == pytest.approx([0.6, 0.6])
    assert tapered(one_line(stroke((0.0, 0.0), (0.0, 0.0))), 10.0, 20.0, 0.2).tolist() == [1.0]
    ring = one_line(circle(0.5))
    assert (tapered(ring, 10.0, 20.0, 0.2) == 1).all()
    assert tapered(replace(line, begins=False), 10.0, 20.0, 0.2).tolist() == pytest.approx([1.0, 0.2])


@pytest.mark.parametrize("degrees", [0, 25, 40, 90, 130, 175])
def test_a_nib_is_as_wide_as_its_ellipse_across_the_line(degrees):
    style = styles.Nib(width=3.0, thickness=0.2, angle=40.0)
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    line = one_line(stroke((-0.5 * c, -0.5 * s), (0.5 * c, 0.5 * s), width=8 / 256))
    # z points up as angles of nibs do. Half the width of an ellipse across a direction, by its support function.
    off = math.radians(degrees - 40)
    half = math.hypot(12 * math.sin(off), 2.4 * math.cos(off))
    # Both ends together are one whole ellipse.
    assert area(style.marks(line, PAGE, 0)) == pytest.approx(128 * 2 * half + math.pi * 12 * 2.4, rel=1e-3)


def test_technical_lines_have_widths_of_the_standard():
    ratios = np.array(ISO_WIDTHS[1:]) / ISO_WIDTHS[:-1]
    assert np.abs(ratios - math.sqrt(2)).max() < 0.06
    for wanted, standard in ((0.01, 0.13), (0.19, 0.18), (0.45, 0.5), (0.8, 0.7), (1.9, 2.0), (9.0, 2.0)):
        line = one_line(stroke((-0.75, 0.0), (0.75, 0.0), width=wanted * PAGE.pixels_per_mm / 256))
        drawn = standard * PAGE.pixels_per_mm
        expected = 192 * drawn + math.pi * drawn**2 / 4
        assert area(styles.Technical().marks(line, PAGE, 0)) == pytest.approx(expected, rel=1e-3)


def test_dashes_follow_iso_128_21():
    line = one_line(stroke((-0.9, 0.0), (0.9, 0.0), width=2 / 256))
    dashes = styles.Dashed().dashes(line, 2.0)
    length = 1.8 * 128
    # Gaps of 3 d; as many as dashes of about 12 d leave room for; the line begins and ends with a dash.
    gaps = round((length - 24) / 30)
    dash = (length - 6 * gaps) / (gaps + 1)
    assert len(dashes) == gaps + 1
    assert [part.length for part in dashes] == pytest.approx([dash] * len(dashes))
    starts = [part.points[0, 0] for part in dashes]
    assert np.diff(starts) == pytest.approx(dash + 6)
    assert starts[0] == pytest.approx(128 - length / 2)
    assert dashes[-1].points[-1, 0] == pytest.approx(128 + length / 2)
    assert area(styles.Dashed().marks(line, PAGE, 0)) == pytest.approx(2 * dash * len(dashes), rel=1e-4)


def test_dashes_run_round_closed_strokes_evenly_and_along_bends():
    ring = one_line(circle(0.5, width=2 / 256))
    dashes = styles.Dashed().dashes(ring, 2.0)
    count = round(2 * math.pi * 64 / 30)
    assert [part.length for part in dashes] == pytest.approx([2 * math.pi * 64 / count - 6] * count, rel=1e-3)
    assert len(styles.Dashed().dashes(one_line(stroke((0.0, 0.0), (0.2, 0.0))), 2.0)) == 1


# Wet and dry


def test_the_edge_of_watercolour_lies_within_the_wash():
    wash, middle, edge = styles.Watercolour().marks(one_line(LINE), PAGE, 3)
    both = pathops().Path()
    both.addPath(wash.path)
    both.addPath(edge.path)
    assert united(both).area == pytest.approx(wash.path.area, rel=1e-4)
    assert 0.1 * wash.path.area < edge.path.area < 0.5 * wash.path.area
    assert all(mark.multiplied for mark in (wash, middle, edge))


def test_grain_inks_about_its_share_of_the_paper_and_more_in_the_middle():
    sparse, full = (replace(styles.CHARCOAL, middle=m, edge=m, layers=((0.0, 1.0),)) for m in (0.5, 1.4))
    wide = stroke((-0.9, 0.0), (0.9, 0.0), width=24 / 256)
    inked = [area(style.marks(one_line(wide), PAGE, 0)) for style in (sparse, full)]
    assert 0.2 < inked[0] / inked[1] < 0.6
    light, dark = styles.CHARCOAL.marks(one_line(wide), PAGE, 0)
    assert dark.path.area < light.path.area


def test_grain_belongs_to_the_page():
    line = one_line(LINE)
    a, b = (styles.CHARCOAL.marks(line, replace(PAGE, seed=seed), 5)[0].path for seed in (0, 1))
    assert list(a.segments) != list(b.segments)


def test_noise_is_even_smooth_and_the_same_everywhere():
    values = uniform(3, 10_000)
    assert abs(values.mean() - 0.5) < 0.01
    x = np.linspace(0, 20, 4001)
    w = wander(5, x, period=20.0)
    assert w[0] == pytest.approx(w[-1])
    assert np.abs(np.diff(w)).max() < 2 * 2 * 1.875 * 20 / 4000 + 1e-9
    heights = grain(7, np.random.default_rng(0).uniform(-50, 50, (20_000, 2)))
    assert abs(heights.mean() - 0.5) < 0.02


# All


@pytest.mark.parametrize("name", QUICK_AND_SLOW)
def test_no_outline_crosses_itself(every, name):
    g = torch.Generator().manual_seed(4)
    sketch = ds.Sketch.random(8, generator=g, extent=1.0, width=0.02)
    for line in lines(sketch, ds.orbit(30.0, 20.0, 2.5, size=256)):
        for mark in every[name].marks(line, PAGE, 1):
            assert united(mark.path).area == pytest.approx(mark.path.area, rel=1e-3, abs=0.05)


@needs("resvg_py")
@pytest.mark.parametrize("name", QUICK_AND_SLOW)
def test_either_fill_rule_shows_the_same(every, name):
    camera = ds.orbit(30.0, 20.0, 2.5, size=200)
    sketch = ds.Sketch.random(10, generator=torch.Generator().manual_seed(5), extent=1.0, width=0.02)
    text = styles.styled_svg(sketch, camera, every[name])
    other = text.replace("<path ", '<path fill-rule="evenodd" ')
    assert (styles.svg_pixels(text) - styles.svg_pixels(other)).abs().max() < 2.5 / 255
    # Black and gray ink on white.
    assert 0.5 < styles.svg_pixels(text)[..., :3].mean() < 0.999


@pytest.mark.parametrize("name", QUICK_AND_SLOW)
def test_the_box_of_a_view_is_that_of_all_its_ink(every, name):
    """Though few lines are drawn for it: rays of many lengths, whose widths differ, with cut ones among them."""
    ways = torch.linspace(0, 2 * torch.pi, 24, dtype=torch.float64)[:-1]
    reach = 0.5 + 0.45 * (7 * ways).sin()
    ends = torch.stack([0 * ways, reach * ways.cos(), reach * ways.sin()], -1)
    rays = ds.Sketch(
        torch.stack([0.2 * ends, ends], 1),
        width=0.01 + 0.03 * torch.rand(23, generator=torch.Generator().manual_seed(8)).double(),
    )
    for moved in (rays, rays.transform(torch.tensor([[1.0, 0, 0, 0], [0, 1, 0, 0.7], [0, 0, 1, 0], [0, 0, 0, 1]]))):
        view = Strokes(moved, [[stroke] for stroke in range(23)], [()] * 23)
        seen = SeenStrokes(view, ds.project(moved, CAMERA), every[name], PAGE, 0.0)
        assert seen.box() == union(each.box for some in seen.painted((1, 1, 1)).values() for each in some)


@pytest.mark.parametrize("name", QUICK_AND_SLOW)
def test_the_same_seed_gives_the_same_bytes(every, name):
    sketch = ds.Sketch.random(3, generator=torch.Generator().manual_seed(6), extent=1.0)
    camera = ds.orbit(30.0, 20.0, 2.5, size=128)
    first, again, other = (
        styles.styled_svg(sketch, camera, every[name], seed=seed, paper=True, depth_cue=0.5) for seed in (-1, -1, 2)
    )
    assert first == again
    assert first != other


EDGE_CASES = {
    "nothing": ds.Sketch(torch.zeros(0, 4, 3)),
    "dots": ds.Sketch(torch.zeros(2, 4, 3), width=0.05),
    "specks": ds.Sketch(torch.rand(3, 4, 3, generator=torch.Generator().manual_seed(0)) * 1e-3, width=0.01),
    "no width": stroke((-0.5, 0.0), (0.5, 0.0), width=0.0),
    "very wide": ds.Sketch(torch.rand(2, 4, 3, generator=torch.Generator().manual_seed(1)) - 0.5, width=1.5),
    "hardly wide": stroke((-0.5, 0.0), (0.5, 0.3), width=1e-4),
    "back and forth": stroke((-0.5, 0.0), (0.9, 0.0), (0.9, 0.0), (-0.5, 0.0), width=0.05),
    "cusp": stroke((-0.3, -0.3), (0.5, 0.5), (-0.5, 0.5), (0.3, -0.3), width=0.08),
    "ring": circle(0.5, width=0.03),
    "ring across the border": circle(1.2, (0.0, 1.2, 0.0), width=0.03),
    "behind the camera": ds.Sketch(torch.tensor([[[9.0, 0.0, 0.0], [10.0, 1.0, 0.0]]])),
    "through the camera": ds.Sketch(
        torch.tensor([[[9.0, 0.2, 0.2], [0.0, 0.1, 0.1]]]), width=0.02, width_space="world"
    ),
}


@pytest.mark.parametrize("name", QUICK_AND_SLOW)
def test_what_is_drawn_of_extreme_strokes(every, name):
    drawn = {}
    for case, sketch in EDGE_CASES.items():
        camera = ds.orbit(0.0, 0.0, 3.0, size=256) if "camera" in case else CAMERA
        text = styles.styled_svg(sketch, camera, every[name], depth_cue=0.3)
        numbers = [float(v) for v in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", text)]
        assert all(map(math.isfinite, numbers))
        drawn[case] = len(list(ElementTree.fromstring(text).iter(SVG + "path"))) > 0
    # Dots of a tenth of a pixel may be left out.
    del drawn["hardly wide"], drawn["specks"]
    assert [case for case in drawn if not drawn[case]] == ["nothing", "no width", "behind the camera"]


def test_too_wide_strokes_are_refused_by_number():
    sketch = ds.Sketch.concatenate([LINE, replace(LINE, width=torch.tensor([9.0], dtype=torch.float64))])
    with pytest.raises(ValueError, match=rf"stroke 1 is .* pixels wide in this view, more than {2 * LARGEST} pages"):
        styles.styled_svg(sketch, CAMERA, styles.Ink())


# Pages


def paths(text):
    return [e for e in ElementTree.fromstring(text).iter() if e.get("id")]


def test_far_strokes_lie_below_and_are_lighter_and_thinner(tmp_path):
    points = torch.tensor([[[0.5, -0.5, 0.0], [0.5, 0.5, 0.0]], [[-0.5, 0.0, -0.5], [-0.5, 0.0, 0.5]]])
    sketch = ds.Sketch(points, width=0.02)
    plain, cued = (styles.styled_svg(sketch, CAMERA, styles.Technical(), depth_cue=c) for c in (0.0, 1.0))
    for text in (plain, cued):
        assert [e.get("id") for e in paths(text)] == ["stroke-1", "stroke-0"]
    assert [e.get("fill") for e in paths(plain)] == ["#000000", "#000000"]
    # FADE of the way to white.
    assert [e.get("fill") for e in paths(cued)] == ["#cccccc", "#000000"]
    # Read back by the reader of brushes: the far one lost THIN of its width.
    style = styles.Ink(width=1.0, pressure=0.0, taper=(0.0, 0.0))
    areas = []
    for cue in (0.0, 1.0):
        file = tmp_path / "far.svg"
        text = styles.styled_svg(sketch, CAMERA, style, depth_cue=cue, background=None)
        file.write_text(re.sub(r'<path id="stroke-0".*?/>', "", text))
        areas.append(load_brush(file).area)
    radius = 2.56
    expected = [128 * 2 * r + math.pi * r**2 for r in (radius, radius * (1 - THIN))]
    assert areas == pytest.approx(expected, rel=5e-3)


def test_several_views_are_groups_and_the_page_has_its_size_on_paper():
    page = PageSetup(100, 50, 0, "none")
    for given, box, size, x in (
        (None, "0 0 128 64", ("128", "64"), 64),
        (page, "0 0 1000 500", ("100mm", "50mm"), 500),
    ):
        text = styles.styled_svg(LINE, ds.orbit([0.0, 30.0], 0.0, 3.0, size=64), styles.Ink(), page=given)
        root = ElementTree.fromstring(text)
        assert (root.get("viewBox"), root.get("width"), root.get("height")) == (box, *size)
        assert [e.get("id") for e in paths(text)] == ["view-0", "view-0-stroke-0", "view-1", "view-1-stroke-0"]
        assert paths(text)[2].get("transform") == f"translate({x},0)"


def test_the_ink_is_cut_at_the_border():
    long = stroke((-3.0, 0.0), (3.0, 0.0), width=0.05)
    (path,) = paths(styles.styled_svg(long, CAMERA, styles.Technical()))
    x = [float(v) for v in re.findall(r"m(-?[\d.]+)", path.get("d"))]
    assert 0 <= x[0] <= 256


def test_a_joined_stroke_has_the_numbers_of_its_parts():
    points = torch.tensor(
        [[[0.0, 0.0, 0.5], [0.0, 0.5, 0.5]], [[0.0, 0.0, 0.0], [0.0, -0.5, 0.0]], [[0.0, 0.0, 0.0], [0.0, 0.5, 0.0]]]
    )
    text = styles.styled_svg(ds.Sketch(points), CAMERA, styles.Ink())
    assert {e.get("id") for e in paths(text)} == {"stroke-0", "strokes-2-1"}


def test_paper_is_warm_and_transparent_pages_have_none():
    assert 'fill="#fbf6eb"' in styles.styled_svg(LINE, CAMERA, styles.Ink(), paper=True)
    assert "<rect" not in styles.styled_svg(LINE, CAMERA, styles.Ink(), background=None)
    assert 'fill="#0080ff"' in styles.styled_svg(LINE, CAMERA, styles.Ink(), background=(0.0, 0.5, 1.0), paper=True)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"depth_cue": 1.5}, "depth_cue must be from 0 to 1, got 1.5"),
        ({"depth_cue": math.nan}, "depth_cue must be from 0 to 1, got nan"),
        ({"width": 0.0}, "width must be positive, got 0"),
        ({"background": (1.0, 1.0)}, "background must be three numbers"),
    ],
)
def test_values_out_of_range(options, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        styles.styled_svg(LINE, CAMERA, styles.Ink(), **options)
