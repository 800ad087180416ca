"""Surfaces on the page: what is hidden and the contours are as `render` draws them, by keys, served and beside."""

import base64
import io
import json
import re

import numpy as np
import pytest
import torch
from ink import ink_apart
from line_by_line import CONTOUR, ENDS, FLAT, STROKE, contours_off, strokes_off, with_lines_told
from served_page import served
from sweep import sweep
from viewer_browser import CHROMIUM, COARSE, LARGE

import diff3ds as ds
from diff3ds.formats.framing import framed
from diff3ds.formats.mesh import save_surface
from diff3ds.formats.scenes.html import sketch_page
from diff3ds.surfaces import on_page
from diff3ds.tasks.export.export import run_export
from diff3ds.tasks.export.export_options import ExportOptions
from diff3ds.tasks.style_options import StyleOptions

in_browser = pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium (Debian: apt-get install chromium)")
pytestmark = pytest.mark.xdist_group("browser")
# As of the pages without surfaces: means of absolute differences.
CLOSE = 4 / 255
# Around it the page shows where the focus is.
INSIDE = (slice(4, -4), slice(4, -4))


def torus(around=48, across=24, tube=0.4):
    u, v = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b = 2 * np.pi * u / around, 2 * np.pi * v / across
    out = 1 + tube * np.cos(b)
    points = np.stack([out * np.cos(a), out * np.sin(a), tube * np.sin(b)], -1).reshape(-1, 3)
    return ds.TriangleMesh(points, _grid(around, across, u, v))


def _grid(rows, columns, u, v):
    def corner(x, y):
        return (x % rows) * columns + y % columns

    a, b, c, d = corner(u, v), corner(u + 1, v), corner(u + 1, v + 1), corner(u, v + 1)
    return np.concatenate([np.stack(half, -1).reshape(-1, 3) for half in ((a, b, c), (a, c, d))])


CUBE = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def box(size=1.0, place=(0.0, 0.0, 0.0)):
    faces = [half for a, b, c, d in SIDES for half in ([a, b, c], [a, c, d])]
    return ds.TriangleMesh(size * np.array(CUBE, float) + np.array(place), np.array(faces))


def cylinder(sides=12):
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = 0.6 * np.stack([np.cos(turn), np.sin(turn)], 1)
    points = np.concatenate([np.c_[ring, -np.ones(sides)], np.c_[ring, np.ones(sides)], [[0, 0, -1], [0, 0, 1]]])
    k, n = np.arange(sides), (np.arange(sides) + 1) % sides
    ends = [np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)]
    sheets = [(k, n, n + sides), (k, n + sides, k + sides), (ends[0], n, k), (ends[1], k + sides, n + sides)]
    return ds.TriangleMesh(points, np.concatenate([np.stack(sheet, 1) for sheet in sheets]))


def sheet():
    """A wave that is open, so that it has borders, and both of its sides are seen."""
    x, y = np.meshgrid(np.linspace(-1, 1, 40), np.linspace(-1, 1, 40), indexing="ij")
    k = np.arange(39)
    faces = _grid(40, 40, *np.meshgrid(k, k, indexing="ij"))
    return ds.TriangleMesh(np.stack([x, y, 0.4 * np.sin(4 * x)], -1).reshape(-1, 3), faces)


def edges(size=1.0):
    pairs = [(a, b) for a in CUBE for b in CUBE if a < b and sum(x != y for x, y in zip(a, b, strict=True)) == 1]
    return size * torch.tensor(pairs, dtype=torch.float32)


def random(count, seed=0, reach=1.5, **more):
    drawn = torch.rand(count, 4, 3, generator=torch.Generator().manual_seed(seed))
    return ds.Sketch(reach * (2 * drawn - 1), **more)


def colors(count):
    return torch.rand(count, 3, generator=torch.Generator().manual_seed(1))


def moved(sketch, surface, scale, place):
    matrix = torch.eye(4, dtype=torch.float64)
    matrix[:3] *= scale
    matrix[:3, 3] = torch.tensor(place, dtype=torch.float64)
    return sketch.to(torch.float64).transform(matrix), ds.TriangleMesh(scale * surface.vertices + place, surface.faces)


BOTH = np.concatenate([box(0.5).vertices, box(0.3, (0.9, 0.2, 0.1)).vertices])
# On the last one the sketch is small before a large surface, which reaches far out of its ball.
SCENES = {
    "torus": (random(20, width=0.01), torus()),
    "edges of a cube": (ds.Sketch(edges(), width=0.02), box()),
    "wide edges of a cube": (ds.Sketch(edges(), width=0.1, color=colors(12)), box()),
    "cylinder of few sides": (random(15, width=0.01, color=colors(15)), cylinder()),
    "coarse torus": (random(10, width=0.01), torus(16, 10)),
    "world widths": (random(10, width=0.06, width_space="world"), torus()),
    "translucent": (random(10, width=0.05, opacity=0.5, color=colors(10)), torus()),
    "two boxes without strokes on them": (
        random(6),
        ds.TriangleMesh(BOTH, np.concatenate([box().faces, box().faces + 8])),
    ),
    "open sheet": (random(10, width=0.02), sheet()),
    "map coordinates": moved(random(10, width=0.02), torus(), 30.0, [4e6, 5e6, 300.0]),
    "minute": moved(random(10, width=0.02), torus(), 1e-5, [0.0, 0.0, 0.0]),
    "surface alone": (ds.Sketch(torch.tensor([[[0.0, 0, -1], [0, 0, 1]]])), torus()),
    "small before large": (random(5, reach=0.3, width=0.02), box(4.0, (-5.0, 0.0, 0.0))),
}


def seen(browser):
    return pixels(browser.picture())


def pixels(png):
    from PIL import Image

    picture = Image.open(io.BytesIO(png)).convert("RGB")
    return torch.tensor(list(picture.tobytes()), dtype=torch.float32).reshape(picture.height, picture.width, 3) / 255


def drawn(sketch, surface, image, hidden="drop", contours=True, **lens):
    cameras = framed(sketch, 30, 20, size=tuple(image.shape[:2]), **lens)
    wanted = {"surface": surface, "hidden": hidden, "contours": contours}
    return ds.render(sketch.to(torch.float64), cameras, **wanted).color[0].float()


def difference(image, other):
    return float((image - other).abs()[INSIDE].mean())


def check(browser, path, name, **size):
    sketch, surface = SCENES[name]
    ds.save(path, sketch, surface=surface)
    browser.open(with_lines_told(path), **size)
    image = seen(browser)
    assert not browser.errors, name
    assert float((image < 0.5).float().mean()) > 0.003, name
    return lines_agree(browser, image, sketch, surface)


def lines_agree(browser, image, sketch, surface, **lens):
    """How much the picture differs in the mean, where each stroke, contour and visible part is where it should be."""
    camera = framed(sketch, 30, 20, size=tuple(image.shape[:2]), **lens)
    picture = drawn(sketch, surface, image, **lens)
    assert max(strokes_off(browser, sketch, camera)) < STROKE
    assert max(contours_off(browser, sketch, surface, camera), default=0) < CONTOUR
    assert ink_apart(image[INSIDE], picture[INSIDE], FLAT) == 0
    assert ink_apart(image[INSIDE], picture[INSIDE]) < ENDS
    return difference(image, picture)


@in_browser
def test_the_picture_is_that_of_the_renderer_by_keys_too(browser, tmp_path):
    """What is hidden is dropped at first, v dashes it, and w leaves the contours out."""
    sketch, surface = SCENES["coarse torus"]
    assert check(browser, tmp_path / "a.html", "coarse torus", **LARGE) < CLOSE / 4
    browser.key("v")
    dashed = seen(browser)
    # Dashes begin where the stroke does, and not where it begins to be hidden: how much ink they leave out tells them.
    wanted, whole = (drawn(sketch, surface, dashed, how) for how in ("dashed", "show"))
    assert difference(dashed, wanted) < CLOSE / 1.5
    got, asked = (float((image - whole)[INSIDE].mean()) for image in (dashed, wanted))
    assert abs(got - asked) < asked / 3
    assert browser.value("document.getElementById('said').textContent") == "Hidden lines dashed"
    browser.key("w")
    bare = seen(browser)
    assert difference(bare, drawn(sketch, surface, bare, "dashed", contours=False)) < CLOSE / 1.5
    assert difference(bare, dashed) > CLOSE / 4
    assert not browser.errors


@in_browser
def test_outlines_of_other_views_give_way_to_those_of_this_one(browser, tmp_path):
    loose, surface = SCENES["torus"]
    sketch = loose.replace(kinds=["contour", "crease"] * 10)
    ds.save(tmp_path / "a.html", sketch, surface=surface)
    browser.open(with_lines_told(tmp_path / "a.html"))
    image = seen(browser)
    assert difference(image, drawn(sketch, surface, image)) < CLOSE / 4
    assert difference(image, drawn(loose, surface, image)) > CLOSE / 4
    browser.key("w")
    bare = seen(browser)
    assert difference(bare, drawn(loose, surface, bare, contours=False)) < CLOSE
    assert not browser.errors


@in_browser
@pytest.mark.slow
def test_faint_and_shown_lines(browser, tmp_path):
    """By keys backwards, and by the list."""
    sketch, surface = SCENES["torus"]
    check(browser, tmp_path / "a.html", "torus", **LARGE)
    pictures = []
    for how in ("show", "faint"):
        browser.key("V")
        pictures.append(seen(browser))
        wanted = drawn(sketch, surface, pictures[-1], how)
        assert ink_apart(pictures[-1][INSIDE], wanted[INSIDE], FLAT) == 0
        assert difference(pictures[-1], wanted) < CLOSE / 4
    assert difference(*pictures) > CLOSE / 4
    browser.value(
        "(l => { l.value = 'show'; l.dispatchEvent(new Event('change')) })(document.getElementById('hidden'))"
    )
    browser.settle()
    assert difference(seen(browser), pictures[0]) < 1e-3


@in_browser
@pytest.mark.slow
def test_every_scene_is_that_of_the_renderer(browser, tmp_path):
    found = {name: check(browser, tmp_path / "a.html", name, **LARGE) for name in SCENES}
    assert {name: value for name, value in found.items() if value > CLOSE / 2} == {}


@in_browser
@pytest.mark.slow
def test_turned_and_orthographic_views(browser, tmp_path):
    sketch, surface = SCENES["cylinder of few sides"]
    ds.save(tmp_path / "a.html", sketch, surface=surface)
    browser.open(with_lines_told(tmp_path / "a.html"), **LARGE)
    browser.key("o")
    image = seen(browser)
    points = sketch.points.double().flatten(0, 1)
    middle = (points.amin(0) + points.amax(0)) / 2
    distance = float((framed(sketch, 30, 20, size=tuple(image.shape[:2])).centers[0] - middle).norm())
    height = 2 * distance * float(torch.tensor(20.0).deg2rad().tan())
    assert lines_agree(browser, image, sketch, surface, height=height) < CLOSE / 2


@in_browser
def test_a_served_run_gets_its_surface_when_it_is_there(browser, tmp_path):
    """And the page is loaded anew for that, seen from where one looks."""
    sketch, surface = SCENES["edges of a cube"]
    ds.save(tmp_path / "sketch.json", sketch)
    with served(tmp_path) as server:
        browser.open(server.address)
        assert browser.value("document.getElementById('hiding').hidden")
        browser.key("ArrowLeft")
        save_surface(tmp_path / "surface.glb", surface.vertices, surface.faces)
        ds.save(tmp_path / "sketch.json", ds.Sketch(edges(), width=0.03))
        browser.settle(
            "document.getElementById('hiding')?.hidden === false && document.querySelector('[data-settled]') !== null"
        )
        browser.key("0")
        image = seen(browser)
        assert difference(image, drawn(ds.Sketch(edges(), width=0.03), surface, image)) < CLOSE / 2
        assert not browser.errors


@in_browser
@pytest.mark.slow
def test_both_sides_have_their_own_surface(browser, tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    for folder, size in ((one, 1.0), (other, 0.5)):
        folder.mkdir()
        ds.save(folder / "sketch.json", ds.Sketch(edges(), width=0.02))
        save_surface(folder / "surface.glb", box(size).vertices, box(size).faces)
    run_export(one, tmp_path / "a.html", ExportOptions(beside=other), StyleOptions())
    browser.open((tmp_path / "a.html").as_uri(), width=1000, height=260)
    half = browser.value("document.querySelector('main').clientWidth") // 2
    image = pixels(browser.picture(whole=True))
    for part, size in ((image[:, :half], 1.0), (image[:, half : 2 * half], 0.5)):
        wanted = drawn(ds.Sketch(edges(), width=0.02), box(size), part)
        assert float((part - wanted)[4:-30, 4:-4].abs().mean()) < CLOSE / 2


@in_browser
def test_a_stroke_is_drawn_on_the_surface(browser, tmp_path):
    """By mouse, beside the surface too, where there is nothing of it. The stroke lies on the surface, all along."""
    path = tmp_path / "a.json"
    ds.save(path, ds.Sketch(edges(), width=0.02))
    surface = torus()
    save_surface(tmp_path / "torus.glb", surface.vertices, surface.faces)
    with served(path, surface=tmp_path / "torus.glb") as server:
        # The page before may still ask its server, which is gone.
        browser.ask("Page.navigate", url="about:blank")
        browser.errors.clear()
        browser.ask("Emulation.setDeviceMetricsOverride", width=640, height=300, deviceScaleFactor=COARSE, mobile=False)
        browser.ask("Page.navigate", url=server.address)
        browser.settle("document.querySelector('[data-edit=undo]')?.disabled === true")
        for key in "to":
            send(browser, key)
        browser.value("document.getElementById('plane').value = 'surface'")
        box = browser.canvas_box()
        unit = 0.9 * box["height"] / 2 / 3**0.5  # orthographic: the target keeps its size
        middle = (box["width"] / 2, box["height"] / 2)
        send(browser, "a")
        browser.mouse("mousePressed", middle[0] + unit, middle[1] - 0.9 * unit, button="left", buttons=1, clickCount=1)
        for i in range(1, 31):
            y = middle[1] + unit * (-0.9 + 0.06 * i)
            browser.mouse("mouseMoved", middle[0] + unit, y, button="left", buttons=1)
        browser.mouse("mouseReleased", middle[0] + unit, y, button="left", clickCount=1)
        send(browser, "s", 2)
        browser.settle("document.querySelector('[data-edit=save]').textContent === 'Save'")
        assert not browser.errors
    drawn_again = ds.load(path)
    assert len(drawn_again) == 13
    rows = drawn_again.chains.stroke == 12 if drawn_again.chains else torch.arange(13) == 12
    curves = drawn_again.points[rows].double(), drawn_again.weights[rows].double()
    points = ds.bezier.evaluate(*curves, torch.linspace(0, 1, 17, dtype=torch.float64))
    away = (torch.hypot(points[..., :2].norm(dim=-1) - 1, points[..., 2]) - 0.4).abs()
    # The tube's facets are up to .005 inside of it, and what lies on it is within .0055.
    assert float(away.max()) < 0.012
    assert float(points[..., 2].min()) > 0


def send(browser, key, modifiers=0):
    text = "" if modifiers else key
    for kind in ("keyDown", "keyUp"):
        browser.ask("Input.dispatchKeyEvent", type=kind, key=key, modifiers=modifiers, text=text)
        text = ""


# Without a browser.


def embedded(page):
    return json.loads(re.search(r'<script type="application/json" id="surface">(.*?)</script>', page, re.S)[1])


def numbers(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


def test_what_a_page_has_of_a_surface():
    """Triangles within half a step, corners of a cube once for each side, creases that no stroke draws."""
    bare = ds.Sketch(edges()[:5])
    data = embedded(sketch_page("a", bare, surface=on_page.SurfaceOnPage(box())))
    points = numbers(data["points"], "<u2").reshape(-1, 3) * data["step"] + np.array(data["low"])
    faces = numbers(data["faces"], "<u2").reshape(-1, 3)
    assert len(points) == 24
    assert np.abs(points[faces] - box().vertices[box().faces]).max() <= data["step"] / 2 + 1e-12
    creases = numbers(data["creases"], "<u4").reshape(-1, 4)
    assert (len(creases), data["convex"], data["closed"]) == (7, 7, True)
    # The same ends on both sides, which are not the same corners.
    assert np.array_equal(points[creases[:, :2]], points[creases[:, 2:]])
    assert (creases[:, :2] != creases[:, 2:]).all()
    assert embedded(sketch_page("a", bare)) is None
    # Of another sketch.
    all_drawn = {"creases": "", "convex": 0}
    assert on_page.SurfaceOnPage(box()).bare_creases(ds.Sketch(edges())) == all_drawn
    assert on_page.SurfaceOnPage(box()).bare_creases(bare) == {name: data[name] for name in all_drawn}


@in_browser
def test_a_served_sketch_draws_the_creases_that_it_has_by_itself(browser, tmp_path):
    """Where those of the sketch before were drawn by the surface, in black and on top."""
    path = tmp_path / "a.json"
    ds.save(path, ds.Sketch(edges()[:1], width=0.05))
    save_surface(tmp_path / "box.glb", box().vertices, box().faces)
    sketch = ds.Sketch(edges(), width=0.05, color=(1.0, 0, 0))
    with served(path, surface=tmp_path / "box.glb") as server:
        browser.open(server.address)
        ds.save(path, sketch)
        browser.settle("document.getElementById('strokes').children.length === 12")
        browser.key("0")
        image = seen(browser)
        assert difference(image, drawn(sketch, box(), image)) < CLOSE / 2
        assert not browser.errors


@pytest.mark.usefixtures("unchecked")
def test_surfaces_that_no_page_takes(tmp_path, monkeypatch):
    """An explicit one is an error before anything is written; that of a run is left out, and that is said."""
    sketch = ds.Sketch(edges())
    with pytest.raises(TypeError, match="surface must be a TriangleMesh on a page, got str"):
        ds.save(tmp_path / "a.html", sketch, surface="a.glb")
    with pytest.raises(ValueError, match=r"a surface goes into \.html and \.py files"):
        ds.save(tmp_path / "a.json", sketch, surface=box())
    monkeypatch.setattr(on_page, "MOST_TRIANGLES", 11)
    with pytest.raises(ValueError, match="up to 11 triangles, this one has 12: give one with fewer"):
        ds.save(tmp_path / "a.html", sketch, surface=box())
    assert not list(tmp_path.iterdir())
    ds.save(tmp_path / "sketch.json", sketch)
    save_surface(tmp_path / "surface.glb", box().vertices, box().faces)
    said = []
    run_export(tmp_path, tmp_path / "a.html", ExportOptions(), StyleOptions(), said.append)
    assert embedded((tmp_path / "a.html").read_text(encoding="utf-8")) is None
    assert len(said) == 1
    assert "up to 11 triangles, this one has 12" in said[0]
    options = ExportOptions(surface=tmp_path / "surface.glb")
    with pytest.raises(ValueError, match="up to 11 triangles"):
        run_export(tmp_path / "sketch.json", tmp_path / "b.html", options, StyleOptions())
    with pytest.raises(ValueError, match=r"--surface is for \.html and \.py files"):
        run_export(tmp_path / "sketch.json", tmp_path / "b.obj", options, StyleOptions())
    assert not (tmp_path / "b.html").exists()


def test_a_surface_is_placed_as_the_sketch_is(tmp_path):
    ds.save(tmp_path / "sketch.json", ds.Sketch(edges()))
    save_surface(tmp_path / "surface.glb", box().vertices, box().faces)
    run_export(tmp_path, tmp_path / "a.html", ExportOptions(scale=3), StyleOptions())
    data = embedded((tmp_path / "a.html").read_text(encoding="utf-8"))
    assert data["low"] == [-3.0, -3.0, -3.0]
    assert data["step"] == pytest.approx(6 / 65535)


@sweep("broken", [b"", b"glTF" + bytes(40)])
def test_a_broken_surface_of_a_run_leaves_its_sketch_to_see(broken, tmp_path):
    ds.save(tmp_path / "sketch.json", ds.Sketch(edges()))
    (tmp_path / "surface.glb").write_bytes(broken)
    said = []
    with served(tmp_path, said):
        pass
    assert len(said) == 1
    assert said[0].endswith("the page shows no surface")
