"""The page of the studio as one text: markup, style and scripts in it, and a policy that lets nothing else in."""

import functools
import re
from importlib.resources import files

from diff3ds.viewer.page import digest

# In this order they make one module.
_SCRIPTS = ("studio.js", "say.js", "draw.js", "drop.js", "gallery.js")


@functools.cache
def studio_page() -> str:
    """A page that asks the server that shows it, and no other."""
    room = files("diff3ds.viewer").joinpath("studio")
    style = room.joinpath("studio.css").read_text(encoding="utf-8")
    script = "\n".join(room.joinpath(name).read_text(encoding="utf-8") for name in _SCRIPTS)
    policy = (
        f"default-src 'none'; connect-src 'self'; img-src 'self' data:; script-src {digest(script)}; "
        f"style-src {digest(style)}; base-uri 'none'; form-action 'none'"
    )
    parts = {"policy": policy, "style": style, "script": script}
    markup = room.joinpath("studio.html").read_text(encoding="utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], markup)
