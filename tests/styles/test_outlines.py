"""Outlines of ink: their areas in closed form, the discs of the renderer, and no crossing of themselves."""

import io
import math

import numpy as np
import pytest
import torch
from needs import needs
from PIL import Image
from style_pages import CAMERA, circle, lines, stroke

import diff3ds as ds
from diff3ds.curves.fit_cubics import fit_outline, is_straight
from diff3ds.page.ink_outlines import TOLERANCE, add_contour, add_contours, disc
from diff3ds.page.ink_outlines import strip as contours_of_strip
from diff3ds.page.union import pathops, svg_data, united, within, without

pytestmark = needs("pathops")


def strip(line, half_width, **others):
    path = pathops().Path()
    add_contours(path, contours_of_strip(line, half_width, **others))
    return united(path)


def ink(data, rule="nonzero", size=256):
    """How much of each pixel a path covers, as resvg draws it."""
    import resvg_py

    box = f'viewBox="0 0 {size} {size}" width="{size}" height="{size}"'
    text = f'<svg xmlns="http://www.w3.org/2000/svg" {box}><path fill-rule="{rule}" d="{data}"/></svg>'
    return np.asarray(Image.open(io.BytesIO(bytes(resvg_py.svg_to_bytes(svg_string=text)))))[..., 3] / 255


def test_a_straight_strip_with_even_ends():
    (line,) = lines(stroke((-0.5, 0.0), (0.5, 0.0)))
    half = np.full(len(line.points), 10.0)
    assert strip(line, half, cap="flat").area == pytest.approx(128 * 20, rel=1e-6)
    # Quarters of circles are cubics, off by 2.7e-4 of the radius.
    assert strip(line, half).area == pytest.approx(128 * 20 + math.pi * 100, rel=1e-4)


def test_a_taper_is_a_triangle_and_both_sides_may_differ():
    (line,) = lines(stroke((-0.5, 0.2), (0.5, -0.3)))
    length = 128 * math.hypot(1, 0.5)
    assert strip(line, np.array([0.0, 8.0]), cap="flat").area == pytest.approx(length * 8, rel=1e-6)
    path = strip(line, np.array([3.0, 3.0]), left=np.array([9.0, 9.0]), cap="flat")
    assert path.area == pytest.approx(length * 12, rel=1e-6)


def test_a_ring_has_no_seam():
    (line,) = lines(circle(0.5))
    ring = strip(line.refined(8.0), np.full(len(line.refined(8.0).points), 6.0))
    assert ring.area == pytest.approx(math.pi * (70**2 - 58**2), rel=2e-3)
    assert len(list(ring.contours)) == 2


def test_a_ring_that_is_wider_than_its_radius_has_no_hole():
    # The sides that lie beyond the centre wind the other way round, and would take away from what the others cover.
    (line,) = lines(circle(0.1))
    disc = strip(line, np.full(len(line.points), 20.0))
    assert disc.area == pytest.approx(math.pi * 32.8**2, rel=2e-3)
    assert len(list(disc.contours)) == 1


def test_dots_are_discs():
    (line,) = lines(stroke((0.0, 0.0), (0.0, 0.0), width=0.1))
    assert strip(line, line.half_width).area == pytest.approx(math.pi * 12.8**2, rel=1e-3)


def bends():
    """Random bends, near and exact cusps, hairpins, loops and lines back and forth, from thin to very wide."""
    g = torch.Generator().manual_seed(1)
    points = torch.rand(40, 4, 3, generator=g, dtype=torch.float64) * 1.6 - 0.8
    points[:, :, 0] = 0
    cusp = torch.tensor([[0, -0.3, -0.3], [0, 0.5, 0.5], [0, -0.5, 0.5], [0, 0.3, -0.3]])
    points[:10] = cusp
    points[4:10] += 0.03 * torch.rand(6, 4, 3, generator=g) * torch.tensor([0.0, 1.0, 1.0])
    points[10:14, 3] = points[10:14, 0]
    points[14:18, 2] = points[14:18, 0] + 0.02
    weights = 10 ** (torch.rand(40, 4, generator=g, dtype=torch.float64) - 0.5)
    return ds.Sketch(points, weights, width=10 ** (torch.rand(40, generator=g, dtype=torch.float64) * 1.4 - 1.9))


@pytest.mark.slow
@needs("resvg_py")
def test_bends_cusps_and_loops_are_covered_as_by_discs():
    sketch = bends()
    for line in lines(sketch):
        path = strip(line, line.half_width)
        shown = ink(svg_data(path))
        drawn = ds.render(sketch[line.stroke], CAMERA).alpha[0].numpy()
        # The renderer counts the nearer leg where two share a pixel, and rasterisers differ along edges.
        assert np.abs(shown - drawn).mean() < 0.5 / 255
        assert abs(shown.sum() - drawn.sum()) < 0.02 * drawn.sum()
        assert np.abs(shown - drawn).max() < 0.65
        # Filled by either rule it is the same: it neither crosses nor overlaps itself.
        assert np.abs(shown - ink(svg_data(path), "evenodd")).max() < 2.5 / 255
        assert united(path).area == pytest.approx(path.area, rel=1e-4, abs=0.05)
        assert len(path.points) < 140


def test_few_cubics_within_the_tolerance():
    t = np.linspace(0, 2 * math.pi, 200)
    wave = np.stack([50 * t, 30 * np.sin(t)], -1)
    cubics = fit_outline(wave, TOLERANCE)
    assert len(cubics) <= 6
    u = np.linspace(0, 1, 400)[:, None]
    dense = np.concatenate(
        [((1 - u) ** 3) * c[0] + 3 * u * (1 - u) ** 2 * c[1] + 3 * u**2 * (1 - u) * c[2] + u**3 * c[3] for c in cubics]
    )
    assert np.abs(dense[:, 1] - 30 * np.sin(dense[:, 0] / 50)).max() < 1.5 * TOLERANCE


def test_corners_and_straight_lines_stay():
    square = np.array([[0.0, 0], [5, 0], [10, 0], [10, 10], [0, 10]])
    cubics = fit_outline(square, TOLERANCE, closed=True)
    assert [is_straight(c) for c in cubics] == [True] * 4
    assert {tuple(p) for p in cubics[:, 0].tolist()} == {(0, 0), (10, 0), (10, 10), (0, 10)}


def square(x, y, side):
    path = pathops().Path()
    corners = np.array([[x, y], [x + side, y], [x + side, y + side], [x, y + side]], dtype=float)
    add_contour(path, fit_outline(corners, TOLERANCE, closed=True))
    return path


def test_operations_on_squares():
    both = pathops().Path()
    both.addPath(square(0, 0, 10))
    both.addPath(square(5, 5, 10))
    assert united(both).area == pytest.approx(175)
    assert within(square(0, 0, 10), square(5, 5, 10)).area == pytest.approx(25)
    ring = without(square(0, 0, 10), square(2, 2, 6))
    assert ring.area == pytest.approx(64)
    assert svg_data(square(1, 2, 3)) == "m1,2l3,0l0,3l-3,0z"


def test_without_the_library_the_extra_is_named(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"diff3ds\[styles\]"):
        ds.styles.styled_svg(stroke((0.0, 0.0), (0.5, 0.0)), CAMERA, ds.styles.Ink())


def test_outlines_that_the_library_cannot_join_at_once_are_joined_by_halves(monkeypatch):
    path, library = pathops().Path(), pathops()
    add_contours(path, [contour for k in range(9) for contour in disc(np.array([10.0 * k, 3.0]), 7.0)])
    whole, simplify = united(path), library.simplify

    def few(path, **how):
        if len(list(path.contours)) > 3:
            raise library.PathOpsError
        return simplify(path, **how)

    monkeypatch.setattr(library, "simplify", few)
    assert united(path).area == pytest.approx(whole.area, rel=1e-5)
    assert united(path).bounds == pytest.approx(whole.bounds)
    # A hole is none by itself.
    ring = pathops().Path()
    add_contours(ring, disc(np.zeros(2), 9.0))
    hole = pathops().Path()
    add_contours(hole, disc(np.zeros(2), 5.0))
    hole.reverse()
    ring.addPath(hole)
    rest = path
    monkeypatch.setattr(library, "simplify", lambda some, **how: few(rest, **how))
    with pytest.raises(ValueError, match="could not be joined"):
        united(ring)
