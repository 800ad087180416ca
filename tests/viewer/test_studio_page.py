"""The studio's page in a real browser: what is said, drawn and dropped there becomes sketches that are shown."""

import base64
import io
import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
import torch
from served_page import served_studio
from viewer_browser import CHROMIUM, COARSE
from waiting import until

import diff3ds as ds
from diff3ds.library import member

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium (Debian: apt-get install chromium)"),
    pytest.mark.xdist_group("browser"),
]
HOUSE = [
    [(0.3, 0.5), (0.3, 0.85), (0.7, 0.85), (0.7, 0.5), (0.3, 0.5)],
    [(0.25, 0.5), (0.5, 0.2), (0.75, 0.5)],
    [(0.45, 0.85), (0.45, 0.68), (0.55, 0.68), (0.55, 0.85)],
]


def text_of(browser, element: str) -> str:
    return browser.value(f"document.getElementById('{element}').textContent")


def say(browser, phrase: str) -> None:
    browser.value(
        f"(field => {{ field.value = {json.dumps(phrase)}; field.dispatchEvent(new Event('input')); }})"
        "(document.getElementById('phrase'))"
    )


def drop(browser, name: str, content: str | bytes) -> None:
    """As the file field gives it."""
    held = base64.b64encode(content.encode() if isinstance(content, str) else content).decode()
    browser.value(
        f"(field => {{ const held = new DataTransfer(), bytes = Uint8Array.from(atob({json.dumps(held)}), "
        f"each => each.charCodeAt(0)); held.items.add(new File([bytes], {json.dumps(name)})); "
        "field.files = held.files; field.dispatchEvent(new Event('change')); })(document.getElementById('file'))"
    )


def test_what_is_said_and_drawn_is_understood_on_the_way(browser, tmp_path):
    with served_studio(tmp_path) as server:
        browser.open(server.address, 1000, 900, COARSE)
        assert not browser.value("document.getElementById('nothing').hidden")
        say(browser, "two chiars beside a table")
        browser.settle("document.getElementById('understood').textContent.includes('table')")
        assert "'chiars' is taken for 'chairs'" in text_of(browser, "understood")
        say(browser, "a xylophone")
        browser.settle("document.getElementById('understood').classList.contains('refused')")
        # Few words, and all of them where one asks why.
        assert text_of(browser, "understood").startswith("I do not know this yet.Why'a xylophone'")
        assert not browser.value("document.querySelector('#understood details').open")
        say(browser, "a giraffe with a scarf")
        browser.settle("document.querySelector('#understood button') !== null")
        browser.value("document.querySelector('#understood button').click()")
        browser.settle("document.getElementById('understood').textContent === 'That is a dinosaur.'")
        # By keys alone from one way to the next.
        browser.value("document.getElementById('tab-say').focus()")
        browser.key("ArrowRight")
        assert browser.value("document.activeElement.id") == "tab-draw"
        assert browser.value("document.getElementById('panel-say').hidden")
        browser.draw(HOUSE)
        browser.settle("[...document.querySelectorAll('#guesses button')].some(b => b.textContent.includes('house'))")
        browser.value("document.querySelectorAll('#guesses button')[1].click()")
        pressed = "[...document.querySelectorAll('#guesses button')].map(b => b.getAttribute('aria-pressed'))"
        assert browser.value(pressed) == ["false", "true", "false"]
        chosen = browser.value("document.querySelectorAll('#guesses button')[1].textContent")
        browser.value("document.getElementById('make-drawing').click()")
        browser.settle("document.querySelector('#cards li') !== null")
        (entry,) = server.line.entries()
        assert (entry.title, entry.command, entry.options["shows"]) == (chosen, "image", chosen)
        assert browser.value("document.getElementById('make-drawing').disabled")
        # Nothing is asked but of this server, and nothing is wrong.
        icon = server.address.replace(f"{server.secret}/", "favicon.ico")
        allowed = (server.address, "data:image/png", icon)
        assert not [address for address in browser.requests if not address.startswith(allowed)]
        assert not browser.errors


def test_what_is_dropped_is_named_shown_searched_for_and_deleted(browser, tmp_path):
    ds.save(tmp_path / "mine.json", ds.Sketch(torch.arange(18.0).reshape(3, 2, 3).sin()))
    with served_studio(tmp_path) as server:
        browser.open(server.address, 1000, 900, COARSE)
        browser.value("document.getElementById('tab-drop').click()")
        drop(browser, "letter.docx", "x")
        browser.settle("document.getElementById('dropped').classList.contains('refused')")
        assert "is nothing that can be drawn here" in text_of(browser, "dropped")
        drop(browser, "mine.json", (tmp_path / "mine.json").read_text())
        browser.settle("!document.getElementById('make-dropped').hidden")
        assert text_of(browser, "dropped") == "mine: a sketch."
        browser.value("document.getElementById('make-dropped').click()")
        browser.settle("document.querySelector('#cards .face img')?.naturalWidth === 320")
        server.line.add("a <b>chair</b>", "text", {"phrase": "a chair"})
        browser.settle("document.querySelectorAll('#cards li').length === 2")
        titles = "[...document.querySelectorAll('#cards h3')].map(each => each.textContent)"
        assert browser.value(titles) == ["a <b>chair</b>", "mine"]
        assert browser.value("document.querySelector('#cards .state').textContent") == "Waiting in line"
        browser.value("document.querySelector('#cards button').click()")
        browser.settle("document.querySelector('#cards .state').textContent === 'Stopped'")
        browser.value(
            "(s => { s.value = 'MINE'; s.dispatchEvent(new Event('input')); })(document.getElementById('search'))"
        )
        assert browser.value(titles) == ["mine"]
        remove = "[...document.querySelectorAll('#cards button')].find(b => /elete/.test(b.textContent)).click()"
        browser.value(remove)
        assert browser.value("[...document.querySelectorAll('#cards button')].at(-1).textContent") == "Really delete?"
        assert server.line.entry("mine") is not None
        browser.value(remove)
        browser.settle("document.querySelectorAll('#cards li').length === 0")
        assert server.line.entry("mine") is None
        assert not [error for error in browser.errors if "400" not in error]


def zipped(names: dict[str, bytes]) -> bytes:
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w") as archive:
        for name, content in names.items():
            archive.writestr(name, content)
    return held.getvalue()


@pytest.mark.parametrize("width", [pytest.param(390, marks=pytest.mark.slow), 1000])
def test_seven_kinds_of_file_are_named_and_wait_in_line(browser, tmp_path, width):
    """A picture, a mesh, a cloud, a solid, photographs, photographs with COLMAP's cameras, and a sketch."""
    chair = member("chair", torch.Generator().manual_seed(0)).sketch
    ds.save(tmp_path / "chair.png", chair, ds.orbit(30.0, 20.0, size=64))
    ds.save(tmp_path / "chair.json", chair)
    picture = (tmp_path / "chair.png").read_bytes()
    photographs = {f"trip/{k}.jpg": picture for k in range(3)}
    poses = "".join(f"{k + 1} 1 0 0 0 0 0 {k + 3} 1 {k}.jpg\n\n" for k in range(3)).encode()
    cameras = {"cameras.txt": b"1 PINHOLE 64 64 70 70 32 32\n", "images.txt": poses, "points3D.txt": b""}
    colmap = {f"images/{k}.jpg": picture for k in range(3)} | {f"sparse/0/{n}": text for n, text in cameras.items()}
    dropped = {
        "chair.png": (picture, "a picture", "image"),
        "corner.obj": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n", "a mesh", "mesh"),
        "scan.xyz": ("0 0 0\n1 0 0\n0 1 0\n", "a cloud of points", "points"),
        "plate.step": ("ISO-10303-21; ADVANCED_FACE", "solids", "mesh"),
        "trip.zip": (zipped(photographs), "3 photographs of one thing", "views"),
        "project.zip": (zipped(colmap), "3 photographs of one thing", "views"),
        "mine.json": ((tmp_path / "chair.json").read_bytes(), "a sketch", ""),
    }
    with served_studio(tmp_path / "out") as server:
        browser.open(server.address, width, 900, COARSE)
        browser.value("document.getElementById('tab-drop').click()")
        for name, (content, what, command) in dropped.items():
            drop(browser, name, content)
            browser.settle(f"document.getElementById('dropped').textContent.includes({json.dumps(what)})")
            browser.settle("!document.getElementById('make-dropped').hidden")
            before = {entry.name for entry in server.line.entries()}
            browser.value("document.getElementById('make-dropped').click()")
            browser.settle(f"document.querySelectorAll('#cards li').length === {len(before) + 1}")
            (made,) = (entry for entry in server.line.entries() if entry.name not in before)
            assert made.command == command, name
        assert not browser.errors


@pytest.mark.parametrize("width", [390, pytest.param(820, marks=pytest.mark.slow), 2560])
def test_every_screen_shows_all_of_it(browser, tmp_path, width):
    with served_studio(tmp_path) as server:
        server.line.add("a chair with a very long name " * 3, "text", {"phrase": "a chair"})
        browser.open(server.address, width, 800, COARSE)
        for tab in ("say", "draw", "drop"):
            browser.value(f"document.getElementById('tab-{tab}').click()")
            assert browser.value("document.documentElement.scrollWidth") <= width
        # Whatever can be used has a name, and a finger's size.
        small = browser.value(
            "[...document.querySelectorAll('button, input:not([type=file]), a:not(.face)')]"
            ".filter(each => each.offsetParent && each.getBoundingClientRect().height < 24).map(each => each.outerHTML)"
        )
        assert small == []
        tree = browser.ask("Accessibility.getFullAXTree")["nodes"]
        roles = ("button", "textbox", "searchbox", "tab", "link")
        named = [node.get("name", {}).get("value") for node in tree if node.get("role", {}).get("value") in roles]
        assert named
        assert all(named)


def test_a_result_is_dark_where_the_system_is(browser, tmp_path):
    ds.save(tmp_path / "mine.json", ds.Sketch(torch.arange(18.0).reshape(3, 2, 3).sin()))
    with served_studio(tmp_path / "out") as server:
        server.line.put("mine", lambda folder: ds.save(folder / "sketch.json", ds.load(tmp_path / "mine.json")))
        dark = "document.documentElement.classList.contains('dark')"
        ground = "getComputedStyle(document.body).backgroundColor"
        try:
            browser.prefer("dark")
            browser.open(server.address, 1000, 900, COARSE)
            assert browser.value(ground) == "rgb(21, 23, 27)"
            browser.open(f"{server.address}runs/mine/", 1000, 900, COARSE)
            assert browser.value(dark)
            browser.prefer("light")
            browser.settle(f"!{dark}")
            assert browser.value(ground) == "rgb(255, 255, 255)"
        finally:
            browser.prefer("light")


@pytest.mark.slow
def test_a_persons_drawing_is_corrected_made_and_saved_in_six_formats(browser, tmp_path):
    drawing = json.loads(Path(__file__).with_name("drawn_by_a_person.json").read_text())
    # Point by point, as it was recorded, in the middle of the canvas.
    strokes = [
        [(0.1 + x / 320, 0.1 + y / 320) for x, y in zip(*stroke[:2], strict=True)] for stroke in drawing["strokes"]
    ]
    with served_studio(tmp_path / "out") as server, server.line:
        browser.open(server.address, 1000, 900)
        browser.value("document.getElementById('tab-draw').click()")
        browser.draw(strokes)
        names = "[...document.querySelectorAll('#guesses button')].map(each => each.textContent)"
        browser.settle(f"{names}.includes('an umbrella')")
        guesses = browser.value(names)
        assert guesses[0] != "an umbrella"
        browser.value(f"document.querySelectorAll('#guesses button')[{guesses.index('an umbrella')}].click()")
        browser.value("document.getElementById('make-drawing').click()")
        browser.settle("document.querySelector('[data-state=done]') !== null")
        (entry,) = server.line.entries()
        assert entry.options["shows"] == "an umbrella"
        browser.open(browser.value("document.querySelector('#cards h3 a').href"), 1000, 900)
        browser.settle("document.querySelectorAll('#desk select').length === 3")
        saved = tmp_path / "saved"
        saved.mkdir()
        browser.keep_downloads(saved)
        for key, suffix in (
            ("svg", "svg"),
            ("pdf", "pdf"),
            ("step", "step"),
            ("dxf", "dxf"),
            ("3dm", "3dm"),
            ("glb", "glb"),
        ):
            browser.value(
                f"(([, , format]) => {{ format.value = '{key}'; format.dispatchEvent(new Event('change')); }})"
                "(document.querySelectorAll('#desk select'));"
                "[...document.querySelectorAll('#desk button')].find(b => b.textContent === 'Save').click()"
            )
            until((saved / f"an-umbrella.{suffix}").is_file, f"saving {suffix}")
        assert_read_by_others(saved, ds.load(tmp_path / "out/an-umbrella/sketch.json"))
        assert not browser.errors


def assert_read_by_others(folder: Path, sketch: ds.Sketch) -> None:
    """Each file is read by a program that is not ours, and holds the sketch."""
    import ezdxf
    import pypdfium2
    import rhino3dm
    import trimesh
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopExp import TopExp_Explorer
    from svgpathtools import svg2paths

    def file(suffix: str) -> str:
        return str(folder / f"an-umbrella.{suffix}")

    count = len(sketch)
    assert len(svg2paths(file("svg"))[0]) > 3
    assert np.asarray(pypdfium2.PdfDocument(file("pdf"))[0].render(scale=1).to_pil().convert("L")).min() < 100
    reader, edges = STEPControl_Reader(), 0
    reader.ReadFile(file("step"))
    reader.TransferRoots()
    explorer = TopExp_Explorer(reader.OneShape(), TopAbs_EDGE)
    while explorer.More():
        edges += 1
        explorer.Next()
    assert edges >= count
    assert len(ezdxf.readfile(file("dxf")).modelspace()) >= count
    assert len(rhino3dm.File3dm.Read(file("3dm")).Objects) >= count
    low, high = trimesh.load(file("glb"), force="mesh").bounds
    places = ds.bezier.evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 33)).flatten(0, 1)
    # Y is up in GLB files; wires are thicker than their lines.
    extents = (places.amax(0) - places.amin(0))[[1, 2, 0]].numpy()
    assert np.allclose(high - low, extents, atol=0.1)


@pytest.mark.slow
def test_what_is_stopped_goes_on_from_where_it_was(browser, tmp_path):
    with served_studio(tmp_path) as server, server.line:
        browser.open(server.address, 390, 900)
        server.line.add("a chair", "text", {"phrase": "a chair", "steps": 3000})
        checkpoint = tmp_path / "a-chair/checkpoint.safetensors"
        browser.settle("document.querySelector('[data-state=running]') !== null")
        number = "+(/([0-9]+) of 3000/.exec(document.querySelector('#cards .state').textContent)?.[1] ?? 0)"
        browser.settle(f"{number} > 100")
        press = "[...document.querySelectorAll('#cards button')].find(b => b.textContent === '{}').click()"
        browser.value(press.format("Stop"))
        browser.settle("document.querySelector('[data-state=stopped]') !== null")
        assert checkpoint.exists()
        browser.value(press.format("Go on"))
        browser.settle(f"{number} > 0")
        assert browser.value(number) > 100


@pytest.mark.slow
def test_from_a_phrase_to_files_of_its_sketch(browser, tmp_path):
    from svgpathtools import svg2paths

    with served_studio(tmp_path) as server, server.line:
        browser.open(server.address, 1000, 900)
        say(browser, "a chair")
        browser.value("document.getElementById('panel-say').requestSubmit()")
        browser.settle("document.querySelector('[data-state=running]') !== null")
        browser.settle("document.querySelector('[data-state=done]') !== null")
        browser.settle("document.querySelector('#cards .face img')?.naturalWidth === 320")
        browser.open(browser.value("document.querySelector('#cards h3 a').href"), 1000, 900)
        browser.settle("document.querySelectorAll('#desk select').length === 3")
        # The file is of the view that the page shows, and looks like it.
        browser.value("window.saved = []; URL.createObjectURL = blob => { saved.push(blob); return '#'; }")
        for key in ("svg", "step", "dxf", "glb", "html", "json"):
            count = browser.value("saved.length")
            browser.value(
                f"(([, , format]) => {{ format.value = '{key}'; format.dispatchEvent(new Event('change')); }})"
                "(document.querySelectorAll('#desk select'));"
                "[...document.querySelectorAll('#desk button')].find(b => b.textContent === 'Save').click()"
            )
            browser.settle(f"window.saved.length === {count + 1}")
        texts = browser.value("Promise.all([0, 1, 2, 4, 5].map(i => saved[i].text()))")
        (tmp_path / "seen.svg").write_text(texts[0])
        assert len(svg2paths(str(tmp_path / "seen.svg"))[0]) > 5
        assert texts[1].startswith("ISO-10303-21;")
        assert "ENTITIES" in texts[2]
        assert texts[3].startswith("<!doctype html>")
        assert texts[4] == (tmp_path / "a-chair/sketch.json").read_text()
        browser.value("[...document.querySelectorAll('#desk button')].find(b => b.textContent === 'Look').click()")
        browser.settle("document.querySelector('dialog[open] img')?.naturalWidth === 1024")
        # What is chosen is shown at once.
        browser.value("document.querySelector('dialog[open]').close()")
        assert browser.value("document.getElementById('preview').hidden")
        browser.value(
            "(([style, hatch]) => { style.value = 'ink'; hatch.value = 'light'; "
            "style.dispatchEvent(new Event('change')); })(document.querySelectorAll('#desk select'))"
        )
        browser.settle("document.getElementById('preview').naturalWidth === 1024")
        assert "shadows by light" in browser.value("document.getElementById('preview').alt")
        assert not browser.errors
        # Drawn anew from its own strokes.
        browser.value("[...document.querySelectorAll('#desk button')].find(b => /again/.test(b.textContent)).click()")
        entry = server.line.entry
        again = until(lambda: (made := entry("a-chair-again")) and made.state == "done" and made, "drawing it again")
        assert again.options["start"] == "a-chair/sketch.json"
