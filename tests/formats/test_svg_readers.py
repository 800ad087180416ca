"""SVG as other programs read it (svgelements, svgpathtools, CairoSVG); layers, centre lines and cuts."""

import dataclasses
import importlib.util
import io
import itertools
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import torch
from ink import ink_apart
from PIL import Image

import diff3ds as ds
from diff3ds.formats import save_svg
from diff3ds.page.sheet.page_setup import PageSetup

CAMERA = ds.orbit(30.0, 20.0, size=256)
PATH = "{http://www.w3.org/2000/svg}path"
GROUP = "{http://www.w3.org/2000/svg}g"
INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"


def needs(package):
    return pytest.mark.skipif(importlib.util.find_spec(package) is None, reason=f"{package} is not installed")


def colored(space="image", count=12):
    """Strokes of three colours, and a whole circle."""
    g = torch.Generator().manual_seed(3)
    loose = ds.Sketch.random(count, generator=g).transform(torch.diag(torch.tensor([0.5, 0.5, 0.5, 1.0])))
    loose = loose.to(torch.float64)
    ring, weights = ds.bezier.circle((0.0, 0.0, 0.0), 0.7, (0.3, 0.2, 1.0))
    ring = ds.Sketch(ring, weights, chains=ds.Chains.of([len(ring)], True))
    sketch = ds.Sketch.concatenate([loose, ring])
    color = torch.eye(3, dtype=torch.float64).repeat(count, 1)[: len(sketch)]
    return dataclasses.replace(sketch, color=color, width=0.03, width_space=space)


def written(path):
    """What stands in the file: by id of the path, the numbers of its data as points."""
    found = {}
    for element in ElementTree.parse(path).iter(PATH):
        numbers = re.findall(r"-?\d+\.?\d*", element.get("d"))
        found[element.get("id")] = np.array([float(n) for n in numbers]).reshape(-1, 2)
    return found


@needs("svgelements")
@pytest.mark.parametrize("space", ["image", "world"])
def test_svgelements_reads_the_same_paths_and_the_size_on_paper(tmp_path, space):
    import svgelements

    save_svg(tmp_path / "a.svg", colored(space), CAMERA, page=PageSetup(128, 128, 0, "none"))
    # At 25.4 points an inch a millimetre is one: ten pixels.
    page = svgelements.SVG.parse(str(tmp_path / "a.svg"), ppi=25.4)
    assert (page.width, page.height) == pytest.approx((128.0, 128.0))
    paths = {element.id: element for element in page.elements() if isinstance(element, svgelements.Path)}
    expected = written(tmp_path / "a.svg")
    assert paths.keys() == expected.keys()
    for name, path in paths.items():
        ends = [point for s in path.segments() for point in (s.start, s.end) if point is not None]
        gaps = np.linalg.norm(np.array([(p.x, p.y) for p in ends])[:, None] * 10 - expected[name][None], axis=-1)
        assert gaps.min(1).max() < 1e-3
        box = np.array(path.bbox()) * 10
        low, high = expected[name].min(0), expected[name].max(0)
        assert (box[:2] >= low - 1e-3).all()
        assert (box[2:] <= high + 1e-3).all()


@needs("svgpathtools")
@pytest.mark.parametrize("space", ["image", "world"])
def test_svgpathtools_reads_the_same_control_points(tmp_path, space):
    import svgpathtools

    save_svg(tmp_path / "a.svg", colored(space), CAMERA)
    paths, attributes = svgpathtools.svg2paths(str(tmp_path / "a.svg"))
    expected = written(tmp_path / "a.svg")
    read = {a["id"]: path for path, a in zip(paths, attributes, strict=True) if "d" in a and a["id"] in expected}
    assert read.keys() == expected.keys()
    for name, path in read.items():
        # Closed curves end with a line of no length, or with one back to their start.
        points = {p for segment in path for p in segment.bpoints()}
        assert points == {complex(*p) for p in expected[name]}


@needs("cairosvg")
@pytest.mark.parametrize("space", ["image", "world"])
def test_cairosvg_draws_what_render_draws(tmp_path, space):
    import cairosvg

    save_svg(tmp_path / "a.svg", colored(space), CAMERA)
    picture = Image.open(io.BytesIO(cairosvg.svg2png(url=str(tmp_path / "a.svg")))).convert("RGB")
    rendered = ds.render(colored(space), CAMERA).color[0].numpy() * 255
    assert np.abs(np.asarray(picture) - rendered).mean() < 2
    assert ink_apart(np.asarray(picture) / 255, rendered / 255) == 0


def test_layers_are_named_by_their_colour(tmp_path):
    save_svg(tmp_path / "a.svg", colored(), CAMERA, layers="color")
    layers = [g for g in ElementTree.parse(tmp_path / "a.svg").iter(GROUP) if g.get(INKSCAPE + "groupmode") == "layer"]
    assert sorted(g.get(INKSCAPE + "label") for g in layers) == ["#0000ff", "#00ff00", "#ff0000"]
    for layer in layers:
        colors = {path.get("stroke") or path.get("fill") for path in layer.findall(PATH)}
        assert colors == {layer.get(INKSCAPE + "label")}


@needs("svgpathtools")
@pytest.mark.parametrize("space", ["image", "world"])
def test_a_plotter_draws_each_stroke_once_and_fills_nothing(tmp_path, space):
    import svgpathtools

    sketch = dataclasses.replace(colored(space), opacity=torch.full((13,), 0.5, dtype=torch.float64))
    save_svg(tmp_path / "a.svg", sketch, CAMERA, centerline=True, background=None)
    paths = list(ElementTree.parse(tmp_path / "a.svg").iter(PATH))
    strokes = [int(number) for path in paths for number in path.get("id").split("-")[1:]]
    assert sorted(strokes) == list(range(13))
    assert all(path.get("fill") == "none" and path.get("stroke-opacity") is None for path in paths)
    assert all(path.get("d").count("M") == 1 for path in paths)
    # A closed stroke is closed: by itself, or where the pen goes round it on its way along another that meets it.
    [ring] = [path for path in paths if "12" in path.get("id").split("-")]
    path = svgpathtools.parse_path(ring.get("d"))
    knots = [*(segment.start for segment in path), path.end]
    again = min(abs(a - b) for i, a in enumerate(knots) for b in knots[i + 1 :])
    assert (ring.get("id") == "stroke-12" and ring.get("d").endswith("Z")) or again < 0.01


def test_strokes_that_change_their_order_are_cut_and_others_are_not(tmp_path):
    # Seen from +x: a comb of three vertical lines, and a wave that goes behind the first, before the second and so on.
    lines = torch.tensor([[[0.0, y, -0.5], [0, y, 0.5]] for y in (-0.5, 0.0, 0.5)])
    ends = [(-0.2, -0.7), (-0.2, -0.3), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.3), (-0.2, 0.7)]
    wave = torch.tensor([[[*a, 0.0], [*b, 0.0]] for a, b in itertools.pairwise(ends)])
    points = torch.cat([lines, wave])
    sketch = ds.Sketch(points, width=0.05, color=torch.eye(4)[:, :3], chains=ds.Chains.of([1, 1, 1, 5]))
    camera = ds.orbit(0.0, 0.0, size=128)
    save_svg(tmp_path / "a.svg", sketch, camera)
    # No line goes both before and behind the wave: an order does.
    names = [p.get("id") for p in ElementTree.parse(tmp_path / "a.svg").iter(PATH)]
    assert names.index("stroke-1") < names.index("stroke-3") < min(names.index("stroke-0"), names.index("stroke-2"))
    # One colour in any order looks the same.
    save_svg(tmp_path / "a.svg", ds.Sketch(points, width=0.05, chains=sketch.chains), camera)
    assert "part" not in (tmp_path / "a.svg").read_text()


def test_a_knot_is_cut_where_it_must_be(tmp_path):
    # Each of three bars lies over the next: no order of whole ones shows that.
    angle = torch.tensor([0.0, 2.0943951, 4.1887902])
    way = torch.stack([torch.zeros(3), angle.cos(), angle.sin()], -1)
    side = torch.stack([torch.zeros(3), -angle.sin(), angle.cos()], -1)
    tilt = torch.tensor([0.3, 0.0, 0.0])
    points = torch.stack([-0.3 * side - 0.7 * way - tilt, -0.3 * side + 0.7 * way + tilt], 1)
    sketch = ds.Sketch(points, width=0.08, color=torch.eye(3))
    save_svg(tmp_path / "a.svg", sketch, ds.orbit(0.0, 0.0, size=128))
    names = [p.get("id") for p in ElementTree.parse(tmp_path / "a.svg").iter(PATH)]
    assert len(names) == 4
    assert sum("part-2" in name for name in names) == 1


@pytest.mark.slow
def test_many_coloured_strokes_make_a_small_file(tmp_path):
    g = torch.Generator().manual_seed(0)
    place = torch.rand(1000, 1, 3, generator=g) * 1.2 - 0.6
    way = torch.nn.functional.normalize(torch.randn(1000, 1, 3, generator=g), dim=-1)
    way = way * (0.05 + 0.4 * torch.rand(1000, 1, 1, generator=g)) * torch.linspace(-0.5, 0.5, 4)[:, None]
    points = place + way + 0.03 * torch.randn(1000, 4, 3, generator=g)
    width, color = 0.004 + 0.01 * torch.rand(1000, generator=g), torch.rand(1000, 3, generator=g)
    sketch = ds.Sketch(points, width=width, color=color)
    save_svg(tmp_path / "a.svg", sketch, ds.orbit(30.0, 20.0, size=1024))
    assert (tmp_path / "a.svg").stat().st_size < 1_500_000


def hidden_dashes():
    """A box whose edges have three colours, the hidden ones dashed: what is drawn, and of which line each is a dash."""
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([(a, b, c) for a, b, c, _ in sides] + [(a, c, d) for a, _, c, d in sides])
    mesh = ds.TriangleMesh(torch.from_numpy(corners), torch.from_numpy(faces))
    ends = [(a, b) for a, b in itertools.combinations(range(8), 2) if np.abs(corners[a] - corners[b]).sum() == 1]
    edges = ds.Sketch(torch.from_numpy(corners[np.array(ends)]), width=0.008)
    edges = edges.replace(color=torch.eye(3, dtype=torch.float64).repeat(4, 1))
    (lines,) = ds.visible_lines(edges, CAMERA, mesh, contours=False)
    return lines.drawn("dashed"), lines.dashes("dashed")


@needs("svgpathtools")
@pytest.mark.parametrize("pens", [False, True])
def test_dashes_of_a_line_are_one_path(tmp_path, pens):
    import svgpathtools

    sketch, dashes = hidden_dashes()
    lines = {line for line in dashes if line >= 0}
    assert len(lines) == 3
    numbers = [line if line >= 0 else -1 for line in dashes]
    for name, given in (("one", dashes), ("many", None)):
        save_svg(tmp_path / f"{name}.svg", sketch, CAMERA, centerline=pens, numbers=numbers, dashes=given)
    paths, attributes = svgpathtools.svg2paths(str(tmp_path / "one.svg"))
    parts = {line: [0, 0] for line in lines}
    for path, attribute in zip(paths, attributes, strict=True):
        if found := re.match(r"stroke-(\d+)", attribute.get("id", "")):
            parts[int(found[1])][0] += 1
            parts[int(found[1])][1] += len(path.continuous_subpaths())
    assert {line: dashes.count(line) for line in lines} == {line: count for line, (_, count) in parts.items()}
    # A pen may draw another line of its colour in between.
    assert max(count for count, _ in parts.values()) <= (2 if pens else 1)
    # Nothing else changes, for other readers either.
    apart, _ = svgpathtools.svg2paths(str(tmp_path / "many.svg"))
    assert sum(path.length() for path in paths) == pytest.approx(sum(path.length() for path in apart), rel=1e-6)
    if importlib.util.find_spec("vpype"):
        import vpype

        counts = [
            [len(layer) for layer in vpype.read_multilayer_svg(str(tmp_path / name), 0.1).layers.values()]
            for name in ("one.svg", "many.svg")
        ]
        assert counts[0] == counts[1]


@needs("resvg_py")
def test_joined_dashes_lie_above_and_below_what_they_did(tmp_path):
    """Dashes of one line above and below a broad stroke that crosses it stay apart there, others are one path."""
    y = np.linspace(-0.9, 0.9, 10)
    dashes = [[[x, a, 0.0], [x, a + 0.1, 0.0]] for x, a in zip(np.linspace(-0.5, 0.5, 10), y, strict=True)]
    band = [[0.0, -0.2, 0.5], [0.0, -0.2, -0.5]]
    points = torch.tensor([*dashes, band], dtype=torch.float64)
    color = torch.tensor([[0.0, 0.0, 0.0]] * 10 + [[1.0, 0.0, 0.0]], dtype=torch.float64)
    width = torch.tensor([0.02] * 10 + [0.4], dtype=torch.float64)
    sketch, camera = ds.Sketch(points, width=width, color=color), ds.orbit(0.0, 0.0, 3.0, height=2.0, size=256)
    files = [tmp_path / "one.svg", tmp_path / "many.svg"]
    for file, given in zip(files, ([7] * 10 + [-1], None), strict=True):
        save_svg(file, sketch, camera, dashes=given)
    one, many = (ds.styles.svg_pixels(file.read_text()) for file in files)
    assert torch.equal(one, many)
    assert len(written(files[0])) == 3
    assert len(written(files[1])) == 11
