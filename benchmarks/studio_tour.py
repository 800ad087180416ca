"""The pictures of the studio's page in the documents: what is said, drawn, dropped, made and shown, in Chromium.

    python benchmarks/studio_tour.py docs/pictures

A phrase, a drawing of a house stroke by stroke and a mesh become sketches, and the page is taken on the way. It says
what one waits for: until the page answers, until the first sketch is there, until a drawing is guessed.
"""

import argparse
import io
import json
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from PIL import Image

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


def taken(browser: Any, folder: Path, name: str) -> None:
    """Keeps the page as a picture of few colours."""
    picture = Image.open(io.BytesIO(browser.picture(whole=True))).convert("RGB")
    picture.quantize(64, dither=Image.Dither.NONE).save(folder / f"studio_{name}.png", optimize=True)


def done(browser: Any, count: int) -> None:
    """Waits until so many things are made, and have their pictures."""
    browser.settle(f"document.querySelectorAll('[data-state=done] .face img').length === {count}")
    browser.settle("[...document.querySelectorAll('.face img')].every(each => each.naturalWidth === 320)")


def tour(browser: Any, address: str, folder: Path, begun: float) -> None:
    """Goes through the page."""
    browser.open(address, *SIZE)
    print(f"the page after {time.perf_counter() - begun:.1f} s", flush=True)
    browser.value(
        "(field => { field.value = 'a red chair beside a tabel'; field.dispatchEvent(new Event('input')); })"
        "(document.getElementById('phrase'))"
    )
    browser.settle("document.getElementById('understood').textContent.includes('taken for')")
    taken(browser, folder, "say")
    browser.value("document.getElementById('phrase').value = 'a chair'")
    browser.value("document.getElementById('panel-say').requestSubmit()")
    browser.settle("document.querySelector('[data-state=running] progress')?.value > 200")
    browser.settle("document.querySelector('.face img')?.naturalWidth === 320")
    taken(browser, folder, "made")
    done(browser, 1)
    print(f"the first sketch after {time.perf_counter() - begun:.1f} s, the browser included", flush=True)
    browser.value("document.getElementById('tab-draw').click()")
    for part in (HOUSE[:2], HOUSE[2:]):
        browser.value("document.getElementById('guesses').replaceChildren()")
        browser.draw(part)
        since = time.perf_counter()
        browser.settle("document.querySelectorAll('#guesses button').length > 0")
        print(f"a guess after {time.perf_counter() - since:.2f} s", flush=True)
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
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "diff3ds.cli", "studio", "-o", out, "--no-open", "--quiet"]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            assert re.match("http://", address), address
            browser = Browser()
            try:
                tour(browser, address, folder, begun)
            finally:
                browser.close()
        finally:
            process.terminate()
            process.wait(90)


if __name__ == "__main__":
    main()
