"""Times of frames of the page of .html files in headless Chromium, drawn by its software renderer.

    python benchmarks/page.py [--strokes 112 1000 5000] [--size 900x700] [--moves 40] [--surface MESH]

While a pointer turns the sketch, and while it drags a control point of one stroke: milliseconds from frame to frame,
median and 95th percentile, and of each frame how much JavaScript takes, and all processes of the browser together. The
page gives a frame that moves 30 ms, and draws more samples a pixel where they leave time. On a loaded machine processor
time is what counts.
"""

import argparse
import statistics
import sys
import tempfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import torch

import diff3ds as ds

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from viewer_browser import Browser

RECORD = """window.frameTimes = [];
(function each(now) {
  window.frameTimes.push(now);
  window.isOver || requestAnimationFrame(each);
})(performance.now());"""


def seconds_of(browser: Any) -> tuple[float, float]:
    """What JavaScript, and all processes of the browser, have taken so far."""
    metrics = {metric["name"]: metric["value"] for metric in browser.ask("Performance.getMetrics")["metrics"]}
    # The whole browser is asked without the session of its page.
    session, browser.session = browser.session, None
    processes = browser.ask("SystemInfo.getProcessInfo")["processInfo"]
    browser.session = session
    return float(metrics["ScriptDuration"]), sum(process["cpuTime"] for process in processes)


def dragged(browser: Any, start: tuple[float, float], moves: int) -> str:
    """What a drag from a place takes, a frame."""
    browser.mouse("mousePressed", *start, button="left", buttons=1, clickCount=1)
    browser.value(f"window.isOver = false; {RECORD}")
    before = seconds_of(browser)
    place = start
    for i in range(moves):
        place = (start[0] + 40 - abs(40 - 2 * i % 80), start[1] + i % 20)
        browser.mouse("mouseMoved", *place, button="left", buttons=1)
    script, processor = (now - then for now, then in zip(seconds_of(browser), before, strict=True))
    times = browser.value("window.isOver = true; window.frameTimes")
    browser.mouse("mouseReleased", *place, button="left", clickCount=1)
    each = sorted(later - earlier for earlier, later in pairwise(times))
    return (
        f"{statistics.median(each):6.0f} ms, p95 {each[int(0.95 * (len(each) - 1))]:6.0f}, "
        f"JavaScript {1000 * script / len(each):5.1f}, processor {1000 * processor / len(each):5.0f} ms a frame"
    )


def main() -> None:
    """Measures what the command line asks for, and prints it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strokes", type=int, nargs="+", default=[112, 1000, 5000])
    parser.add_argument("--size", default="900x700")
    parser.add_argument("--moves", type=int, default=40)
    parser.add_argument("--surface", type=Path)
    options = parser.parse_args()
    width, height = map(int, options.size.split("x"))
    surface = None if options.surface is None else ds.load_surface(options.surface)
    browser = Browser()
    browser.ask("Performance.enable")
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    browser.ask("Emulation.setDeviceMetricsOverride", **size)
    middle = "(b => [b.x + b.width / 2, b.y + b.height / 2])"
    with tempfile.TemporaryDirectory() as folder:
        for count in options.strokes:
            path = Path(folder) / "page.html"
            ds.save(path, ds.Sketch.random(count, generator=torch.Generator().manual_seed(0)), surface=surface)
            browser.ask("Page.navigate", url=path.as_uri())
            browser.settle(f"document.querySelectorAll('#strokes li').length === {count}")
            turning = dragged(browser, (30, 30), options.moves)
            print(f"{count:5} strokes, {path.stat().st_size / 1e6:.2f} MB: turning {turning}", flush=True)
            for key in ("n", "."):
                pressed = f"new KeyboardEvent('keydown', {{key: '{key}', bubbles: true}})"
                browser.value(f"document.getElementById('view').dispatchEvent({pressed})")
            end = browser.value(
                f"{middle}(document.querySelector('#handles [aria-label=End]').getBoundingClientRect())"
            )
            print(f"{'':15} dragging a control point {dragged(browser, tuple(end), options.moves)}", flush=True)
    browser.close()


if __name__ == "__main__":
    main()
