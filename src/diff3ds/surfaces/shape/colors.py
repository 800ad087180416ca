"""The colours of a mesh along strokes: each stroke takes the one that most of it runs along."""

from dataclasses import dataclass, replace

import numpy as np
import torch

from diff3ds._shapes import Array, Float, Index, Int, Tensor
from diff3ds.bezier import evaluate
from diff3ds.chains import Chains
from diff3ds.formats.mesh_colors import MeshColors, to_linear
from diff3ds.sketch import Sketch
from diff3ds.surfaces.shape.nearest import closest_on_triangles, faces_at, places_anywhere
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# Points along a segment, and at most of a stroke: all pairs of them are compared.
SAMPLES, MOST = 16, 256
# Colours that are nearly white, no channel below this, are darkened until one is: they are drawn on white paper.
# Empirical.
PALEST = 0.7
# Of two sides of a crease the darker one counts; brightness by Rec. 709.
BRIGHTNESS = (0.2126, 0.7152, 0.0722)


@dataclass(frozen=True, eq=False)
class SurfaceColors:
    """Colours of the faces of a `TriangleMesh`.

    Attributes:
        colors: of the file's triangles.
        source: which of these each face of the mesh is, or is a part of.
        corners: where the corners of these lie, in the mesh's frame.
    """

    colors: MeshColors
    source: Int[Index, " F"]
    corners: Float[Array, "F 3 3"]

    @property
    def missing(self) -> tuple[str, ...]:
        """What the file names and cannot be read."""
        return self.colors.missing

    def of_faces(self, rows: Int[Index, " G"]) -> "SurfaceColors":
        """The colours of a mesh of some of the faces."""
        return SurfaceColors(self.colors, self.source[rows], self.corners[rows])

    def at(self, face: Int[Index, " N"], points: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
        """The colours of faces where points lie on them, sRGB in [0, 1]; NaN where there is none."""
        # By place: faces of the mesh may begin at another corner than the file's, or be turned round.
        shares = closest_on_triangles(points, self.corners[face])[1]
        return self.colors.at(self.source[face], shares)


def colored(sketch: Sketch, mesh: TriangleMesh, colors: SurfaceColors) -> Sketch:
    """The strokes in the colours of the surface that they run along; black where it has none.

    At a point where faces of several colours meet, the darker one counts. Of those along a stroke it takes the one from
    which the others differ least, so that no colour comes up that is not there; what is nearly white is darkened, so
    that white paper shows it.
    """
    if not len(sketch):
        return sketch
    points, weight = _along(sketch)
    shades = _shades(points.reshape(-1, 3), mesh, colors)
    chains = sketch.chains or Chains.plain(len(sketch))
    stroke = chains.stroke.repeat_interleave(SAMPLES).numpy()
    taken = np.zeros((len(sketch), 3))
    order = np.argsort(stroke, kind="stable")
    for number, rows in enumerate(np.split(order, np.flatnonzero(np.diff(stroke[order])) + 1)):
        rows = rows[np.isfinite(shades[rows]).all(1)]
        if len(rows):
            taken[number] = _most_typical(shades[rows], weight.ravel()[rows])
    palest = taken.min(1, keepdims=True)
    taken *= np.where(palest > PALEST, PALEST / np.maximum(palest, PALEST), 1.0)
    return replace(sketch, color=torch.from_numpy(taken).to(sketch.color))


def _along(sketch: Sketch) -> tuple[Float[Array, "M S 3"], Float[Array, "M S"]]:
    """Points between the ends of segments, and the length of stroke that each stands for."""
    t = torch.linspace(0, 1, 2 * SAMPLES + 1, dtype=torch.float64)
    line: Tensor = evaluate(sketch.points.detach().double(), sketch.weights.detach().double(), t)
    ends = line[:, ::2]
    return line[:, 1::2].numpy(), (ends[:, 1:] - ends[:, :-1]).norm(dim=-1).numpy()


def _shades(points: Float[Array, "N 3"], mesh: TriangleMesh, colors: SurfaceColors) -> Float[Array, "N 3"]:
    """The colour of the surface nearest to each point: the darkest of the faces that meet there; NaN where none is."""
    places, own = places_anywhere(mesh, points)
    query, face = faces_at(mesh, own)
    found = colors.at(face, places[query])
    bright = np.where(np.isfinite(found).all(1), to_linear(found) @ BRIGHTNESS, np.inf)
    # The darkest comes last, and stays.
    order = np.argsort(-bright, kind="stable")
    shades = np.full((len(points), 3), np.nan)
    shades[query[order]] = found[order]
    return shades


def _most_typical(shades: Float[Array, "N 3"], weight: Float[Array, " N"]) -> Float[Array, " 3"]:
    """The one of which the others differ least, by their weights."""
    rows = np.arange(0, len(shades), -(-len(shades) // MOST))
    apart = np.linalg.norm(shades[rows, None] - shades[rows], axis=2)
    best: Float[Array, " 3"] = shades[rows[(apart @ (weight[rows] + 1e-300)).argmin()]]
    return best
