"""How much of lines a mesh lets be seen from all around, and strokes in the order in which they are worth drawing."""

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.curves.importance import Ranked, Samples, Shown, ranked
from diff3ds.page.picture import Picture
from diff3ds.parallel.in_copies import in_copies
from diff3ds.sketch import Sketch
from diff3ds.surfaces.hidden.mesh_view import MeshView
from diff3ds.surfaces.line_drawings import all_around
from diff3ds.surfaces.shape.coarse import coarse
from diff3ds.surfaces.shape.nearest import Nearest
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Views from all around, and cells of the coarse mesh that stands for a large one. Empirical.
VIEWS, CELLS = 16, 256


def by_importance(sketch: Sketch, surface: TriangleMesh | None = None) -> Sketch:
    """The strokes with their `importance`, the most important first, so that `at_detail` can leave out the others.

    Importance is how much of the ink of all strokes one adds to those before it: long strokes come before short ones,
    what runs along a line that is there adds little, or nothing, and of two strokes that add about as much the one
    comes first that hangs together with what is there.

    Flat sketches of several colours, in which later strokes lie on top, keep their order.

    Args:
        sketch: any.
        surface: what hides lines: then ink counts by how much of it is seen from all around.

    Raises:
        TypeError: no sketch, or another surface than a `TriangleMesh`.
    """
    return ranked_around(sketch, surface).sketch


def ranked_around(sketch: Sketch, surface: TriangleMesh | None = None, *, sort: bool = True) -> Ranked:
    """As `by_importance`, with the numbers that the strokes had; `sort=False` leaves them in their places."""
    if not isinstance(sketch, Sketch):
        raise TypeError(f"by_importance sorts the strokes of a Sketch, got {type(sketch).__name__}")
    if not isinstance(surface, TriangleMesh | None):
        raise TypeError(f"surface must be a TriangleMesh or None, got {type(surface).__name__}")
    return ranked(sketch, None if surface is None else seen_around(surface), sort=sort)


def seen_around(surface: TriangleMesh) -> Shown:
    """Says how long lines appear from all around where a surface does not hide them, as a share of their length."""
    mesh = coarse(surface, CELLS)
    cameras = all_around(mesh, VIEWS)

    def shown(samples: Samples) -> Float[Array, " P"]:
        moved, own = Nearest.of(mesh, mesh.near).places(samples.place)

        def seen(view: int) -> Float[Array, " P"]:
            across = np.linalg.norm(np.cross(samples.tangent, cameras.world_to_camera[view, 2, :3].numpy()), axis=1)
            hiding = MeshView(mesh, Picture.of(cameras, view))
            hidden = hiding.in_front(moved, own)
            if mesh.beside > 0:
                # An edge outside of its rounding is seen where that is already on the other side.
                hidden[hidden] = hiding.in_front(samples.place[hidden], own[hidden])
            return np.where(hidden, 0.0, across)

        total = np.zeros(len(moved))
        for part in in_copies(seen, len(cameras), len(cameras)):
            total += part
        return total / len(cameras)

    return shown
