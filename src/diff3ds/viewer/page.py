"""The page as one text: markup, style, scripts and data in it, and a policy that lets nothing else in."""

import base64
import hashlib
import html
import json
import re
from importlib.resources import files
from typing import Any

# In this order they make one module.
_SCRIPTS = ("curves.js", "camera.js", "drawing.js", "page.js")
# Behind these, on a page that a server shows.
_LIVE = "live.js"


def page_text(title: str, sketch: str, start: dict[str, Any], version: str | None = None) -> str:
    """A page that shows a sketch, on its own: it asks for nothing, and scripts that are not its own do not run in it.

    Args:
        title: of the page; any text.
        sketch: the text of a sketch.json.
        start: `middle` (3 numbers) and `radius` of a ball around the sketch, world units, and from where it is seen at
            first: `azimuth`, `elevation` and `fov`, degrees, and `filled`, the ball's share of the picture.
        version: of a page that a server shows: it asks that server, and no other, for `version`, and is loaded anew
            when the answer is another one.
    """
    room = files("diff3ds.viewer")
    style = room.joinpath("page.css").read_text(encoding="utf-8")
    names = _SCRIPTS if version is None else (*_SCRIPTS, _LIVE)
    script = "\n".join(room.joinpath(name).read_text(encoding="utf-8") for name in names)
    asked = "" if version is None else "connect-src 'self'; "
    policy = (
        f"default-src 'none'; {asked}script-src {_digest(script)}; style-src {_digest(style)}; base-uri 'none'; "
        "form-action 'none'"
    )
    parts = {
        "policy": policy,
        "title": html.escape(title),
        "style": style,
        "script": script,
        "sketch": _embedded(sketch),
        "start": _embedded(json.dumps(start if version is None else {**start, "version": version})),
    }
    markup = room.joinpath("page.html").read_text(encoding="utf-8")
    # In one go, so that braces of a title or a sketch stay as they are.
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], markup)


def _embedded(data: str) -> str:
    """JSON that cannot end its element: in JSON `<` only stands in strings, where it may be escaped."""
    return data.replace("<", "\\u003c")


def _digest(text: str) -> str:
    """How a policy names the one inline text that it lets in."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
