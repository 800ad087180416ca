"""The widget of notebooks: the page that it holds, and what its script does with it in a real browser."""

import base64
import io
import json
import re
import sys
import time
from importlib.resources import files

import numpy as np
import pytest
import torch
from PIL import Image
from viewer_browser import COARSE, PATIENCE

import diff3ds as ds
from diff3ds.formats.scenes.html import sketch_page
from diff3ds.surfaces.on_page import SurfaceOnPage
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

POINTS = torch.tensor([[[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 1]]])
BLACK = ds.Sketch(POINTS, width=0.1)
RED = ds.Sketch(POINTS, width=0.1, color=(1.0, 0, 0))
SCRIPT = re.compile(r'(?<=<script type="module">).*?(?=</script>)', re.DOTALL)
SURFACE = re.compile(r'(?<=id="surface">).*?(?=</script>)', re.DOTALL)
# Mean difference of pictures whose samples lie a rounding error apart.
CLOSE = 0.5 / 255
# As high as the frame is at first.
SIZE = {"width": 420, "height": 480}
# Around it the policy names the script by its digest.
DIGEST = re.compile(r"script-src '[^']*'")


@pytest.fixture
def anywidget():
    return pytest.importorskip("anywidget")


def saved_page(path, sketch):
    ds.save(path / "sketch.html", sketch)
    return (path / "sketch.html").read_text(encoding="utf-8")


def test_the_widget_holds_the_page_that_is_saved(anywidget, tmp_path):
    widget, saved = ds.show(BLACK), saved_page(tmp_path, BLACK)
    assert isinstance(widget, anywidget.AnyWidget)
    assert "page" in widget.trait_names(sync=True)
    held, plain = (DIGEST.sub("", SCRIPT.sub("", page)) for page in (widget.page, saved))
    assert held == plain
    # Its script listens to the notebook, besides.
    framed = files("diff3ds.viewer").joinpath("framed.js").read_text(encoding="utf-8")
    assert SCRIPT.search(widget.page)[0] == SCRIPT.search(saved)[0] + "\n" + framed


def test_another_sketch_is_another_page(anywidget):
    widget = ds.show(BLACK, "chair")
    told = []
    widget.observe(lambda change: told.append(change["new"]), "page")
    widget.sketch = RED
    assert widget.sketch is RED
    assert told == [ds.show(RED, "chair").page]
    changed = ds.Sketch(POINTS.clone())
    widget.sketch = changed
    changed.points.mul_(2)
    widget.sketch = changed
    assert widget.page == ds.show(ds.Sketch(2 * POINTS), "chair").page
    assert len(told) == 3


def test_the_surface_stays_where_the_sketch_changes(anywidget, tmp_path):
    surface = TriangleMesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    widget = ds.show(BLACK, surface=surface)
    ds.save(tmp_path / "sketch.html", BLACK, surface=surface)
    held, saved = map(SURFACE.search, (widget.page, (tmp_path / "sketch.html").read_text(encoding="utf-8")))
    assert json.loads(held[0])["closed"] is False
    assert held[0] == saved[0]
    widget.sketch = RED
    assert SURFACE.search(widget.page)[0] == held[0]
    with pytest.raises(TypeError, match="surface"):
        ds.show(BLACK, surface="house.glb")


def test_what_is_no_sketch_changes_nothing(anywidget):
    with pytest.raises(TypeError, match="Sketch"):
        ds.show(POINTS)
    widget = ds.show(BLACK)
    with pytest.raises(TypeError, match="Sketch"):
        widget.sketch = "chair.json"
    assert widget.sketch is BLACK
    assert widget.page == ds.show(BLACK).page


def test_without_anywidget_it_says_what_to_install(monkeypatch):
    from diff3ds import notebook

    monkeypatch.setitem(sys.modules, "anywidget", None)
    notebook._widget_class.cache_clear()
    with pytest.raises(ImportError, match=r'pip install "diff3ds\[notebook\]"'):
        ds.show(BLACK)


# What a notebook gives the widget: an element, and a model whose values can be asked for and listened to.
NOTEBOOK = """<!doctype html><meta charset="utf-8"><style>body { margin: 0 }</style><div id="el"></div>
<script type="application/json" id="pages">%s</script>
<script type="module">
const [script, ...pages] = JSON.parse(document.getElementById("pages").textContent);
const module = await import(URL.createObjectURL(new Blob([script], { type: "text/javascript" })));
const listeners = new Set();
const values = { page: pages[0] };
const model = {
  get: (name) => values[name], on: (_, act) => listeners.add(act), off: (_, act) => listeners.delete(act),
};
window.change = (index) => { values.page = pages[index]; listeners.forEach((act) => act()); return listeners.size; };
window.end = module.default.render({ model, el: document.getElementById("el") });
document.documentElement.dataset.settled = "true";
</script>"""


def seen(browser):
    """What is on the screen, without the corner by which the frame is made larger."""
    clip = {"x": 0, "y": 0, "width": SIZE["width"], "height": SIZE["height"] - 20, "scale": 1}
    png = base64.b64decode(browser.ask("Page.captureScreenshot", format="png", clip=clip)["data"])
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), float) / 255


def becomes(browser, wanted):
    end = time.monotonic() + PATIENCE
    while abs(seen(browser) - wanted).mean() > CLOSE:
        assert time.monotonic() < end, "the screen does not show what it should"
        time.sleep(0.1)


@pytest.mark.xdist_group("browser")
def test_the_frame_shows_the_page_and_follows_the_notebook(browser, tmp_path):
    tetrahedron = TriangleMesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]])
    ends = torch.from_numpy(tetrahedron.vertices[tetrahedron.edges]).float()
    # Creases that no stroke draws are black.
    edges = ds.Sketch(ends, width=0.1, color=(1.0, 0, 0))
    wanted = []
    for sketch in (BLACK, edges):
        ds.save(tmp_path / "sketch.html", sketch, surface=tetrahedron)
        browser.open((tmp_path / "sketch.html").as_uri(), **SIZE)
        wanted.append(seen(browser))
    assert abs(wanted[0] - wanted[1]).mean() > 10 * CLOSE

    script = files("diff3ds.viewer").joinpath("notebook.js").read_text(encoding="utf-8")
    pages = [
        sketch_page("sketch", sketch, framed=True, surface=SurfaceOnPage(tetrahedron)) for sketch in (BLACK, edges)
    ]
    text = NOTEBOOK % json.dumps([script, *pages]).replace("<", "\\u003c")
    (tmp_path / "notebook.html").write_text(text, encoding="utf-8")
    browser.open((tmp_path / "notebook.html").as_uri(), **SIZE)
    becomes(browser, wanted[0])
    assert browser.value("change(1)") == 1
    becomes(browser, wanted[1])
    # At once after the frame has begun anew, as where cells are moved.
    browser.value("el.append(el.firstChild), change(0), change(1)")
    becomes(browser, wanted[1])
    assert browser.value("end(), change(0)") == 0
    assert not browser.errors


@pytest.mark.xdist_group("browser")
def test_a_page_that_gets_its_size_late_shows_the_whole_sketch(browser, tmp_path):
    ds.save(tmp_path / "sketch.html", BLACK)
    browser.open((tmp_path / "sketch.html").as_uri(), **SIZE, scale=COARSE)
    wanted = seen(browser)
    browser.open((tmp_path / "sketch.html").as_uri(), SIZE["width"] + 300, SIZE["height"], COARSE)
    assert abs(seen(browser) - wanted).mean() > 10 * CLOSE
    browser.ask("Emulation.setDeviceMetricsOverride", **SIZE, deviceScaleFactor=COARSE, mobile=False)
    becomes(browser, wanted)


@pytest.mark.xdist_group("browser")
def test_edits_are_not_lost_when_the_notebook_has_another_sketch(browser, tmp_path):
    page = sketch_page("sketch", BLACK, framed=True)
    (tmp_path / "framed.html").write_text(page, encoding="utf-8")
    browser.open((tmp_path / "framed.html").as_uri(), scale=COARSE)
    news = json.dumps({name: json.loads(_element(sketch_page("sketch", RED), name)) for name in ("sketch", "start")})
    color = "document.querySelector('#strokes input[type=color]').value"
    for key in ("n", "c"):
        browser.key(key)
    count = "document.getElementById('strokes').children.length"
    assert browser.value(count) == 2
    # The page is its own parent here, as a page in no frame is.
    browser.value(f"postMessage({news}, '*')")
    browser.settle("!document.getElementById('notice').hidden")
    assert browser.value(count) == 2
    assert "Your edits are still here" in browser.value("document.getElementById('notice').textContent")
    browser.value(
        "[...document.querySelectorAll('#notice button')].find((b) => b.textContent === 'Show the other').click()"
    )
    assert browser.value(count) == 1
    assert browser.value(color) == "#ff0000"
    assert not browser.errors


def _element(page, name):
    return re.search(rf'<script type="application/json" id="{name}">(.*?)</script>', page, re.DOTALL)[1]
