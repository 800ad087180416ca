"""The pictures and the film of the studio's page in the documents: what is said, drawn, dropped, made and shown.

    python benchmarks/studio_tour.py docs/pictures

A phrase, a drawing of a house stroke by stroke and a mesh become sketches in Chromium, and the page is taken on the
way. It says what one waits for: until the page answers, until the first sketch is there, until a drawing is guessed; in
seconds, and in those of the processor that all processes took, the browser included. Then studio.webp is filmed: a
phrase is typed, a person's drawing made anew point by point and corrected, and its sketch turned.
"""

import argparse
import io
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image

from diff3ds.formats.movie import save_movie

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from viewer_browser import Browser

SIZE = (1000, 760)
HOUSE = [
    [(0.3, 0.5), (0.3, 0.85), (0.7, 0.85), (0.7, 0.5), (0.3, 0.5)],
    [(0.25, 0.5), (0.5, 0.2), (0.75, 0.5)],
    [(0.45, 0.85), (0.45, 0.68), (0.55, 0.68), (0.55, 0.85)],
]
# A house of eight corners, as an OBJ file.
MESH = """v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nv 0 0 1\nv 2 0 1\nv 2 1 1\nv 0 1 1\nv 1 0 1.8\nv 1 1 1.8
f 4 3 2 1\nf 1 2 6 9 5\nf 3 4 8 10 7\nf 2 3 7 6\nf 4 1 5 8\nf 5 9 10 8\nf 6 7 10 9\n"""

PERSON = Path(__file__).parents[1] / "tests/viewer/drawn_by_a_person.json"
# Of the film: pixels, frames a second, colours, points of a stroke between two frames, frames of a turn.
FILMED, FPS, COLORS, POINTS, TURN = (760, 620), 8, 24, 9, 28
SHOW_CARDS = "document.getElementById('gallery').scrollIntoView()"


class Watch:
    """Seconds since it began, and those of the processor, of all processes of this session."""

    def __init__(self) -> None:
        self.begun, self.spent = time.perf_counter(), self._processor()

    def __str__(self) -> str:
        return f"{time.perf_counter() - self.begun:.2f} s, of processors {self._processor() - self.spent:.2f}"

    @staticmethod
    def _processor() -> float:
        ticks = 0
        for path in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = path.read_text().rpartition(")")[2].split()
            except OSError:
                continue
            # Its own time and that of its children that have ended.
            ticks += sum(map(int, fields[11:15])) if int(fields[3]) == os.getsid(0) else 0
        return ticks / os.sysconf("SC_CLK_TCK")


class Film:
    """Frames of the page; one that is held is taken once."""

    def __init__(self, browser: Any) -> None:
        self.browser, self.frames = browser, list[torch.Tensor]()

    def take(self, held: int = 1) -> None:
        """Takes the page, as it stands still for so many frames."""
        picture = Image.open(io.BytesIO(self.browser.picture(whole=True))).convert("RGB")
        few = picture.quantize(COLORS, dither=Image.Dither.NONE).convert("RGB")
        self.frames += [torch.from_numpy(np.asarray(few).copy()) / 255] * held

    def until(self, condition: str, every: float = 1.0) -> None:
        """Takes frames until something is true."""
        while not self.browser.value(condition):
            self.take()
            time.sleep(every)

    def draw(self, strokes: list[list[tuple[float, float]]]) -> None:
        """As `Browser.draw`, with frames on the way."""
        box = self.browser.value(
            "(b => [b.x, b.y, b.width])(document.getElementById('canvas').getBoundingClientRect())"
        )
        for stroke in strokes:
            places = [(box[0] + x * box[2], box[1] + y * box[2]) for x, y in stroke]
            self.browser.mouse("mousePressed", *places[0], button="left", buttons=1, clickCount=1)
            for i, place in enumerate(places):
                self.browser.mouse("mouseMoved", *place, button="left", buttons=1)
                if i % POINTS == 0:
                    self.take()
            self.browser.mouse("mouseReleased", *places[-1], button="left", clickCount=1)


def film(browser: Any, address: str, path: Path) -> None:
    """Says a chair, draws an umbrella, and turns it."""
    shot = Film(browser)
    browser.open(address, *FILMED)
    phrase = "a chair"
    for end in range(len(phrase) + 1):
        browser.value(
            f"(field => {{ field.value = {phrase[:end]!r}; field.dispatchEvent(new Event('input')); }})"
            "(document.getElementById('phrase'))"
        )
        shot.take()
    browser.settle("document.getElementById('understood').textContent.includes('chair')")
    shot.take(6)
    count = browser.value("document.querySelectorAll('[data-state=done]').length")
    browser.value("document.getElementById('panel-say').requestSubmit()")
    browser.value(SHOW_CARDS)
    shot.until(f"document.querySelectorAll('[data-state=done]').length > {count}")
    browser.settle("[...document.querySelectorAll('.face img')].every(each => each.naturalWidth === 320)")
    shot.take(8)
    browser.value("scrollTo(0, 0)")
    browser.value("document.getElementById('tab-draw').click()")
    shot.draw(
        [
            [(0.1 + x / 320, 0.1 + y / 320) for x, y, _ in zip(*s, strict=True)]
            for s in json.loads(PERSON.read_text())["strokes"]
        ]
    )
    right = "[...document.querySelectorAll('#guesses button')].find(each => each.textContent === 'an umbrella')"
    browser.settle(f"{right} !== undefined")
    shot.take(8)
    browser.value(f"{right}.click()")
    shot.take(6)
    browser.value("document.getElementById('make-drawing').click()")
    browser.settle("document.querySelector('#cards li h3').textContent === 'an umbrella'")
    browser.value(SHOW_CARDS)
    shot.until("document.querySelector('#cards li').dataset.state === 'done'")
    browser.open(browser.value("document.querySelector('#cards h3 a').href"), *FILMED)
    browser.settle("document.querySelectorAll('#desk select').length === 3")
    shot.take(4)
    browser.mouse("mousePressed", 20, 300, button="left", buttons=1, clickCount=1)
    for i in range(TURN):
        browser.mouse("mouseMoved", 20 + 12 * i, 300, button="left", buttons=1)
        shot.take()
    browser.mouse("mouseReleased", 20 + 12 * TURN, 300, button="left", clickCount=1)
    save_movie(path, shot.frames, len(shot.frames), FPS)


def taken(browser: Any, folder: Path, name: str) -> None:
    """Keeps the page as a picture of few colours."""
    picture = Image.open(io.BytesIO(browser.picture(whole=True))).convert("RGB")
    picture.quantize(64, dither=Image.Dither.NONE).save(folder / f"studio_{name}.png", optimize=True)


def done(browser: Any, count: int) -> None:
    """Waits until so many things are made, and have their pictures."""
    browser.settle(f"document.querySelectorAll('[data-state=done] .face img').length === {count}")
    browser.settle("[...document.querySelectorAll('.face img')].every(each => each.naturalWidth === 320)")


def tour(browser: Any, address: str, folder: Path, watch: Watch) -> None:
    """Goes through the page."""
    browser.open(address, *SIZE)
    print(f"the page after {watch}", flush=True)
    browser.value(
        "(field => { field.value = 'a red chair beside a tabel'; field.dispatchEvent(new Event('input')); })"
        "(document.getElementById('phrase'))"
    )
    browser.settle("document.getElementById('understood').textContent.includes('taken for')")
    taken(browser, folder, "say")
    browser.value("document.getElementById('phrase').value = 'a chair'")
    browser.value("document.getElementById('panel-say').requestSubmit()")
    browser.settle("document.querySelector('[data-state=running] progress')?.value > 50")
    browser.settle("document.querySelector('.face img')?.naturalWidth === 320")
    taken(browser, folder, "made")
    done(browser, 1)
    print(f"with what was typed before it, the first sketch after {watch}", flush=True)
    browser.value("document.getElementById('tab-draw').click()")
    for part in (HOUSE[:2], HOUSE[2:]):
        browser.value("document.getElementById('guesses').replaceChildren()")
        browser.draw(part)
        since = Watch()
        browser.settle("document.querySelectorAll('#guesses button').length > 0")
        print(f"a guess after {since}", flush=True)
    taken(browser, folder, "draw")
    browser.value("document.querySelector('#guesses button').click()")
    browser.value("document.getElementById('make-drawing').click()")
    browser.value("document.getElementById('tab-drop').click()")
    browser.value(
        f"(field => {{ const held = new DataTransfer(); held.items.add(new File([{json.dumps(MESH)}], 'house.obj')); "
        "field.files = held.files; field.dispatchEvent(new Event('change')); })(document.getElementById('file'))"
    )
    browser.settle("!document.getElementById('make-dropped').hidden")
    taken(browser, folder, "drop")
    browser.value("document.getElementById('make-dropped').click()")
    done(browser, 3)
    taken(browser, folder, "gallery")
    browser.open(browser.value("document.querySelector('#cards h3 a').href"), *SIZE)
    browser.settle("document.querySelectorAll('#desk select').length === 3")
    browser.value(
        "(([style, hatch]) => { style.value = 'pencil'; hatch.value = 'light'; "
        "style.dispatchEvent(new Event('change')); })(document.querySelectorAll('#desk select'))"
    )
    browser.settle("document.getElementById('preview').naturalWidth === 1024")
    taken(browser, folder, "sketch")


def main() -> None:
    """Makes the pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    watch = Watch()
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "diff3ds.cli", "studio", "-o", out, "--no-open", "--quiet"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            assert re.match("http://", address), address
            browser = Browser()
            try:
                tour(browser, address, folder, watch)
                film(browser, address, folder / "studio.webp")
            finally:
                browser.close()
        finally:
            process.terminate()
            process.wait(90)


if __name__ == "__main__":
    main()
