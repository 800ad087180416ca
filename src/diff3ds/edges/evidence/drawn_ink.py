"""How much of lines pictures draw: the length of each along their ridges, over all views."""

import numpy as np

from diff3ds._shapes import Array, Float
from diff3ds.camera import Cameras, evenly_spaced
from diff3ds.curves.importance import Samples, Shown
from diff3ds.edges.evidence.edge_views import edge_views
from diff3ds.edges.evidence.ridges import Ridges
from diff3ds.edges.evidence.support import STEP, inliers

# [views; speed] So many views say enough.
VIEWS = 48


def drawn_in(cameras: Cameras, ridges: list[Ridges]) -> Shown:
    """Says how long lines appear where views draw them, pixels a unit of length, in the mean over all views.

    Args:
        cameras: of the views; with perspective.
        ridges: of each view.
    """
    some = evenly_spaced(len(cameras), VIEWS).tolist()
    views = edge_views(cameras[some], [ridges[view] for view in some])

    def shown(samples: Samples) -> Float[Array, " P"]:
        step = STEP * views.pixel
        here, there = (views.project(place)[0] for place in (samples.place, samples.place + step * samples.tangent))
        drawn = inliers(views, samples.place, samples.tangent)
        return np.asarray(np.where(drawn, np.linalg.norm(there - here, axis=-1) / step, 0.0).mean(0))

    return shown
