"""Lines of solids: the faces that contours come from, and layers of parts."""

from collections.abc import Sequence

import numpy as np
import torch

from diff3ds.bezier import evaluate
from diff3ds.chains import Chains
from diff3ds.sketch import Sketch
from diff3ds.surfaces.form.solid_mesh import SolidMesh
from diff3ds.surfaces.shape.nearest import faces_at, places_anywhere
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh


def with_faces(sketch: Sketch, mesh: TriangleMesh) -> Sketch:
    """The strokes; those without a name are called by the faces of the solids that they lie on."""
    names = list(sketch.names or ("",) * len(sketch))
    own = [i for i, name in enumerate(names) if not name]
    if not isinstance(mesh, SolidMesh) or not own:
        return sketch
    some = sketch[own].detach()
    chains = some.chains or Chains.plain(len(some))
    # Between the ends of segments, which may lie between faces.
    t = torch.tensor([0.25, 0.5, 0.75], dtype=torch.float64)
    points = evaluate(some.points.double(), some.weights.double(), t).reshape(-1, 3)
    query, face = faces_at(mesh, places_anywhere(mesh, points.numpy())[1])
    stroke = chains.stroke.repeat_interleave(len(t)).numpy()[query]
    for number, i in enumerate(own):
        faces, counts = np.unique(mesh.form[face[stroke == number]], return_counts=True)
        # A point near the border of two faces is on either.
        sure = faces[counts > 1] if (counts > 1).any() else faces
        names[i] = ", ".join(mesh.names[k] for k in sure)
    return sketch.replace(names=names)


def layers_of(kinds: Sequence[str], sketch: Sketch, mesh: TriangleMesh) -> list[str]:
    """The layer of each stroke: its kind, and of assemblies its part before that."""
    if not isinstance(mesh, SolidMesh) or len(mesh.parts) < 2 or sketch.names is None:
        return list(kinds)
    parts = (name.partition(", ")[0].rpartition("/")[0].replace("/", " ") for name in sketch.names)
    return [f"{part}, {kind}" for part, kind in zip(parts, kinds, strict=True)]
