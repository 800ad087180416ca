"""The layers on which strokes lie in files for CAD programs, and in Blender."""

from collections.abc import Sequence

from diff3ds.page.sheet.views_grid import hexadecimal
from diff3ds.sketch import Sketch

# Characters that names of layers may not have in DXF files.
FORBIDDEN = str.maketrans("", "", '<>/\\":;?*|,=`')


def color_layers(sketch: Sketch) -> list[str]:
    """A layer a colour, named by it."""
    colors = (sketch.color.detach().double().clamp(0, 1) * 255).round().int().tolist()
    return ["COLOR_{:02X}{:02X}{:02X}".format(*color) for color in colors]


def flat_layers(layers: Sequence[tuple[str, ...]] | None) -> list[str] | None:
    """Layers within layers as layers of formats that have none: "lamp - crease"."""
    return None if layers is None else [" - ".join(group) or "strokes" for group in layers]


def checked_layers(layers: Sequence[str] | None, sketch: Sketch) -> list[str] | None:
    """The layers that a caller has named, without the characters that CAD programs do not take.

    Raises:
        ValueError: they are not one a stroke, or one has no name.
    """
    if layers is None:
        return None
    if len(layers) != len(sketch):
        raise ValueError(f"layers must be one a stroke, {len(sketch)}, got {len(layers)}")
    named = [name.translate(FORBIDDEN).strip() for name in layers]
    if not all(named):
        raise ValueError(f"a layer needs a name, got {layers[named.index('')]!r}")
    return named


def thing_of(name: str) -> tuple[str, ...]:
    """The thing that a stroke of this name is part of, and its parts down to the stroke's."""
    return tuple(part for part in name.partition(", ")[0].split("/")[:-1] if part)


def known_layers(sketch: Sketch) -> list[tuple[str, ...]]:
    """Layers within layers of what a sketch says of its strokes: things, their parts and kinds, or else colours."""
    if sketch.names is None and sketch.kinds is None:
        return [(hexadecimal(color),) for color in sketch.color.detach().tolist()]
    names, kinds = (texts or ("",) * len(sketch) for texts in (sketch.names, sketch.kinds))
    found = [(*thing_of(name), *([kind] if kind else [])) for name, kind in zip(names, kinds, strict=True)]
    return [layers or ("strokes",) for layers in found]
