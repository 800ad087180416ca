"""SVG: its paths against the exact projection, and its picture by another rasteriser against `render`."""

import dataclasses
import importlib.util
import io
import math
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import torch
from PIL import Image

import diff3ds as ds
from diff3ds.formats import save_svg, tile_images
from diff3ds.formats.vector import svg
from diff3ds.page import screen_pieces
from diff3ds.page.drawn_paths import TOLERANCE
from diff3ds.page.sheet.page_setup import PageSetup
from diff3ds.page.stroke_outlines import _hull

needs_resvg = pytest.mark.skipif(importlib.util.find_spec("resvg_py") is None, reason="the extra svg is not installed")
SPACE = "{http://www.w3.org/2000/svg}"
# Coordinates are written to a thousandth of a pixel.
ROUNDING = 0.0005 * math.sqrt(2)
CAMERAS = ds.orbit([20.0, 110.0], [15.0, 40.0], 2.5, size=256)
FLAT = ds.orbit([20.0, 110.0], [15.0, 90.0], 2.5, height=2.6, size=256)
# Pixels three times as wide as high, and the other way round, and slanted ones.
OBLONG = ds.orbit([20.0, 110.0], [15.0, 40.0], 2.5, size=(256, 768)).resize(256)
OBLONG_FLAT = ds.orbit([20.0, 110.0], [15.0, 90.0], 2.5, height=2.6, size=(768, 256)).resize(256)
SLANT = torch.tensor([[0.0, 90, 0], [0, 0, 0], [0, 0, 0]])
SKEWED = ds.Cameras(CAMERAS.world_to_camera, CAMERAS.intrinsics + SLANT, (256, 256))


def rasterized(path):
    import resvg_py

    picture = Image.open(io.BytesIO(bytes(resvg_py.svg_to_bytes(svg_path=str(path)))))
    return torch.from_numpy(np.asarray(picture.convert("RGB")).astype(np.float32) / 255)


def uniform(generator, *shape):
    return torch.rand(*shape, generator=generator, dtype=torch.float64)


def scattered(scale, decades, **others):
    """Random cubics with weights over so many decades."""
    g = torch.Generator().manual_seed(0)
    points = ds.Sketch.random(40, generator=g).points.double() * scale
    return ds.Sketch(points, 10 ** (decades * (uniform(g, 40, 4) - 0.5)), **others)


def colored(**others):
    g = torch.Generator().manual_seed(3)
    return scattered(0.5, 2, color=uniform(g, 40, 3), opacity=uniform(g, 40), **others)


def circle(radius, **others):
    return ds.Sketch(*ds.bezier.circle((0.0, 0.0, 0.0), radius, (0.3, 0.2, 1.0)), **others)


def through_the_camera(**others):
    """Lines from behind the first camera to in front of it."""
    start = CAMERAS.centers[:1].double() * 1.5
    aside = torch.tensor([[0.1, 0.1, 0.1], [0.1, 0.0, 0.1], [0.0, 0.2, 0.1]], dtype=torch.float64)
    return ds.Sketch(torch.stack([start + aside, aside], 1), width=0.02, **others)


SKETCHES = {
    "circle": circle(0.8, width=0.02),
    "circle around the camera": circle(2.4, width=0.02),
    "random": scattered(0.7, 2, width=0.01),
    "weights from .001 to 1000": scattered(0.7, 6, width=0.01),
    "colours and opacities": colored(width=0.02),
    "around the cameras": scattered(3.0, 2, width=0.01),
    "through the near plane": through_the_camera(),
    "tubes": colored(width=0.05, width_space="world"),
    "tube circle": circle(0.8, width=0.06, width_space="world"),
    "tubes around the cameras": scattered(3.0, 2, width=0.03, width_space="world"),
    "tubes through the near plane": through_the_camera(width_space="world"),
    "dots": ds.Sketch(uniform(torch.Generator().manual_seed(5), 5, 1, 3).expand(5, 4, 3) - 0.5, width=0.1),
}


@needs_resvg
@pytest.mark.parametrize(
    ("name", "cameras"),
    [
        *((name, CAMERAS) for name in SKETCHES),
        ("tubes", FLAT),
        ("tubes", OBLONG),
        *(pytest.param(name, FLAT, marks=pytest.mark.slow) for name in ("random", "through the near plane")),
        *(
            pytest.param(name, OBLONG, marks=pytest.mark.slow)
            for name in ("tube circle", "tubes through the near plane")
        ),
        *(pytest.param("tubes", cameras, marks=pytest.mark.slow) for cameras in (SKEWED, OBLONG_FLAT)),
    ],
)
def test_looks_as_rendered(tmp_path, name, cameras):
    sketch = SKETCHES[name]
    ds.save(tmp_path / "a.svg", sketch, cameras)
    picture, rendered = rasterized(tmp_path / "a.svg"), tile_images(ds.render(sketch, cameras).color).float()
    assert picture.shape == rendered.shape == (256, 512, 3)
    difference = (picture - rendered).abs()
    # Rasterisers differ by 2/255 in the mean from one another on such pictures.
    assert difference.mean() < 0.5 / 255
    # Where strokes overlap, their order may change along them, which SVG cannot show. Else the worst are thin ends.
    layers = sum((ds.render(sketch[i], cameras).alpha > 0).float() for i in range(len(sketch)))
    alone = tile_images(layers[..., None])[..., 0] <= 1
    assert difference[alone].max() < 0.3
    inked = rendered.amin(-1) < 0.99
    assert inked.sum() > 100
    assert difference[inked].mean() < 0.04


def curves_of(path):
    """Points of the centre lines in a file by colour, (M, 2), 32 for each piece."""
    t = torch.linspace(0, 1, 32, dtype=torch.float64)
    found = {}
    for element in ElementTree.parse(path).iter(SPACE + "path"):
        pieces = []
        for kind, text in re.findall(r"([MLC])([^MLC]*)", element.get("d")):
            points = torch.tensor([float(v) for v in re.split("[ ,]", text)], dtype=torch.float64).reshape(-1, 2)
            if kind == "M":
                last = points[0]
            else:
                # A line is a cubic too, evenly run through.
                inner = [] if kind == "C" else [(2 * last + points) / 3, (last + 2 * points) / 3]
                pieces.append(ds.bezier.evaluate(torch.cat([last[None], *inner, points]), None, t))
                last = points[-1]
        found.setdefault(element.get("stroke"), []).append(torch.cat(pieces))
    return {color: torch.cat(curves) for color, curves in found.items()}


@pytest.mark.parametrize(
    "name", ["circle", "circle around the camera", "random", "weights from .001 to 1000", "through the near plane"]
)
def test_paths_stay_within_the_tolerance_of_the_exact_curve(tmp_path, name):
    # A colour for each stroke tells the paths apart.
    color = torch.arange(len(SKETCHES[name]), dtype=torch.float64)[:, None].expand(-1, 3) / 255
    sketch = dataclasses.replace(SKETCHES[name], color=color)
    # Strokes are not cut then where others cross them.
    save_svg(tmp_path / "a.svg", sketch, CAMERAS[0], centerline=True)
    written = curves_of(tmp_path / "a.svg")
    cubics = ds.project(sketch, CAMERAS[0]).cubics[0]
    # Even in the logarithm of the odds: a weight of a thousand makes the curve hurry near its ends.
    t = torch.linspace(-14, 14, 500, dtype=torch.float64).sigmoid()
    x, y, z, w = (ds.bezier.curves.bernstein(t, 3) @ cubics).unbind(-1)
    exact = torch.stack([x / z, y / z], -1)
    shown = (z > CAMERAS.near * w) & (exact > 0).all(-1) & (exact < 256).all(-1)
    strokes = shown.any(-1).nonzero()[:, 0].tolist()
    assert strokes
    for stroke in strokes:
        path = written[f"#{stroke:02x}{stroke:02x}{stroke:02x}"]
        # The polyline of 32 chords a piece is nearer to the path than a small part of the tolerance.
        assert distance_to_polyline(exact[stroke, shown[stroke]], path).max() < TOLERANCE + ROUNDING + 0.005


def distance_to_polyline(points, vertices):
    start, chord = vertices[:-1], vertices.diff(dim=0)
    along = ((points[:, None] - start) * chord).sum(-1) / chord.square().sum(-1).clamp_min(1e-30)
    return (points[:, None] - start - along.clamp(0, 1)[..., None] * chord).norm(dim=-1).amin(1)


def test_plotters_get_no_page_to_draw(tmp_path):
    """They would draw its edge."""
    for options, there in (
        ({"centerline": True}, False),
        ({"centerline": True, "background": (1.0, 1.0, 1.0)}, True),
        ({}, True),
        ({"background": None}, False),
    ):
        save_svg(tmp_path / "a.svg", circle(0.5), CAMERAS[0], **options)
        assert ("<rect" in (tmp_path / "a.svg").read_text()) == there


def test_an_exact_circle_stays_round(tmp_path):
    cameras = ds.look_at(torch.tensor([[0.0, 0.0, 2.0]]), up=(0.0, 1.0, 0.0), fov=60, size=512)
    save_svg(tmp_path / "a.svg", ds.Sketch(*ds.bezier.circle((0.0, 0.0, 0.0), 1.0)), cameras)
    points = torch.cat(list(curves_of(tmp_path / "a.svg").values()))
    radius = 256 / math.tan(math.radians(30)) / 2
    error = ((points - 256).norm(dim=-1) - radius).abs().max()
    assert error < TOLERANCE + ROUNDING


@needs_resvg
@pytest.mark.parametrize("width_space", ["image", "world"])
def test_a_transparent_stroke_shows_no_joints(tmp_path, width_space):
    # A loop that crosses itself, seen from above.
    points = torch.tensor([[[-0.5, -0.5, 0], [1.5, 0.8, 0.1], [-1.5, 0.8, 0.2], [0.5, -0.5, 0]]])
    sketch = ds.Sketch(points, width=0.1, opacity=0.5, width_space=width_space)
    cameras = ds.look_at(torch.tensor([[0.0, 0.0, 1.5]]), up=(0.0, 1.0, 0.0), size=200)
    ds.save(tmp_path / "a.svg", sketch, cameras)
    picture = rasterized(tmp_path / "a.svg")
    assert abs(picture.min() - 0.5) < 1.5 / 255
    assert (picture[..., 0] < 0.51).sum() > 1000


@needs_resvg
@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
@pytest.mark.parametrize("width_space", ["image", "world"])
@pytest.mark.parametrize("lens", [{}, {"height": 2.0}])
def test_the_nearer_stroke_is_on_top(tmp_path, order, width_space, lens):
    points = torch.tensor([[[0.5, -0.5, 0.0], [0.5, 0.5, 0.0]], [[-0.5, 0.0, -0.5], [-0.5, 0.0, 0.5]]])
    color = torch.tensor([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    sketch = ds.Sketch(points[order], width=0.1, color=color[order], width_space=width_space)
    ds.save(tmp_path / "a.svg", sketch, ds.orbit(0.0, size=64, **lens))
    assert rasterized(tmp_path / "a.svg")[32, 32].tolist() == [1, 0, 0]


@needs_resvg
def test_the_last_of_equally_far_strokes_is_on_top(tmp_path):
    points = torch.tensor([[[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]]]).expand(2, 2, 3)
    sketch = ds.Sketch(points, width=0.1, color=torch.tensor([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    cameras = ds.orbit(0.0, size=64)
    ds.save(tmp_path / "a.svg", sketch, cameras)
    assert rasterized(tmp_path / "a.svg")[32, 32].tolist() == [0, 0, 1]
    assert ds.render(sketch, cameras).color[0, 32, 32].tolist() == [0, 0, 1]


@needs_resvg
@pytest.mark.parametrize("kind", ["plane", "tubes", "translucent"])
def test_a_drawing_in_one_plane_has_its_own_order(tmp_path, kind):
    """Many strokes across each other: as SVG has it, each lies on those before it."""
    g = torch.Generator().manual_seed(2)
    points = torch.cat([torch.zeros(12, 4, 1), torch.randn(12, 4, 2, generator=g) * 0.5], -1)
    look = {"color": torch.rand(12, 3, generator=g), "opacity": 0.7 if kind == "translucent" else 1.0}
    space = "world" if kind == "tubes" else "image"
    sketch = ds.Sketch(points, width=0.08, width_space=space, **look)
    camera = ds.orbit(0.0, height=3.0, size=128)
    ds.save(tmp_path / "a.svg", sketch, camera)
    assert [int(s) for s in re.findall(r'id="stroke-(\d+)"', (tmp_path / "a.svg").read_text())] == list(range(12))
    rendered = ds.render(sketch, camera).color[0]
    assert (rasterized(tmp_path / "a.svg") - rendered).abs().mean() < 1 / 255


@needs_resvg
@pytest.mark.parametrize(("r0", "r1"), [(3.0, 3.0), (8.0, 2.0), (2.0, 8.0), (1.0, 25.0), (25.0, 1.0), (0.0, 5.0)])
def test_hulls_of_discs_have_the_area_of_the_hull(tmp_path, r0, r1):
    length = 20.0
    data = svg._data(_hull(np.array([30.0, 40.0, r0]), np.array([30 + length * 0.6, 40 + length * 0.8, r1])), True)
    # Twice, over itself: overlaps of shapes that turn the same way round fill once.
    size = 'width="100" height="100"'
    text = f'<svg xmlns="http://www.w3.org/2000/svg" {size}><rect {size} fill="#fff"/><path d="{data}{data}"/></svg>'
    (tmp_path / "a.svg").write_text(text)
    area = (1 - rasterized(tmp_path / "a.svg")[..., 0]).sum().item()
    if abs(r0 - r1) >= length:
        expected = math.pi * max(r0, r1) ** 2
    else:
        slope = math.asin((r0 - r1) / length)
        expected = (r0 + r1) * length * math.cos(slope)
        expected += r0**2 * (math.pi / 2 + slope) + r1**2 * (math.pi / 2 - slope)
    # A pixel's ink is off by a few of 255 along the edge.
    assert abs(area - expected) < 0.02 * expected + 0.5


def test_what_is_not_seen_is_not_written(tmp_path):
    points = torch.tensor([[[0.0, -0.3, 0.0], [0.0, 0.3, 0.0]], [[9.0, 0, 0], [9, 1, 0]], [[0, 9, 0], [0, 9, 1]]])
    save_svg(tmp_path / "a.svg", ds.Sketch(points), ds.orbit(0.0, size=64))
    assert len(list(ElementTree.parse(tmp_path / "a.svg").iter(SPACE + "path"))) == 1
    save_svg(tmp_path / "a.svg", ds.Sketch(points[:0]), ds.orbit(0.0, size=64))
    assert len(list(ElementTree.parse(tmp_path / "a.svg").iter(SPACE + "path"))) == 0


def test_an_orthographic_view_begins_at_the_near_plane(tmp_path):
    """A line to the right whose middle lies there, 20 px a unit."""
    line = ds.Sketch(torch.tensor([[[-1.0, 0.0, -0.5], [1.0, 0.0, 1.5]]]), width=0.1)
    lens = torch.tensor([[[20.0, 0, 20], [0, 20, 20], [0, 0, 1]]])
    save_svg(tmp_path / "a.svg", line, ds.Cameras(torch.eye(4)[None], lens, (40, 40), near=0.5, orthographic=True))
    (points,) = curves_of(tmp_path / "a.svg").values()
    assert (float(points[:, 0].min()), float(points[:, 0].max())) == pytest.approx((20, 40), abs=0.01)


def test_coordinates_stay_near_the_image(tmp_path):
    save_svg(tmp_path / "a.svg", SKETCHES["through the near plane"], CAMERAS[0])
    points = torch.cat(list(curves_of(tmp_path / "a.svg").values()))
    # Half of the width of .02 of 256 pixels, and the rounding of what is written.
    assert points.min() >= -2.56 - ROUNDING
    assert points.max() <= 256 + 2.56 + ROUNDING


def test_a_stroke_that_leaves_the_page_and_returns_is_cut_exactly(tmp_path):
    """Seen along x, y to the right and z up, 10 px a unit: a line to far above, and an arc beyond the right border."""
    points = torch.tensor(
        [[[0.0, 0, -0.2], [0, 0, 1], [0, 0, 2], [0, 0, 90.0]], [[0, 0, -1], [0, 8, -1], [0, 8, 1], [0, 0, 1]]]
    )
    save_svg(tmp_path / "a.svg", ds.Sketch(points, width=0.1), ds.orbit(0.0, height=4.0, size=40))
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    paths = {path.get("id"): path.get("d") for path in root.iter(SPACE + "path")}
    assert set(paths) == {"stroke-0", "stroke-1"}
    ends = {name: [float(v) for v in re.split("[MC ,]+", d)[1:]] for name, d in paths.items()}
    assert paths["stroke-0"].count("M") == 1
    assert ends["stroke-0"][:2] == [20, 22]
    # The ink of half a width, 2 px, ends at the border.
    assert ends["stroke-0"][-2:] == [20, -2]
    assert paths["stroke-1"].count("M") == 2
    assert max(ends["stroke-1"][0::2]) <= 42 + 1e-3


def test_a_stroke_that_comes_onto_the_page_stays_one_path(tmp_path):
    points = torch.tensor([[[0.0, 0, 9], [0, 0, 1]], [[0, 0, 1], [0, 1, 1]], [[0, 1, 1], [0, 9, 1]]])
    sketch = ds.Sketch(points, width=0.1, chains=ds.Chains.of([3]))
    save_svg(tmp_path / "a.svg", sketch, ds.orbit(0.0, height=4.0, size=40))
    (path,) = ElementTree.parse(tmp_path / "a.svg").iter(SPACE + "path")
    assert (path.get("d").count("M"), path.get("d").count("L")) == (1, 3)


def test_a_page_in_millimetres_without_percentages_and_inner_pages(tmp_path):
    for cameras in (CAMERAS, CAMERAS[0]):
        page = PageSetup(100, 100 / len(cameras), 0, "none")
        save_svg(tmp_path / "a.svg", SKETCHES["circle"], cameras, page=page)
        root = ElementTree.parse(tmp_path / "a.svg").getroot()
        assert (root.get("width"), root.get("height")) == ("100mm", "50mm" if len(cameras) == 2 else "100mm")
        assert root.get("viewBox") == f"0 0 1000 {1000 // len(cameras)}"
        assert not list(root.iter(SPACE + "svg"))[1:]
        assert "%" not in (tmp_path / "a.svg").read_text()
        names = [element.get("id") for element in root.iter() if element.get("id")]
        assert len(set(names)) == len(names)


def test_a_stroke_that_is_wider_than_the_image_comes_to_an_end(monkeypatch):
    """Near the camera its disc covers the image from far away: no halving brings the centre nearer."""
    monkeypatch.setattr(screen_pieces, "MAX_HALVINGS", 12)
    intrinsics = ds.orbit([0.0], [-20.0], 3.0, size=48).intrinsics
    cameras = ds.Cameras(torch.eye(4)[None], intrinsics, (48, 48))
    points = torch.tensor([[[-1.0, 0.0, 0.1], [1.0, 0.2, 1.0], [1.0, 1.0, 1.2], [0.0, 0.0, 2.0]]])
    strokes = ds.project(ds.Sketch(points, width=0.8, width_space="world"), cameras)
    pieces = screen_pieces.screen_pieces(strokes, 0, (48, 48), TOLERANCE)
    assert len(pieces.start) < 100
    # From there on the discs reach the image: the whole pieces up to there must be kept, not halved for ever.
    assert pieces.start[0] == pytest.approx(0.0773, abs=0.001)
    assert torch.equal(pieces.start[1:], pieces.stop[:-1])
    assert pieces.stop[-1] == 1
    assert pieces.points[:, :, 2].max() > 48


def test_styles(tmp_path):
    points = torch.tensor([[[0.0, -0.3, 0.0], [0.0, 0.3, 0.0]]])
    sketch = ds.Sketch(points, width=0.125, color=(1.5, 0.5, -1.0), opacity=0.25)
    save_svg(tmp_path / "a.svg", sketch, ds.orbit([0.0] * 3, size=(40, 64)), background=(0.0, 0.2, 1.0))
    root = ElementTree.parse(tmp_path / "a.svg").getroot()
    assert (root.get("width"), root.get("height")) == ("128", "80")
    assert root.find(SPACE + "rect").get("fill") == "#0033ff"
    assert root.get("viewBox") == "0 0 128 80"
    views = root.findall(SPACE + "g")
    assert [v.get("id") for v in views] == ["view-0", "view-1", "view-2"]
    pages = [page.find(SPACE + "rect") for page in root.findall(SPACE + "clipPath")]
    assert [(p.get("x"), p.get("y")) for p in pages] == [("0", "0"), ("64", "0"), ("0", "40")]
    style = views[2].find(f"{SPACE}g/{SPACE}path").attrib
    assert (style["stroke"], style["stroke-width"], style["stroke-opacity"]) == ("#ff8000", "5", "0.25")
    save_svg(tmp_path / "a.svg", sketch, ds.orbit(0.0), background=None)
    assert ElementTree.parse(tmp_path / "a.svg").getroot().find(SPACE + "rect") is None


def test_bad_arguments_write_nothing(tmp_path):
    sketch = SKETCHES["circle"]
    with pytest.raises(ValueError, match="at least one view"):
        save_svg(tmp_path / "a.svg", sketch, CAMERAS[:0])
    with pytest.raises(ValueError, match=r"background must be three numbers in \[0, 1\] or None, got \(1.0, 1.0\)"):
        save_svg(tmp_path / "a.svg", sketch, CAMERAS, background=(1.0, 1.0))
    assert list(tmp_path.iterdir()) == []


def test_layers_are_named_by_stroke_and_names_are_escaped(tmp_path):
    points = torch.tensor([[[0.0, -0.5, 0], [0, 0.5, 0]], [[0, -0.5, 0.2], [0, 0.5, 0.2]], [[0, 0, -0.3], [0, 0, 0.4]]])
    sketch, camera = ds.Sketch(points), ds.orbit(0.0, 0.0, 3.0, size=64)
    save_svg(tmp_path / "a.svg", sketch, camera, layers=["front", 'a "<b>" & c', "front"])
    groups = [g for g in ElementTree.parse(tmp_path / "a.svg").getroot() if g.tag.endswith("}g")]
    named = {g.get("{http://www.inkscape.org/namespaces/inkscape}label"): {p.get("id") for p in g} for g in groups}
    assert named == {"front": {"stroke-0", "stroke-2"}, 'a "<b>" & c': {"stroke-1"}}
    with pytest.raises(ValueError, match="one for each of the 3 strokes, got 1"):
        save_svg(tmp_path / "b.svg", sketch, camera, layers=["front"])
    assert not (tmp_path / "b.svg").exists()
