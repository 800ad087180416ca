"""Editing in a real browser: every edit by mouse and by keys changes the file as it says, and is undone to the byte."""

import json

import pytest
import torch
from served_page import served
from viewer_browser import CHROMIUM, COARSE
from waiting import until

import diff3ds as ds

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium (Debian: apt-get install chromium)"),
    pytest.mark.xdist_group("browser"),
]
CONTROL, SHIFT = 2, 8
SIZE = {"width": 640, "height": 300}
# Seen from the front: y to the right, z up. Two strokes of a square of side 2, and a third across.
CORNERS = {"a": (-1.0, -1.0), "b": (1.0, -1.0), "c": (1.0, 1.0), "d": (-1.0, 1.0)}


def line(first, last, controls=4):
    ends = torch.tensor([[0.0, *CORNERS[first]], [0.0, *CORNERS[last]]])
    return torch.lerp(ends[:1], ends[1:], torch.linspace(0, 1, controls)[:, None])


SQUARE = ds.Sketch(
    torch.stack([line("a", "b"), line("b", "c"), line("c", "d")]),
    width=0.02,
    names=["side ø", "", "\\ 3"],
    kinds=["crease", "", "contour"],
)
ARC = ds.Sketch(*ds.bezier.circle((0.0, 0.0, 0.0), 1.0, normal=(1.0, 0.0, 0.0), dtype=torch.float32), width=0.02)
CIRCLE = ds.Sketch(ARC.points, ARC.weights, width=0.02, chains=ds.Chains.of([len(ARC.points)], True))


def opened(browser, address):
    """Shows a page, and does not wait until all of it is drawn."""
    browser.ask("Emulation.setDeviceMetricsOverride", **SIZE, deviceScaleFactor=COARSE, mobile=False)
    browser.ask("Page.navigate", url="about:blank")
    browser.settle("location.href === 'about:blank'")
    # Of the page before, which may have asked its server to the end.
    browser.requests.clear()
    browser.errors.clear()
    browser.ask("Page.navigate", url=address)
    browser.settle(
        "document.readyState === 'complete' && document.querySelector('[data-edit=undo]')?.disabled === true"
    )


class Page:
    """A sketch in the browser, seen from the front, that is edited and saved."""

    def __init__(self, browser, path, address):
        self.browser, self.path = browser, path
        opened(browser, address)
        browser.value("sessionStorage.removeItem('page')")
        self.key("f")
        self.key("o")

    def key(self, key, modifiers=0):
        text = key if len(key) == 1 and not modifiers & CONTROL else ""
        for kind in ("keyDown", "keyUp"):
            self.browser.ask("Input.dispatchKeyEvent", type=kind, key=key, modifiers=modifiers, text=text)
            text = ""

    def keys(self, *keys):
        for key in keys:
            self.key(key)

    def click(self, x, y, modifiers=0):
        self.browser.mouse("mousePressed", x, y, button="left", buttons=1, clickCount=1, modifiers=modifiers)
        self.browser.mouse("mouseReleased", x, y, button="left", clickCount=1, modifiers=modifiers)

    def drag(self, *places):
        self.browser.mouse("mousePressed", *places[0], button="left", buttons=1, clickCount=1)
        for place in places[1:]:
            self.browser.mouse("mouseMoved", *place, button="left", buttons=1)
        self.browser.mouse("mouseReleased", *places[-1], button="left", clickCount=1)

    def pixel(self, y, z):
        """Where a place of the plane x = 0 is seen, CSS pixels."""
        box = self.browser.canvas_box()
        return box["width"] / 2 + self.unit * y, box["height"] / 2 - self.unit * z

    def handle(self, name):
        return self.browser.value(
            "(b => b && (r => [r.x + r.width / 2, r.y + r.height / 2])(b.getBoundingClientRect()))"
            f"([...document.querySelectorAll('#handles button')].find(b => b.ariaLabel === {json.dumps(name)}))"
        )

    def measure(self):
        """Learns from the handles of a stroke from (-1, -1) to (1, -1) how long a unit is."""
        self.key("n")
        self.unit = (self.handle("End")[0] - self.handle("Start")[0]) / 2
        self.key("Escape")

    def command(self, name):
        self.browser.value(f"document.querySelector('[data-edit={name}]').click()")

    def told(self):
        return self.browser.value("document.getElementById('said').textContent")

    def saved(self):
        self.key("s", CONTROL)
        self.browser.settle("document.querySelector('[data-edit=save]').textContent === 'Save'")
        return ds.load(self.path)

    def undone(self, times=1):
        for _ in range(times):
            self.key("z", CONTROL)
        self.saved()
        return self.path.read_bytes()


@pytest.fixture
def page(browser, tmp_path):
    path = tmp_path / "sketch.json"
    ds.save(path, SQUARE)
    with served(path) as server:
        made = Page(browser, path, server.address)
        made.measure()
        made.bytes = path.read_bytes()
        yield made
        assert browser.errors == []
        assert all(address.startswith(server.address) for address in browser.requests)


def changes(before, after):
    """Control points that moved."""
    return {(int(i), int(j)) for i, j in (before.points != after.points).any(-1).nonzero()}


def test_points_are_moved_by_mouse_and_keys_in_the_view_and_along_an_axis(page):
    page.keys("n", ".", ".", ".", ".")
    assert page.browser.value("document.activeElement.ariaLabel") == "Control point 1 of segment 0"
    page.keys("ArrowUp", "ArrowUp")
    found = page.saved()
    assert changes(SQUARE, found) == {(0, 1)}
    radius = 2**0.5
    step = torch.tensor([0.0, 0.0, 0.02 * radius])
    torch.testing.assert_close(found.points[0, 1] - SQUARE.points[0, 1], step, atol=1e-6, rtol=0)
    # By the mouse, .3 of a unit right and .2 up, then only along z.
    x, y = page.handle("Control point 1 of segment 0")
    page.drag((x, y), (x + 0.3 * page.unit, y - 0.2 * page.unit))
    moved = page.saved().points[0, 1] - found.points[0, 1]
    torch.testing.assert_close(moved, torch.tensor([0.0, 0.3, 0.2]), atol=1e-5, rtol=0)
    page.key("z")
    x, y = page.handle("Control point 1 of segment 0")
    page.drag((x, y), (x + 0.3 * page.unit, y - 0.2 * page.unit))
    last = page.saved().points[0, 1] - found.points[0, 1]
    torch.testing.assert_close(last, torch.tensor([0.0, 0.3, 0.4]), atol=1e-5, rtol=0)
    page.key("z")
    assert page.undone(4) == page.bytes
    page.key("Z", CONTROL | SHIFT)
    assert changes(SQUARE, page.saved()) == {(0, 1)}


def test_ends_keep_straight_strokes_straight_and_whole_strokes_move(page):
    page.keys("n", ".", ".")
    page.key("ArrowDown")
    found = page.saved()
    bent = ds.bezier.evaluate(found.points, found.weights, torch.tensor([0.5]))[0, 0]
    torch.testing.assert_close(bent, found.points[0, [0, 3]].mean(0), atol=1e-6, rtol=0)
    assert changes(SQUARE, found) == {(0, 0), (0, 1), (0, 2)}
    page.keys(",", "ArrowLeft")
    moved = page.saved().points[0] - found.points[0]
    torch.testing.assert_close(moved, moved[:1].expand(4, 3), atol=1e-6, rtol=0)
    assert page.undone(2) == page.bytes


def test_strokes_are_bent_by_mouse_and_keys(page):
    page.key("n")
    middle = page.pixel(0, -1)
    # Between handles.
    x = middle[0] - 0.66 * page.unit
    page.drag((x, middle[1]), (x, middle[1] - 0.2 * page.unit))
    found = page.saved()
    t = torch.tensor([0.17])
    torch.testing.assert_close(
        ds.bezier.evaluate(found.points, found.weights, t)[0, 0, 2], torch.tensor(-0.8), atol=0.03, rtol=0
    )
    assert changes(SQUARE, found) == {(0, 1), (0, 2)}
    page.keys(".", ".", ".", "ArrowUp")
    higher = page.saved()
    middles = [ds.bezier.evaluate(s.points, s.weights, torch.tensor([0.5]))[0, 0] for s in (found, higher)]
    torch.testing.assert_close(middles[1] - middles[0], torch.tensor([0.0, 0.0, 0.01 * 2**0.5]), atol=1e-6, rtol=0)
    assert page.undone(2) == page.bytes


def test_strokes_are_drawn_on_planes(page):
    page.key("a")
    steps = torch.linspace(0, 1, 21)
    page.drag(*(page.pixel(float(s) - 0.5, 0.3 * float((s * torch.pi).sin())) for s in steps))
    found = page.saved()
    assert len(found) == 4
    new = found[3]
    curve = ds.bezier.evaluate(new.points, new.weights, torch.linspace(0, 1, 50)).flatten(0, 1)
    torch.testing.assert_close(curve[:, 0], torch.zeros(len(curve)), atol=1e-5, rtol=0)
    away = (curve[:, 2] - 0.3 * ((curve[:, 1] + 0.5) * torch.pi).sin()).abs().max()
    assert float(away) < 4 / page.unit
    # By a key, on the ground, which must not be seen from its edge.
    page.browser.value("document.getElementById('plane').value = '2'")
    page.key("Enter")
    assert "from its edge" in page.told()
    page.keys("Escape", "Escape", "t", "a", "Enter")
    ground = page.saved()
    assert len(ground) == 5
    torch.testing.assert_close(ground.points[4, :, 2], torch.full((4,), -1.0), atol=1e-5, rtol=0)
    assert page.undone(2) == page.bytes


@pytest.mark.parametrize("by_mouse", [pytest.param(False, marks=pytest.mark.slow), True])
def test_deleted_duplicated_mirrored_and_fixed(page, by_mouse):
    def act(key, name):
        page.command(name) if by_mouse else page.key(key)

    page.click(*page.pixel(0, 1)) if by_mouse else page.key("p")
    act("c", "duplicate")
    found = page.saved()
    assert len(found) == 4
    moved = found.points[3] - SQUARE.points[2]
    torch.testing.assert_close(moved, moved[:1].expand(4, 3), atol=1e-6, rtol=0)
    assert float(moved.norm()) > 0.1
    act("Delete", "remove")
    assert torch.equal(page.saved().points, SQUARE.points)
    page.keys("n", "n")
    act("y", "y")
    act("m", "mirror")
    found = page.saved()
    assert torch.equal(found.points[3], SQUARE.points[1] * torch.tensor([1.0, -1.0, 1.0]))
    act("y", "y")
    act("l", "fix")
    assert page.saved().fixed.tolist() == [False, False, False, True]
    assert page.undone(4) == page.bytes


def test_joined_closed_split_and_smoothed(page):
    page.key("a", CONTROL)
    page.key("j")
    found = page.saved()
    assert found.chains.counts.tolist() == [3]
    assert torch.equal(found.points, SQUARE.points)
    page.command("join")
    closed = page.saved()
    assert closed.chains.closed.tolist() == [True]
    assert closed.chains.counts.tolist() == [4]
    page.key("u")
    smooth = page.saved()
    points = smooth.points
    for before, after in zip(*smooth.chains.joints, strict=True):
        into, out = points[before, 3] - points[before, 2], points[after, 1] - points[after, 0]
        assert float(torch.cosine_similarity(into, out, dim=0)) > 1 - 1e-5
    page.command("split")
    assert page.saved().chains.closed.tolist() == [False]
    page.command("split")
    assert page.saved().chains.counts.tolist() == [2, 2]
    assert page.undone(5) == page.bytes


def test_ends_are_extruded_and_widths_and_colours_set(page):
    page.keys("n", "e", "ArrowUp")
    found = page.saved()
    assert found.chains.counts.tolist() == [2, 1, 1]
    assert torch.equal(found.points[1, 0], found.points[0, 3])
    torch.testing.assert_close(found.points[1, 3, 1:], torch.tensor([1 + 0.1 * 2**0.5, -1 + 0.01 * 2**0.5]))
    page.keys("]", "[")
    page.browser.value(
        "(i => { i.value = '0.05'; i.dispatchEvent(new Event('change')); })(document.getElementById('width'))"
    )
    page.browser.value(
        "(i => { i.value = '#ff0000'; i.dispatchEvent(new Event('input')); })(document.getElementById('ink'))"
    )
    found = page.saved()
    torch.testing.assert_close(found.width, torch.tensor([0.05, 0.02, 0.02]))
    assert found.color.tolist() == [[1, 0, 0], [0, 0, 0], [0, 0, 0]]
    assert page.undone(6) == page.bytes


def test_strokes_are_selected_by_box_and_keys(page):
    def chosen():
        buttons = "document.querySelectorAll('#strokes button')"
        return page.browser.value(f"[...{buttons}].map(b => b.ariaPressed === 'true')")

    page.key("b")
    page.drag(page.pixel(0.5, -1.2), page.pixel(1.2, 0.5))
    assert chosen() == [True, True, False]
    page.click(*page.pixel(0, -1))
    assert chosen() == [True, False, False]
    page.click(*page.pixel(0, 1), modifiers=SHIFT)
    assert chosen() == [True, False, True]
    page.key("Escape")
    page.key("n")
    page.key("N", SHIFT)
    assert chosen() == [True, True, False]
    page.key("h")
    page.key("]")
    shown = page.browser.value("[...document.querySelectorAll('#strokes input[type=checkbox]')].map(b => b.checked)")
    assert shown == [False, False, True]


def test_a_circle_stays_closed_and_smooth(browser, tmp_path):
    ds.save(tmp_path / "s.json", CIRCLE)
    with served(tmp_path / "s.json") as server:
        page = Page(browser, tmp_path / "s.json", server.address)
        before = page.path.read_bytes()
        page.keys("n", ".", ".", "ArrowUp", ".", "ArrowLeft")
        found = page.saved()
        assert found.chains.closed.tolist() == [True]
        assert not torch.equal(found.points, CIRCLE.points)
        assert page.undone(2) == before


def test_numbers_are_written_as_the_package_writes_them(browser, tmp_path):
    """Everything that a file can hold, and odd numbers."""
    points = torch.tensor([[[1e-5, -0.0, 1e22], [1.5e16, 123456789012345680.0, 5e-324], [0.1, 2 / 3, -1e-4]]] * 2)
    points = points.double()
    points[1, 0] = points[0, 2]
    sketch = ds.Sketch(
        points, torch.tensor([[1.0, 0.5, 1e-7]] * 2).double(), torch.full((2, 3), 0.01).double(),
        (0.1, 0.2, 0.3), 0.5, "world", ds.Chains.of([2]), torch.tensor([True]),
    )  # fmt: skip
    ds.save(tmp_path / "s.json", sketch)
    for name, one in {"odd": sketch, "plain": SQUARE, "empty": ds.Sketch(torch.zeros(0, 4, 3))}.items():
        ds.save(tmp_path / "s.json", one)
        ds.save(tmp_path / "s.html", one)
        opened(browser, (tmp_path / "s.html").as_uri())
        browser.value("HTMLAnchorElement.prototype.click = () => {}; 0")
        browser.value("URL.createObjectURL = (blob) => { window.made = blob; return 'blob:none'; }; 0")
        browser.ask("Input.dispatchKeyEvent", type="keyDown", key="s", modifiers=CONTROL)
        assert browser.value("window.made.text()") == (tmp_path / "s.json").read_text(), name


def test_two_editors_lose_nothing(page):
    other = ds.Sketch(SQUARE.points + 1, width=0.02)
    page.keys("n", "]")
    ds.save(page.path, other)
    page.key("s", CONTROL)
    page.browser.settle("!document.getElementById('notice').hidden")
    assert "has changed" in page.browser.value("document.getElementById('notice').textContent")
    assert torch.equal(ds.load(page.path).points, other.points)
    buttons = "[...document.querySelectorAll('#notice button')]"
    page.browser.value(f"{buttons}.find(b => b.textContent === 'Save a copy').click()")
    page.browser.settle("document.getElementById('notice').textContent.includes('sketch-2.json')")
    assert float(ds.load(page.path.with_name("sketch-2.json")).width[0]) > 0.02
    page.browser.value(f"{buttons}.find(b => b.textContent === 'Load anew').click()")
    page.browser.settle("document.querySelector('[data-edit=undo]').disabled")
    page.keys("Escape", "n", "Delete")
    assert torch.equal(page.saved().points, other.points[1:])
    # The server answered 412 once, as it should; the browser notes that.
    page.browser.errors[:] = [text for text in page.browser.errors if "412" not in text]


def test_what_is_edited_while_the_file_is_loaded_anew_stays(page):
    page.keys("n", "]")
    ds.save(page.path, ds.Sketch(SQUARE.points + 1, width=0.02))
    page.key("s", CONTROL)
    page.browser.settle("!document.getElementById('notice').hidden")
    page.browser.value(
        "const before = fetch; window.fetch = async (name, how) => { const answer = await before(name, how);"
        "if (name === 'sketch' && !how.method) await new Promise((go) => { window.arrive = go; }); return answer; }; 0"
    )
    page.browser.value(
        "[...document.querySelectorAll('#notice button')].find(b => b.textContent === 'Load anew').click()"
    )
    page.browser.settle("window.arrive !== undefined")
    page.key("]")
    page.browser.value("arrive(); 0")
    page.browser.settle("!document.getElementById('notice').hidden")
    assert "still here" in page.browser.value("document.getElementById('notice').textContent")
    assert not page.browser.value("document.querySelector('[data-edit=undo]').disabled")
    page.browser.errors[:] = [text for text in page.browser.errors if "412" not in text]


def test_edits_outlive_a_closed_page(browser, tmp_path):
    path = tmp_path / "sketch.json"
    ds.save(path, SQUARE)
    before = path.read_bytes()
    restore = "[...document.querySelectorAll('#notice button')].find(b => b.textContent === 'Restore them')"
    with served(path) as server:
        page = Page(browser, path, server.address)
        page.keys("n", "Delete")
        browser.ask("Page.navigate", url="about:blank")
        browser.settle("location.href === 'about:blank'")
        # A page that closes sends what it has, and does not wait for an answer.
        kept = until(lambda: list(tmp_path.glob("sketch.autosave-*.json")), "keeping")
    assert path.read_bytes() == before
    assert len(kept) == 1
    with served(path) as server:
        page = Page(browser, path, server.address)
        browser.settle(f"Boolean({restore})")
        browser.value(f"{restore}.click()")
        browser.settle("document.querySelectorAll('#strokes li').length === 2")
        assert torch.equal(page.saved().points, SQUARE.points[1:])
        browser.settle("fetch('autosaves').then(a => a.json()).then(names => names.length === 0)")
    ds.save(tmp_path / "s.html", SQUARE)
    for _ in range(2):
        opened(browser, (tmp_path / "s.html").as_uri())
        if browser.value(f"Boolean({restore})"):
            break
        browser.key("n")
        browser.key("Delete")
        browser.settle("localStorage.length > 0")
    browser.value(f"{restore}.click()")
    browser.settle("document.querySelectorAll('#strokes li').length === 2")


def test_a_touch_moves_a_handle(page):
    page.key("n")
    x, y = page.handle("Control point 1 of segment 0")
    touches = [("touchStart", [{"x": x, "y": y}]), ("touchMove", [{"x": x, "y": y - 50}]), ("touchEnd", [])]
    for kind, places in touches:
        page.browser.ask("Input.dispatchTouchEvent", type=kind, touchPoints=places)
    assert changes(SQUARE, page.saved()) == {(0, 1)}


def test_what_is_edited_has_names(page):
    page.key("n")
    nodes = page.browser.ask("Accessibility.getFullAXTree")["nodes"]
    named = {node["name"]["value"] for node in nodes if not node["ignored"] and node["role"]["value"] == "button"}
    assert {"Start", "End", "Control point 2 of segment 0", "Bend segment 0", "Move stroke"} <= named
    page.browser.value("document.getElementById('editing').open = true")
    page.key("?")
    assert page.browser.value("document.getElementById('help').checkVisibility()")
