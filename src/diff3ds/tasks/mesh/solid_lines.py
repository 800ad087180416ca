"""Lines of solids: the faces that contours come from, layers of parts, thin lines where faces go on in each other."""

from collections.abc import Sequence

import numpy as np
import torch

from diff3ds.bezier import evaluate
from diff3ds.chains import Chains
from diff3ds.sketch import Sketch
from diff3ds.surfaces.form.solid_mesh import SolidMesh
from diff3ds.surfaces.shape.nearest import faces_at, places_anywhere
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.mesh.source import TANGENT

# Lines where faces go on in each other are so much narrower than others: the ratio of ISO 128-2.
THIN = 0.5


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


def thinned(sketch: Sketch, kinds: Sequence[str], thin: bool) -> Sketch:
    """The strokes, those between faces that go on in each other narrower."""
    narrow = torch.tensor([thin and kind.startswith(TANGENT) for kind in kinds], dtype=torch.bool)
    if not narrow.any():
        return sketch
    return sketch.replace(width=torch.where(narrow, THIN * sketch.width, sketch.width))
