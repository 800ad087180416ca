"""The page as one text: markup, style, scripts and data in it, and a policy that lets nothing else in."""

import base64
import hashlib
import html
import json
import re
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

# In this order they make one module.
_EDIT = ("document", "strokes", "shapes", "handles", "draw", "edit", "save")
_SCRIPTS = (
    "vectors.js", "curves.js", "camera.js", "surface/surface.js", "surface/contours.js", "surface/depth.js",
    "drawing.js", "surface/hidden.js", "detail.js", "page.js", *(f"edit/{name}.js" for name in _EDIT),
)  # fmt: skip
# Behind these, on a page with two sketches, in a frame of a notebook, on one that a server shows, on one that shows a
# run, and on one of the studio.
_BESIDE, _FRAMED, _LIVE, _RUN, _STUDIO = "beside.js", "framed.js", "live.js", "run.js", "studio/result.js"


@dataclass(frozen=True)
class Served:
    """What a page knows of the server that shows it.

    Attributes:
        version: of the sketch; it asks that server, and no other, for `version`, and when that is another one for
            `sketch`.
        page: of all else on the page, which is loaded anew when the answer to `sketch` has another one.
        run: whether the sketch is that of a run, of which it asks for `run` and its pictures.
        studio: whether it is a page of the studio, which tells `about` it and gives `download/` files.
    """

    version: str
    page: str = ""
    run: bool = False
    studio: bool = False


def page_text(
    title: str,
    sketch: str,
    start: dict[str, Any],
    served: Served | None = None,
    beside: tuple[str, str, str] | None = None,
    framed: bool = False,
    surface: str = "null",
) -> str:
    """A page that shows a sketch, on its own: it asks for nothing, and scripts that are not its own do not run in it.

    Args:
        title: of the page; any text.
        sketch: the text of a sketch.json.
        start: `middle` (3 numbers) and `radius` of a ball around the sketch, world units, and from where it is seen at
            first: `azimuth`, `elevation` and `fov`, degrees, and `filled`, the ball's share of the picture; `reach`
            says how many radii what is drawn reaches from the middle, where that is more than 1.
        served: of a page that a server shows.
        beside: title, sketch.json and surface of a second sketch, which is seen by the same camera.
        framed: whether what the page is a frame of may show other sketches on it.
        surface: what hides lines of the sketch, as JSON, or null.
    """
    room = files("diff3ds.viewer")
    style = room.joinpath("page.css").read_text(encoding="utf-8")
    names, asked = [*_SCRIPTS, *([_BESIDE] if beside else []), *([_FRAMED] if framed else [])], ""
    if served is not None:
        names += [_LIVE, *([_RUN] if served.run else []), *([_STUDIO] if served.studio else [])]
        asked = "connect-src 'self'; img-src 'self'; " if served.run else "connect-src 'self'; "
        start = {**start, "version": served.version, "page": served.page}
    script = "\n".join(room.joinpath(name).read_text(encoding="utf-8") for name in names)
    policy = (
        f"default-src 'none'; {asked}script-src {digest(script)}; style-src {digest(style)}; base-uri 'none'; "
        "form-action 'none'"
    )
    parts = {
        "policy": policy,
        "title": html.escape(title),
        "style": style,
        "script": script,
        "sketch": embedded(sketch),
        "surface": embedded(surface),
        "beside": _second(*beside) if beside else "",
        "start": embedded(json.dumps(start)),
    }
    markup = room.joinpath("page.html").read_text(encoding="utf-8")
    # In one go, so that braces of a title or a sketch stay as they are.
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], markup)


def _second(title: str, sketch: str, surface: str) -> str:
    """The element with the second sketch."""
    data = f'{{"title": {json.dumps(title)}, "sketch": {sketch}, "surface": {surface}}}'
    return f'<script type="application/json" id="beside">{embedded(data)}</script>\n'


def embedded(data: str) -> str:
    """JSON that cannot end its element: in JSON `<` only stands in strings, where it may be escaped."""
    return data.replace("<", "\\u003c")


def digest(text: str) -> str:
    """How a policy names the one inline text that it lets in."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
