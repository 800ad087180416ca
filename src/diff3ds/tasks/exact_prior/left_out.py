"""Details of a thing that its drawing does not show, such as the windows of a house: they are left out."""

import numpy as np
import torch

from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds.bezier import evaluate, subcurve
from diff3ds.library.faces import Faces
from diff3ds.page.parts import Parts
from diff3ds.recognition.bend import seen_by
from diff3ds.recognition.side_seen import BY_LINES, PlacedLines, heading
from diff3ds.sketch import Sketch
from diff3ds.surfaces.draw import visible_lines
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh

# A detail is not drawn if lines of its direction lie near (`BY_LINES`) less than this share of what would be seen of
# it, that is more than this share of all of it, and there is no such length of other ink around it, in lengths of the
# longer side of the drawing: people draw windows in other places. Ink is other if nothing else of the thing lies within
# this, in its direction: walls stand back under eaves. Empirical.
DRAWN, SEEN, AROUND, OTHER = 0.4, 0.5, 0.06, 2 * BY_LINES
# Pieces of a part of a stroke; pixels of the view in which it is told what is seen.
PIECES, SIZE = 16, 256


def drawn_strokes(sketch: Sketch, details: Int[Tensor, " N"], faces: Faces, lines: PlacedLines) -> Bool[Tensor, " N"]:
    """Which strokes of a thing stay: those of the details that a drawing shows, or cannot show, and of all else.

    Args:
        sketch: the thing, bent towards the drawing; its strokes are cubics.
        details: which detail each stroke is of; -1 for none.
        faces: what hides lines of it.
        lines: of the drawing.
    """
    if int(details.max()) < 0:
        return torch.ones(len(sketch), dtype=torch.bool)
    parts = _parts(sketch, faces, lines)
    middles, along = _pieces(sketch, parts, lines)
    length = torch.hypot(*along.unbind(-1))
    ink, inked = lines.points / lines.side, torch.from_numpy(lines.lines.tangents)
    headed = np.column_stack([ink, heading(inked).numpy()])
    own = torch.cat([middles, heading(along)], 1).numpy()
    met = _near(own, headed, BY_LINES)
    visible = torch.from_numpy(parts.visible).repeat_interleave(PIECES)
    of = details[torch.from_numpy(parts.segment)].repeat_interleave(PIECES) + 1

    def summed(values: Tensor) -> Tensor:
        return values.new_zeros(int(details.max()) + 2).index_add_(0, of, values)

    seen = summed(length * visible)
    missing = (seen > SEEN * summed(length)) & (summed(length * (visible & met)) < DRAWN * seen)
    missing[0] = False
    left = ~_near(headed, own[(~missing[of] & visible).numpy()], OTHER)
    for detail in missing.nonzero()[:, 0].tolist():
        around = _near(ink, middles[of == detail].numpy(), AROUND) & left
        missing[detail] = float(torch.hypot(*inked[around].unbind(-1)).sum()) < DRAWN * float(seen[detail])
    return ~missing[details + 1]


def _near(points: Float[np.ndarray, "N D"], others: Float[np.ndarray, "M D"], reach: float) -> Bool[Tensor, " N"]:
    """Which points have one of the others so near."""
    from scipy.spatial import cKDTree

    return torch.from_numpy(cKDTree(others).query(points)[0] < reach)


def _parts(sketch: Sketch, faces: Faces, lines: PlacedLines) -> Parts:
    """The strokes in parts that are seen or hidden as a whole."""
    if not len(faces):
        return Parts.whole(len(sketch))
    surface = TriangleMesh.of_triangles(faces.numpy())
    return visible_lines(sketch, lines.camera.resize(SIZE), surface, contours=False)[0].parts


def _pieces(sketch: Sketch, parts: Parts, lines: PlacedLines) -> tuple[Float[Tensor, "P 2"], Float[Tensor, "P 2"]]:
    """Middles of short pieces of the parts, and the vectors along them, in lengths of the drawing's longer side."""
    rows, start, stop = (torch.from_numpy(a) for a in (parts.segment, parts.start, parts.stop))
    cut = subcurve(sketch.points.detach().double()[rows], sketch.weights.detach().double()[rows], start, stop)
    places = evaluate(*cut, torch.linspace(0, 1, PIECES + 1, dtype=torch.float64))
    seen = (seen_by(places.flatten(0, 1), lines.camera)[0] / lines.side).reshape(len(rows), PIECES + 1, 2)
    return ((seen[:, 1:] + seen[:, :-1]) / 2).flatten(0, 1), seen.diff(dim=1).flatten(0, 1)
