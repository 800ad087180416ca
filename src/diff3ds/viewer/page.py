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


def page_text(title: str, sketch: str, start: dict[str, Any]) -> str:
    """A page that shows a sketch, on its own: it asks for nothing, and scripts that are not its own do not run in it.

    Args:
        title: of the page; any text.
        sketch: the text of a sketch.json.
        start: `middle` (3 numbers) and `radius` of a ball around the sketch, world units, and from where it is seen at
            first: `azimuth`, `elevation` and `fov`, degrees, and `filled`, the ball's share of the picture.
    """
    room = files("diff3ds.viewer")
    style = room.joinpath("page.css").read_text(encoding="utf-8")
    script = "\n".join(room.joinpath(name).read_text(encoding="utf-8") for name in _SCRIPTS)
    policy = (
        f"default-src 'none'; script-src {_digest(script)}; style-src {_digest(style)}; base-uri 'none'; "
        "form-action 'none'"
    )
    parts = {
        "policy": policy,
        "title": html.escape(title),
        "style": style,
        "script": script,
        "sketch": _embedded(sketch),
        "start": _embedded(json.dumps(start)),
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
