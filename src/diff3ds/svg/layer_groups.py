"""Layers within layers, and as groups of an SVG file with names that Inkscape and Illustrator show."""

import html
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TypeVar

# From the outermost layer to the innermost.
Group = tuple[str, ...]
Held = TypeVar("Held")
INKSCAPE = 'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'


def grouped(layers: Sequence[str | Group] | None, strokes: Sequence[int]) -> dict[Group, list[int]]:
    """The strokes of each layer, in the order of the first of each; where there are no layers all lie in none.

    Args:
        layers: of each stroke, those that are left out too, its layer, or layers within layers.
        strokes: numbers of those that are there.
    """
    groups: dict[Group, list[int]] = {}
    for stroke in strokes:
        name = () if layers is None else layers[stroke]
        groups.setdefault((name,) if isinstance(name, str) else tuple(name), []).append(stroke)
    return groups


def check_layers(layers: Sequence[str | Group] | None, strokes: int) -> None:
    """Sees that layers are one a stroke.

    Raises:
        ValueError: they are not.
    """
    if layers is not None and len(layers) != strokes:
        raise ValueError(f"layers must name one for each of the {strokes} strokes, got {len(layers)}")


def outermost(groups: Mapping[Group, Held]) -> dict[str, dict[Group, Held]]:
    """The outermost layers and what lies in each; "" is none."""
    found: dict[str, dict[Group, Held]] = {}
    for group, held in groups.items():
        found.setdefault("".join(group[:1]), {})[group[1:]] = held
    return found


def layer_elements(
    groups: Mapping[Group, list[str]],
    prefix: str,
    attributes: str = "",
    outer: str = "layer",
    numbered: bool = False,
) -> Iterator[str]:
    """The elements of layers, and of those within them.

    Args:
        groups: the elements of each layer.
        prefix: of the ids and names of layers.
        attributes: of all of them, and of what holds elements of no layer.
        outer: what the id of the layer that holds them all ends with.
        numbered: whether names of the outermost layers begin with their numbers: programs for plotters (vpype, those
            of AxiDraw) take the first number in a name, be it that of a colour, for that of a pen.
    """
    for number, (label, inner) in enumerate(outermost(groups).items(), 1):
        if not label:
            loose = attributes and outer == "layer"
            yield from (f"<g {attributes}>", *inner[()], "</g>") if loose else inner[()]
            continue
        known = f"{outer}-{re.sub(r'[^A-Za-z0-9]+', '-', label).strip('-')}"
        shown = html.escape(f"{number} {prefix}{label}" if numbered else prefix + label)
        name = f'id="{prefix}{known}" inkscape:groupmode="layer" inkscape:label="{shown}"'
        yield f"<g {name} {attributes}>" if attributes else f"<g {name}>"
        yield from layer_elements(inner, prefix, attributes, known)
        yield "</g>"
