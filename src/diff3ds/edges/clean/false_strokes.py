"""Strokes that pictures do not show where they should: outlines of smooth parts, which contours draw from each side.

An outline wanders over a smooth part as one walks around it, and pieces of it pass for an edge in the few views that
look along the surface there. With a surface one knows where else a stroke would be seen: where that faces the camera
and nothing lies before it. An edge is in the pictures there, a piece of an outline is not.
"""

import numpy as np
import torch

from diff3ds._shapes import Array, Bool, Float, Index, Int, Mask, Tensor
from diff3ds.bezier import derivatives, evaluate
from diff3ds.camera import Cameras, evenly_spaced
from diff3ds.chains import Chains
from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.evidence.support import inliers
from diff3ds.page.picture import Picture
from diff3ds.sketch import Sketch
from diff3ds.surfaces.hidden.mesh_view import MeshView
from diff3ds.surfaces.shape.nearest import Nearest
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# [1; numerical] Points along a segment.
SAMPLES = 12
# [fraction; derived] Strokes so near to the surface lie on it, as a share of its size: two cells of the grid that it
# is made on.
NEAR = 1 / 40
# [1; empirical] Faces that are turned so far towards the camera are inside of the outline: sine of 20 degrees.
FACING = 0.34
# [views, fraction; empirical] A stroke that should be seen by so many views, in the mean over its points, and of which
# the pictures show less than this share there, is false.
FEWEST, LEAST = 3.0, 0.35
# [views; speed] So many views say enough.
VIEWS = 48


def false_strokes(sketch: Sketch, surface: TriangleMesh, cameras: Cameras, ridges: list[Ridges]) -> Bool[Tensor, " N"]:
    """Which strokes the pictures do not show where the surface would let them be seen.

    Args:
        sketch: in the frame of the cameras.
        surface: of what the pictures show.
        cameras: of the views; with perspective.
        ridges: of each view.
    """
    some = evenly_spaced(len(cameras), VIEWS).tolist()
    cameras, ridges = cameras[some], [ridges[view] for view in some]
    points, tangents, stroke = _along(sketch)
    clear = _clear(points, surface, cameras)
    shown = inliers(edge_views(cameras, ridges), points, tangents)
    count = len(sketch)
    seen, found = (np.bincount(stroke, flags.sum(0), count) for flags in (clear, clear & shown))
    each = np.bincount(stroke, minlength=count)
    return torch.from_numpy((seen >= FEWEST * each) & (found < LEAST * seen))


def _along(sketch: Sketch) -> tuple[Float[Array, "M 3"], Float[Array, "M 3"], Int[Index, " M"]]:
    """Points along the strokes, unit tangents there, and the stroke of each."""
    t = (torch.arange(SAMPLES, dtype=torch.float64) + 0.5) / SAMPLES
    control, weights = sketch.points.detach().double(), sketch.weights.detach().double()
    points = evaluate(control, weights, t).flatten(0, 1).numpy()
    speed = derivatives(control, weights, t)[0].flatten(0, 1).numpy()
    chains = sketch.chains or Chains.plain(len(sketch))
    tangents = speed / np.maximum(np.linalg.norm(speed, axis=1, keepdims=True), 1e-300)
    return points, tangents, np.repeat(chains.stroke.numpy(), SAMPLES)


def _clear(points: Float[Array, "M 3"], surface: TriangleMesh, cameras: Cameras) -> Bool[Mask, "V M"]:
    """In which views points lie on parts of a surface that face the camera, with nothing before them."""
    reach = NEAR * surface.size
    placed, own = Nearest(surface, reach, edges_first=False).places(points)
    on = own[:, 0] >= 0
    products = np.repeat(surface.face_normals * surface.face_areas[:, None], 3, axis=0)
    corners = surface.faces.ravel()
    normals = np.stack([np.bincount(corners, products[:, k], len(surface.vertices)) for k in range(3)], 1)
    normal = normals[own].sum(1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    # A little off the surface, so that it does not hide what lies on it.
    lifted = np.where(on[:, None], placed + reach / 2 * normal, points)
    clear = np.zeros((len(cameras), len(points)), bool)
    for view in range(len(cameras)):
        picture = Picture.of(cameras, view)
        sight = picture.towards(placed)
        faces = np.einsum("mi,mi->m", normal, sight) > FACING * np.linalg.norm(sight, axis=1)
        row = np.flatnonzero(on & faces & (picture.seen(placed)[1] > picture.near))
        clear[view, row] = ~MeshView(surface, picture).in_front(lifted[row])
    return clear
