"""Layers within layers as groups of an SVG file, with names that Inkscape and Illustrator show."""

import html
import re
from collections.abc import Iterator, Mapping
from typing import TypeVar

# From the outermost layer to the innermost.
Group = tuple[str, ...]
Held = TypeVar("Held")
INKSCAPE = 'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'


def outermost(groups: Mapping[Group, Held]) -> dict[str, dict[Group, Held]]:
    """The outermost layers and what lies in each; "" is none."""
    found: dict[str, dict[Group, Held]] = {}
    for group, held in groups.items():
        found.setdefault("".join(group[:1]), {})[group[1:]] = held
    return found


def layer_elements(
    groups: Mapping[Group, list[str]], prefix: str, attributes: str = "", outer: str = "layer"
) -> Iterator[str]:
    """The elements of layers, and of those within them.

    Args:
        groups: the elements of each layer.
        prefix: of the ids and names of layers.
        attributes: of all of them, and of what holds elements of no layer.
        outer: what the id of the layer that holds them all ends with.
    """
    for label, inner in outermost(groups).items():
        if not label:
            loose = attributes and outer == "layer"
            yield from (f"<g {attributes}>", *inner[()], "</g>") if loose else inner[()]
            continue
        known = f"{outer}-{re.sub(r'[^A-Za-z0-9]+', '-', label).strip('-')}"
        name = f'id="{prefix}{known}" inkscape:groupmode="layer" inkscape:label="{html.escape(prefix + label)}"'
        yield f"<g {name} {attributes}>" if attributes else f"<g {name}>"
        yield from layer_elements(inner, prefix, attributes, known)
        yield "</g>"
