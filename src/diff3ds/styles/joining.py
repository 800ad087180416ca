"""Strokes that go on smoothly in each other as one, so that a pen draws them in one go."""

import numpy as np
import torch

from diff3ds._shapes import Array, Float, Int, Tensor
from diff3ds.chains import Chains
from diff3ds.sketch import Sketch

# Ends this near to each other, of the sketch's size, are one place; and directions that differ by less (a cosine: 30
# degrees) go on in each other. [empirical: what the eye takes for one line]
NEAR, SMOOTH = 2e-4, 0.866


def joined(sketch: Sketch) -> tuple[Sketch, list[list[int]]]:
    """The sketch in which strokes of one look that meet end to end, and go on smoothly there, are one stroke.

    Where several meet, those that go on straightest do. A stroke that comes back to its beginning so is closed.

    Returns:
        The sketch, and for each of its strokes the numbers of those that it is made of, in their order along it.
    """
    if len(sketch) == 0:
        return sketch, []
    mates = _mates(sketch)
    rows: list[int] = []
    turned: list[bool] = []
    made: list[list[int]] = []
    counts, closed = [], []
    chains = sketch.chains or Chains.plain(len(sketch))
    first = chains.first.tolist()
    for entries, round_ in _runs(len(sketch), mates, chains.closed.tolist()):
        before = len(rows)
        for end in entries:
            segments = list(range(first[end // 2], first[end // 2 + 1]))
            rows += reversed(segments) if end % 2 else segments
            turned += [end % 2 == 1] * len(segments)
        made.append([end // 2 for end in entries])
        counts.append(len(rows) - before)
        closed.append(round_)
    back = torch.tensor(turned)[:, None]

    def along(values: Tensor) -> Tensor:
        values = values[rows]
        return torch.where(back.reshape(-1, *[1] * (values.ndim - 1)), values.flip(1), values)

    new = Chains.of(counts, closed)
    lead = [numbers[0] for numbers in made]
    width = new.joined(along(sketch.width)) if sketch.width.ndim == 2 else sketch.width[lead]
    return Sketch(
        new.joined(along(sketch.points)),
        along(sketch.weights),
        width,
        sketch.color[lead],
        sketch.opacity[lead],
        sketch.width_space,
        new,
    ), made


def _mates(sketch: Sketch) -> dict[int, int]:
    """For ends that go on in others, these; the start of stroke i is end 2 i, its stop 2 i + 1."""
    from scipy.spatial import cKDTree

    chains = sketch.chains or Chains.plain(len(sketch))
    rows = torch.stack([chains.first[:-1], chains.first[1:] - 1], 1)
    points = sketch.points.double()
    ends = torch.stack([points[rows[:, 0], 0], points[rows[:, 1], -1]], 1).reshape(-1, 3).numpy()
    outward = (
        torch.stack([_outward(points[rows[:, 0]]), _outward(points[rows[:, 1]].flip(1))], 1).reshape(-1, 3).numpy()
    )
    extent = float((points.reshape(-1, 3).amax(0) - points.reshape(-1, 3).amin(0)).max())
    size = torch.zeros(len(sketch), dtype=torch.float64).index_add_(0, chains.stroke, _sizes(points)).numpy()
    pairs = cKDTree(ends).query_pairs(NEAR * extent, output_type="ndarray")
    straight = -(outward[pairs[:, 0]] * outward[pairs[:, 1]]).sum(1)
    look = _looks(sketch, rows).reshape(2 * len(sketch), -1)
    alike = (np.abs(look[pairs[:, 0]] - look[pairs[:, 1]]) <= 1e-6 + 1e-3 * np.abs(look[pairs[:, 0]])).all(1)
    open_ = ~chains.closed.numpy()[pairs // 2].any(1)
    # Both ends of a speck are near to each other.
    own = (pairs[:, 0] // 2 == pairs[:, 1] // 2) & (size[pairs[:, 0] // 2] < 4 * NEAR * extent)
    fits = np.flatnonzero((straight > SMOOTH) & alike & open_ & ~own)
    mates: dict[int, int] = {}
    for k in fits[np.argsort(-straight[fits], kind="stable")].tolist():
        a, b = pairs[k].tolist()
        if a not in mates and b not in mates:
            mates[a], mates[b] = b, a
    return mates


def _outward(points: Float[Tensor, "N K 3"]) -> Float[Tensor, "N 3"]:
    """Directions away from curves at their first points."""
    steps = points[:, :1] - points[:, 1:]
    far = torch.linalg.vector_norm(steps, dim=-1)
    which = (far > 1e-6 * far.amax(1, keepdim=True)).int().argmax(1)
    return torch.nn.functional.normalize(steps[torch.arange(len(steps)), which], dim=-1)


def _sizes(points: Float[Tensor, "M K 3"]) -> Float[Tensor, " M"]:
    return torch.linalg.vector_norm(points.diff(dim=1), dim=-1).sum(1)


def _looks(sketch: Sketch, rows: Int[Tensor, "N 2"]) -> Array:
    """Width at both ends, colour and opacity of strokes: (N, 2, 5)."""
    if sketch.width.ndim == 2:
        width = torch.stack([sketch.width[rows[:, 0], 0], sketch.width[rows[:, 1], -1]], 1)
    else:
        width = sketch.width[:, None].expand(-1, 2)
    rest = torch.cat([sketch.color, sketch.opacity[:, None]], 1)[:, None].expand(-1, 2, -1)
    return torch.cat([width[..., None], rest], -1).double().numpy()


def _runs(count: int, mates: dict[int, int], closed: list[bool]) -> list[tuple[list[int], bool]]:
    """All strokes in runs: for each the end at which a run enters it; and whether the run closes."""
    found: list[tuple[list[int], bool]] = []
    done: set[int] = set()
    for stroke in range(count):
        if stroke in done:
            continue
        start = 2 * stroke
        while start in mates and (before := mates[start] ^ 1) != 2 * stroke:
            start = before
        entries, round_ = [start], closed[stroke]
        while (after := mates.get(entries[-1] ^ 1)) is not None:
            if after == start:
                round_ = True
                break
            entries.append(after)
        found.append((entries, round_))
        done |= {end // 2 for end in entries}
    return found
