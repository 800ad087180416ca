"""The layers of strokes in files: by thing, kind, visibility and colour, each within those before it."""

from collections.abc import Sequence

from diff3ds.formats.cad.layers import thing_of
from diff3ds.page.sheet.views_grid import hexadecimal
from diff3ds.sketch import Sketch
from diff3ds.tasks.render.render_options import LayerBy

# What strokes are called of which nothing is known.
PLAIN, VISIBLE, HIDDEN = "stroke", "visible", "hidden"


def layers_by(
    sketch: Sketch, by: Sequence[LayerBy], seen: Sequence[bool] | None = None
) -> list[tuple[str, ...]] | None:
    """The layer of each stroke as names from the outermost on; None where there are to be none.

    Of things the parts are layers within them: a stroke that is called "engine/rod/edge 7" lies on rod in engine, and
    one of no thing on none.

    Args:
        by: what makes a layer.
        seen: whether each stroke is visible; by default all are.
    """
    if not by:
        return None
    levels: dict[LayerBy, list[tuple[str, ...]]] = {
        "thing": [thing_of(name) for name in sketch.names or ("",) * len(sketch)],
        "kind": [(kind or PLAIN,) for kind in sketch.kinds or ("",) * len(sketch)],
        "visibility": [(VISIBLE if shown else HIDDEN,) for shown in seen or (True,) * len(sketch)],
        "color": [(hexadecimal(color),) for color in sketch.color.detach().tolist()],
    }
    return [tuple(name for level in by for name in levels[level][stroke]) for stroke in range(len(sketch))]
