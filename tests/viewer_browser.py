"""Chromium without a window, driven by the DevTools protocol through a pipe; no package is needed for that."""

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = (
    "--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader", "--remote-debugging-pipe", "--hide-scrollbars",
    "--no-first-run", "--disable-extensions", "--disable-background-networking", "--force-color-profile=srgb",
)  # fmt: skip
# Seconds for anything the browser is asked for: software rendering on a machine where each process gets a tenth.
PATIENCE = 300
# Of a window whose pictures show more than most tests ask of them, and take twice the time.
LARGE = {"width": 660, "height": 260}
# Pixels of the screen to one of CSS where nobody looks at the picture: a sixteenth is drawn, and the mouse stays where
# it is.
COARSE = 0.25
# When what was drawn last is on the screen.
SHOWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))"


class Browser:
    """One page of Chromium. `requests` are the addresses it asked for, `errors` what its console complained of."""

    def __init__(self) -> None:
        assert CHROMIUM is not None
        self.profile = tempfile.mkdtemp()
        read_commands, self.commands = os.pipe()
        self.answers, write_answers = os.pipe()

        def place() -> None:
            # The browser reads commands from descriptor 3 and writes answers to 4; each may be the other's now.
            first, second = os.dup(read_commands), os.dup(write_answers)
            os.dup2(first, 3)
            os.dup2(second, 4)

        self.process = subprocess.Popen(
            [CHROMIUM, *FLAGS, f"--user-data-dir={self.profile}", "about:blank"],
            preexec_fn=place, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(read_commands)
        os.close(write_answers)
        self.count, self.unread, self.session = 0, b"", None
        self.requests: list[str] = []
        self.errors: list[str] = []
        (target,) = [t for t in self.ask("Target.getTargets")["targetInfos"] if t["type"] == "page"]
        self.session = self.ask("Target.attachToTarget", targetId=target["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(f"{domain}.enable")

    def ask(self, method: str, **parameters: Any) -> Any:
        self.count += 1
        message = {"id": self.count, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.commands, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._read()
            if answer.get("id") == self.count:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]

    def _read(self) -> Any:
        while b"\0" not in self.unread:
            assert select.select([self.answers], [], [], PATIENCE)[0], "the browser does not answer"
            part = os.read(self.answers, 1 << 20)
            assert part, "the browser has ended"
            self.unread += part
        first, self.unread = self.unread.split(b"\0", 1)
        message = json.loads(first)
        self._note(message.get("method"), message.get("params", {}))
        return message

    def _note(self, method: str | None, parameters: Any) -> None:
        if method == "Network.requestWillBeSent":
            self.requests.append(parameters["request"]["url"])
        elif method == "Runtime.exceptionThrown":
            self.errors.append(json.dumps(parameters["exceptionDetails"]))
        elif method == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning"):
            self.errors.append(json.dumps(parameters["args"]))
        elif method == "Log.entryAdded" and parameters["entry"]["level"] in ("error", "warning"):
            text = parameters["entry"]["text"]
            # Taking a screenshot reads the canvas back, which software rendering minds.
            self.errors += [text] if "GPU stall due to ReadPixels" not in text else []

    def open(self, address: str, width: int = 440, height: int = 180, scale: float = 1) -> None:
        """Shows a page, of this many CSS pixels, and waits until it is drawn."""
        # The page before may still ask its server for something.
        self.ask("Page.navigate", url="about:blank")
        self.requests.clear()
        self.errors.clear()
        self.ask(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale, mobile=False
        )
        self.ask("Page.navigate", url=address)
        self.settle()

    def value(self, expression: str) -> Any:
        """What an expression of JavaScript is worth on the page."""
        found = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def settle(self, condition: str = "document.querySelector('[data-settled]') !== null") -> None:
        end = time.monotonic() + PATIENCE
        while not self.value(condition):
            assert time.monotonic() < end, f"{condition} does not come true; errors: {self.errors}"
            time.sleep(0.05)

    def key(self, key: str) -> None:
        self.ask("Input.dispatchKeyEvent", type="keyDown", key=key, text=key if len(key) == 1 else "")
        self.ask("Input.dispatchKeyEvent", type="keyUp", key=key)
        self.settle()

    def mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        self.ask("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        self.mouse("mousePressed", *start, button="left", buttons=1, clickCount=1)
        self.mouse("mouseMoved", *end, button="left", buttons=1)
        self.mouse("mouseReleased", *end, button="left", clickCount=1)
        self.settle()

    def draw(self, strokes: list[list[tuple[float, float]]], element: str = "canvas") -> None:
        """Lines by the mouse on an element, point by point, as fractions of its width from its upper left corner."""
        box = self.value(f"(b => [b.x, b.y, b.width])(document.getElementById('{element}').getBoundingClientRect())")
        for stroke in strokes:
            places = [(box[0] + x * box[2], box[1] + y * box[2]) for x, y in stroke]
            self.mouse("mousePressed", *places[0], button="left", buttons=1, clickCount=1)
            for place in places[1:]:
                self.mouse("mouseMoved", *place, button="left", buttons=1)
            self.mouse("mouseReleased", *places[-1], button="left", clickCount=1)

    def keep_downloads(self, folder: Path) -> None:
        """What pages save goes into this folder."""
        self.ask("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(folder))

    def prefer(self, scheme: str) -> None:
        """The colours that the system wishes: "light" or "dark"."""
        self.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def canvas_box(self) -> dict[str, float]:
        box = "(b => ({x: b.x, y: b.y, width: b.width, height: b.height}))"
        return self.value(f"{box}(document.querySelector('canvas').getBoundingClientRect())")

    def picture(self, whole: bool = False) -> bytes:
        """A PNG of the canvas, or of the whole page."""
        assert self.value(SHOWN)
        clip = {} if whole else {"clip": {**self.canvas_box(), "scale": 1}}
        return base64.b64decode(self.ask("Page.captureScreenshot", format="png", **clip)["data"])

    def close(self) -> None:
        self.process.terminate()
        self.process.wait(PATIENCE)
        os.close(self.commands)
        os.close(self.answers)
        shutil.rmtree(self.profile, ignore_errors=True)

    def save(self, path: str | Path, whole: bool = True) -> None:
        Path(path).write_bytes(self.picture(whole))
