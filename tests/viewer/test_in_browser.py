"""The page in a real browser: its picture is that of `render`, and mouse, keys and list do what they say."""

import dataclasses
import io
import json

import pytest
import torch
from ink import ink_apart
from line_by_line import STROKE, strokes_off, with_lines_told
from served_page import served
from viewer_browser import CHROMIUM, COARSE, LARGE

import diff3ds as ds
from diff3ds.formats import save_png
from diff3ds.formats.framing import framed
from diff3ds.tasks.progress import Progress
from diff3ds.tasks.serving.serve import serving
from diff3ds.tasks.view_sketch.view import server_of

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium (Debian: apt-get install chromium)"),
    pytest.mark.xdist_group("browser"),
]
# The picture of the page is the mean of 64 samples a pixel, that of `render` computed; means of absolute differences.
CLOSE = 4 / 255
# Around it the page shows where the focus is.
INSIDE = (slice(4, -4), slice(4, -4))


def seen(browser, whole=False):
    """The canvas as it is on the screen, or the whole page: (H, W, 3) in [0, 1]."""
    from PIL import Image

    picture = Image.open(io.BytesIO(browser.picture(whole))).convert("RGB")
    return torch.tensor(list(picture.tobytes()), dtype=torch.float32).reshape(picture.height, picture.width, 3) / 255


def difference(image, other):
    return float((image - other).abs()[INSIDE].mean())


def shown(browser, path, sketch, **size):
    ds.save(path, sketch)
    browser.open(with_lines_told(path), **size)
    return seen(browser)


def drawn(sketch, image, azimuth=30.0, elevation=20.0, **lens):
    cameras = framed(sketch, azimuth, elevation, size=tuple(image.shape[:2]), **lens)
    return ds.render(sketch.to(torch.float64), cameras).color[0].float()


def numbers(*shape, seed=0):
    return torch.rand(*shape, generator=torch.Generator().manual_seed(seed))


def random(count=40, controls=4, seed=0, **more):
    return ds.Sketch(2 * numbers(count, controls, 3, seed=seed) - 1, **more)


def ring(**more):
    points, weights = ds.bezier.circle((0.0, 0.0, 0.0), 0.6, normal=(0.3, 0.0, 1.0), dtype=torch.float32)
    return ds.Sketch(points, weights, chains=ds.Chains.of([len(points)], True), **more)


def far(sketch, scale, place):
    matrix = torch.eye(4, dtype=torch.float64)
    matrix[:3] *= scale
    matrix[:3, 3] = torch.tensor(place, dtype=torch.float64)
    return sketch.to(torch.float64).transform(matrix)


LETTER = ds.Sketch(torch.tensor([[[-1.0, 0, 0], [0, 0, 1]], [[0, 0, 1], [1, 0, 0]]]), width=0.1, opacity=0.4,
                   chains=ds.Chains.of([2]))  # fmt: skip
MOVED = torch.tensor([[1.0, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 0.3], [0, 0, 0, 1]])
SCENES = {
    "cubics": random(),
    "lines": random(controls=2, width=0.03, color=numbers(40, 3)),
    "quadratics": random(controls=3, weights=0.2 + 3 * numbers(40, 3), color=numbers(40, 3, seed=1)),
    "extreme weights": random(12, weights=10 ** (4 * numbers(12, 4) - 2), width=0.02),
    "colours in depth": random(width=0.06, color=numbers(40, 3)),
    "translucent": random(width=0.08, color=numbers(40, 3), opacity=numbers(40)),
    "world widths": random(width=0.1, width_space="world", color=numbers(40, 3)),
    "widths along": random(width=0.08 * numbers(40, 4), color=numbers(40, 3)),
    "world widths along": random(width=0.2 * numbers(40, 4), width_space="world", opacity=0.7),
    "thinner than a pixel": random(200, width=0.0007),
    "circle": ring(width=0.1),
    "translucent circle": ring(width=0.2, opacity=0.5, width_space="world"),
    "corner": LETTER,
    "a point": ds.Sketch(torch.zeros(1, 4, 3), width=0.2),
    "map coordinates": far(random(width=0.02), 30.0, [4e6, 5e6, 300.0]),
    "minute": far(random(width=2e-6, width_space="world"), 1e-5, [0.0, 0.0, 0.0]),
    "quadratics along": random(controls=3, width=0.05 * numbers(40, 3), opacity=numbers(40)),
    "wide and narrow": random(12, width=0.2 * numbers(12), color=numbers(12, 3), opacity=0.9),
    "flat": ds.Sketch((2 * numbers(40, 4, 3) - 1) * torch.tensor([1.0, 1.0, 0.0]), width=0.02, color=numbers(40, 3)),
    # At the same depth everywhere: the thin ones, which come later, lie on top.
    "one on the other": ds.Sketch(
        torch.tensor([[[-0.8, 0.2, -0.5], [0.7, 0.3, 0.6]]]).expand(3, 2, 3),
        width=torch.tensor([0.3, 0.15, 0.05]),
        color=torch.eye(3),
    ),
    "nothing": ds.Sketch(torch.zeros(0, 4, 3)),
}


def looks_as(browser, image, sketch, azimuth=30.0, elevation=20.0, **lens):
    """As `render` draws it: each stroke by itself, ink where there is some, and colours."""
    # A picture of a canvas whose height is no whole number of pixels, as fonts may make it, has a row less.
    size = browser.value("[document.querySelector('canvas').height, document.querySelector('canvas').width]")
    camera = framed(sketch, azimuth, elevation, size=tuple(size), **lens)
    picture = drawn(sketch, image, azimuth, elevation, **lens)
    assert max(strokes_off(browser, sketch, camera), default=0) < STROKE
    assert ink_apart(image[INSIDE], picture[INSIDE]) == 0
    return difference(image, picture) < CLOSE


def check_scenes(browser, folder, names, **size):
    for name in names:
        image = shown(browser, folder / "a.html", SCENES[name], **size)
        assert not browser.errors, name
        assert looks_as(browser, image, SCENES[name]), name


def test_the_picture_is_that_of_the_renderer(browser, tmp_path):
    check_scenes(browser, tmp_path, ["translucent", "world widths along", "one on the other"])


@pytest.mark.slow
def test_every_scene_is_that_of_the_renderer(browser, tmp_path):
    check_scenes(browser, tmp_path, SCENES, **LARGE)


def test_it_asks_for_nothing_and_complains_of_nothing(browser, tmp_path):
    path = tmp_path / "<b>name</b> & {{script}}.html"
    shown(browser, path, random(3), scale=COARSE)
    browser.key("n")
    browser.key("d")
    assert browser.requests == [path.as_uri()]
    assert browser.errors == []
    assert browser.value("document.title") == path.stem


@pytest.mark.slow
def test_phones_and_fine_screens(browser, tmp_path):
    sketch = random(width=0.02)
    image = shown(browser, tmp_path / "a.html", sketch, width=390, height=844, scale=2)
    assert browser.value("document.documentElement.scrollWidth") == 390
    assert (
        browser.value("[canvas.width, canvas.height]".replace("canvas", "document.querySelector('canvas')"))[0] == 780
    )
    assert image.shape[1] == 780
    assert looks_as(browser, image, sketch)


@pytest.mark.slow
def test_keys_and_mouse_turn_it(browser, tmp_path):
    sketch = random(width=0.02)
    first = shown(browser, tmp_path / "a.html", sketch, **LARGE)
    for _ in range(3):
        browser.key("ArrowRight")
    browser.key("ArrowDown")
    turned = seen(browser)
    assert difference(turned, first) > CLOSE
    assert looks_as(browser, turned, sketch, 15, 25)
    browser.drag((100, 100), (200, 150))  # .4 degrees a pixel
    assert looks_as(browser, seen(browser), sketch, -25, 45)
    for key, place in {"f": (0, 0), "s": (-90, 0), "t": (-90, 90)}.items():
        browser.key(key)
        assert looks_as(browser, seen(browser), sketch, *place), key
    browser.key("0")
    assert difference(seen(browser), first) < 1e-3


@pytest.mark.slow
def test_zoom_and_orthographic_views(browser, tmp_path):
    sketch = random(width=0.05, width_space="world")
    first = shown(browser, tmp_path / "a.html", sketch, **LARGE)
    distance = float(framed(sketch, 30, 20, size=tuple(first.shape[:2])).centers[0].sub(_middle(sketch)).norm())
    for _ in range(4):
        browser.key("+")
    near = distance / 1.15**4
    assert looks_as(browser, seen(browser), sketch, distance=near)
    browser.key("o")
    # The middle keeps its size.
    height = 2 * near * torch.tensor(20.0).deg2rad().tan().item()
    assert looks_as(browser, seen(browser), sketch, height=height)


def _middle(sketch):
    points = sketch.points.double().flatten(0, 1)
    return (points.amin(0) + points.amax(0)) / 2


def test_strokes_are_selected_coloured_and_hidden(browser, tmp_path):
    points = torch.tensor([[[0.0, -1, -0.5], [0, 1, -0.5]], [[0, -1, 0.5], [0, 1, 0.5]]])
    first = shown(browser, tmp_path / "a.html", ds.Sketch(points, width=0.05))
    box = browser.canvas_box()
    x = box["width"] / 2
    # A click on the lower one selects it, with a halo; h hides it.
    middle = (first[:, int(x)].mean(-1) < 0.5).nonzero()[:, 0]
    y = float(middle.max()) - 4
    browser.mouse("mousePressed", x, y, button="left", buttons=1, clickCount=1)
    browser.mouse("mouseReleased", x, y, button="left", clickCount=1)
    browser.settle()
    assert browser.value("[...document.querySelectorAll('#strokes button')].map(b => b.ariaPressed)") == [
        "true",
        "false",
    ]
    assert difference(seen(browser), first) > 1e-3
    browser.key("h")
    assert browser.value("document.querySelector('#strokes input[type=checkbox]').checked") is False
    browser.key("Escape")
    left = seen(browser)
    assert float((left[int(y)][INSIDE[1]] < 0.99).sum()) == 0
    assert float((left[int(middle.min()) + 4][INSIDE[1]] < 0.99).sum()) > 0
    browser.value("document.querySelectorAll('#strokes input[type=checkbox]')[0].click()")
    browser.settle()
    assert difference(seen(browser), first) < 1e-3
    browser.value("(i => { i.value = '#ff0000'; i.dispatchEvent(new Event('input')); })"
                  "(document.querySelector('#strokes input[type=color]'))")  # fmt: skip
    browser.settle()
    assert seen(browser)[int(y), int(x)].tolist() == [1.0, 0.0, 0.0]


def test_everything_has_a_name(browser, tmp_path):
    shown(browser, tmp_path / "a.html", random(3), scale=COARSE)
    nodes = browser.ask("Accessibility.getFullAXTree")["nodes"]
    named = {
        (node["role"]["value"], node["name"]["value"])
        for node in nodes
        if not node["ignored"] and node["role"]["value"] in ("button", "checkbox", "ColorWell", "application", "list")
    }
    assert ("application", "a") in named
    assert {("button", "Stroke 2"), ("checkbox", "Show stroke 2"), ("ColorWell", "Colour of stroke 2")} <= named
    assert ("list", "Strokes (3)") in named
    assert all(name for _, name in named)
    browser.key("ArrowRight")
    browser.settle("document.getElementById('said').textContent !== ''")
    assert browser.value("document.getElementById('said').textContent") == "Seen from azimuth 25°, elevation 20°"


def test_a_served_page_follows_its_file_and_says_when_the_server_is_gone(browser, tmp_path):
    """From where one looks; a server that comes back at the same address is found."""
    path = tmp_path / "sketch.json"
    ds.save(path, random(3))
    server = server_of(path, 0, print)
    with serving(server):
        browser.open(server.address, scale=COARSE)
        browser.key("ArrowLeft")
        browser.settle("document.getElementById('said').textContent !== ''")
        azimuth = browser.value("document.getElementById('said').textContent")
        browser.value("window.isTheSamePage = true")
        ds.save(path, random(5))
        browser.settle("document.querySelectorAll('#strokes li').length === 5")
        browser.settle()
        assert browser.value("window.isTheSamePage")
        assert not browser.errors
        assert {address.rsplit("/", 1)[0] for address in browser.requests} == {server.address.rstrip("/")}
        browser.key("+")
        browser.key("-")
        browser.settle(f"document.getElementById('said').textContent === {json.dumps(azimuth)}")
    browser.settle("!document.getElementById('fault').hidden")
    assert "does not answer" in browser.value("document.getElementById('fault').textContent")
    again = server_of(path, server.server_port, print)
    again.door = dataclasses.replace(again.door, secret=server.secret)
    with serving(again):
        browser.settle("document.getElementById('fault').hidden")


def test_two_sketches_are_seen_by_one_camera(browser, tmp_path):
    """On a page of the disk and on one of a server; what is dragged on the right turns both."""
    from diff3ds.formats.scenes.html import save_html

    one, other = random(5, width=0.02), random(5, seed=3, width=0.02, color=numbers(5, 3)).transform(MOVED)
    both = ds.Sketch.concatenate([one, other])
    ds.save(tmp_path / "one.json", one)
    ds.save(tmp_path / "other.json", other)
    save_html(tmp_path / "a.html", one, ("other", other))

    def check(azimuth, elevation):
        image = seen(browser, whole=True)
        half = browser.value("document.querySelector('main').clientWidth") // 2
        for part, sketch in ((image[:, :half], one), (image[:, half : 2 * half], other)):
            size = part.shape[0], half
            cameras = framed(both, azimuth, elevation, size=size)
            drawn = ds.render(sketch.to(torch.float64), cameras).color[0].float()
            # The captions lie over the lower edge.
            assert float((part - drawn)[4:-30, 4:-4].abs().mean()) < CLOSE

    with served(tmp_path / "one.json", beside=tmp_path / "other.json") as server:
        for address in ((tmp_path / "a.html").as_uri(), server.address):
            browser.open(address, width=660)
            check(30, 20)
            browser.key("ArrowRight")
            check(25, 20)
            assert not browser.errors
        box = browser.value("(b => [b.x, b.y])(document.querySelector('#other').getBoundingClientRect())")
        start = (box[0] + 100, box[1] + 100)
        browser.drag(start, (start[0] + 50, start[1]))
        check(5, 20)
        ds.save(tmp_path / "one.json", both)
        browser.settle("document.querySelectorAll('#strokes li').length === 10")
        browser.settle()
        assert not browser.errors


def test_a_run_under_way_is_followed(browser, tmp_path):
    """Its strokes, losses, pictures and log, with a name that looks like markup; a picture enlarges."""
    from diff3ds.tasks.run_log import RunLog

    seconds = [0.0]
    log = RunLog(tmp_path, lambda progress: None, lambda line: None, lambda: seconds[0])
    log.report(Progress("<i>distill", 1, 9, 0.5, 3, "t 1-2", random(3).detach))
    with served(tmp_path) as server:
        browser.open(server.address, scale=COARSE)
        browser.settle("document.querySelector('#run p').textContent === '<i>distill 1 of 9, t 1-2'")
        save_png(tmp_path / "preview.png", numbers(8, 16, 3))
        log.say("a line & more")
        seconds[0] += 10
        log.report(Progress("<i>distill", 2, 9, 0.25, 5, "t 1-2", random(5).detach))
        browser.settle("document.querySelectorAll('#strokes li').length === 5")
        browser.settle("document.querySelector('#run progress').value === 2")
        browser.settle("document.querySelector('#pictures img')?.naturalWidth === 16")
        assert browser.value("document.querySelector('#run pre').textContent") == "<i>distill\na line & more"
        assert browser.value("document.querySelector('#run svg').ariaLabel") == "Loss 0.500 to 0.250 in 2 steps"
        browser.value("document.querySelector('#pictures button').click()")
        browser.settle("document.querySelector('dialog[open] img')?.naturalWidth === 16")
        browser.key("Escape")
        log.end("stopped")
        browser.settle("document.querySelector('#run p').textContent === 'Stopped early'")
        assert not browser.errors
        elsewhere = [a for a in browser.requests if not a.startswith(server.address)]
        assert [address for address in elsewhere if not address.endswith("/favicon.ico")] == []


# Levels of detail


def slide(browser, detail):
    browser.value(
        f"{{ const slider = document.getElementById('detail'); slider.value = {detail};"
        " slider.dispatchEvent(new Event('input')); true }"
    )
    browser.settle()


def test_the_slider_draws_what_at_detail_keeps(browser, tmp_path):
    sketch = ds.by_importance(random(10, width=0.03))
    path = tmp_path / "page.html"
    assert shown(browser, path, sketch) is not None
    for detail in (0, 0.4, 1):
        slide(browser, detail)
        kept = sketch.at_detail(detail)
        image = seen(browser)
        cameras = framed(sketch, 30.0, 20.0, size=tuple(image.shape[:2]))
        expected = ds.render(kept.to(torch.float64), cameras).color[0].float()
        assert difference(image, expected) < CLOSE
        of = "" if len(kept) == 10 else f"{len(kept)} of "
        assert browser.value("document.getElementById('count').textContent") == f"Strokes ({of}10)"
    assert browser.errors == []


def test_without_importance_there_is_no_slider(browser, tmp_path):
    shown(browser, tmp_path / "page.html", random(3), scale=COARSE)
    assert browser.value("document.getElementById('level').hidden")
