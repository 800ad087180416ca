"""Where the things of a scene stand: x points to the front, y to the right as one sees it from there, z up."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.bezier import evaluate
from diff3ds.library.categories import CATEGORIES
from diff3ds.library.faces import Faces
from diff3ds.library.members import RADIUS
from diff3ds.library.scene import Relation, Scene
from diff3ds.sketch import Sketch

# What a thing's real size is multiplied by where the phrase says so. Empirical.
SAID_SIZES = {"big": 1.3, "large": 1.3, "huge": 1.7, "small": 0.75, "little": 0.75, "tiny": 0.5}
# No thing is drawn smaller than this fraction of the largest: a mug before a house would be a dot. Empirical.
LEAST = 0.15
# Between neighbours, as a fraction of the larger one's longest side. Empirical.
GAP = 0.12
# What stands under something fills its height to this fraction at most. Empirical.
UNDER = 0.9
# Under these is room: in the middle, or before what carries them. What is under other things is below them.
ROOM_UNDER = {"table": 0.0, "chair": 0.0, "bed": 0.0, "bridge": 0.0, "tree": 0.3, "umbrella": 0.3}
# What is in something is no wider than this fraction of it. Empirical.
ROOM_WITHIN = 0.7
# [degrees] What leans on something is tilted so far, if one of its sides is shorter than this fraction of its height:
# other things stand. Empirical.
LEAN = 12.0
THIN = 0.5
# Points on a stroke when extents are measured.
SAMPLES = 33
# Where something stands beside, behind and so on: along x and y.
SIDES = {"in front of": (1, 0), "behind": (-1, 0), "right of": (0, 1), "left of": (0, -1)}


@dataclass
class _Placed:
    """A sketch of a category at its place, with the faces of its solid parts."""

    sketch: Sketch
    category: str
    faces: Faces

    def __post_init__(self) -> None:
        points = evaluate(self.sketch.points, self.sketch.weights, torch.linspace(0, 1, SAMPLES)).reshape(-1, 3)
        self.low, self.high = points.amin(0), points.amax(0)

    @property
    def size(self) -> Tensor:
        """Of the bounding box."""
        return self.high - self.low

    @property
    def middle(self) -> Tensor:
        """Of the bounding box."""
        return (self.high + self.low) / 2

    @property
    def surface(self) -> float:
        """The height at which things stand on it."""
        return float(self.low[2] + CATEGORIES[self.category].carries * self.size[2])

    def at(self, x: float, y: float, bottom: float) -> "_Placed":
        """The same with the middle of its footprint there."""
        offset = torch.tensor([x - float(self.middle[0]), y - float(self.middle[1]), bottom - float(self.low[2])])
        return self._mapped(lambda points: points + offset.to(points))

    def scaled(self, factor: float) -> "_Placed":
        """Larger or smaller."""
        return self._mapped(lambda points: points * factor)

    def turned(self, degrees: float, axis: int = 2) -> "_Placed":
        """About an axis through the origin, usually the vertical one."""
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        turn, (first, second) = torch.eye(3), ((axis + 1) % 3, (axis + 2) % 3)
        turn[first, first] = turn[second, second] = c
        turn[first, second], turn[second, first] = -s, s
        return self._mapped(lambda points: points @ turn.to(points).T)

    def _mapped(self, place: Callable[[Tensor], Tensor]) -> "_Placed":
        """All of it after an affine map."""
        moved = replace(self.sketch, points=place(self.sketch.points))
        return _Placed(moved, self.category, place(self.faces))


def arranged(scene: Scene, sketches: Sequence[Sketch]) -> Sketch:
    """The scene as one sketch in the unit ball, as members are.

    Args:
        sketches: of each of its things one, the front on +x, of any size.
    """
    return arranged_solids(scene, sketches, [torch.zeros(0, 3, 3, dtype=torch.float64)] * len(sketches))[0]


def arranged_solids(scene: Scene, sketches: Sequence[Sketch], faces: Sequence[Faces]) -> tuple[Sketch, Faces]:
    """The scene as one sketch in the unit ball, as members are, and the faces of all things in it.

    Args:
        sketches: of each of its things one, the front on +x, of any size.
        faces: of each of its things, in the frame of its sketch.
    """
    parts = _real_sizes(scene, sketches, faces)
    standing: list[list[_Placed]] = [[] for _ in scene.things]
    for number in _free(scene):
        _beside(standing, number, [parts[number]] * scene.things[number].count)
    for relation in scene.relations:
        # Those of which the same is said are placed together, with the first of them.
        if not standing[relation.thing]:
            alike = [r.thing for r in scene.relations if (r.kind, r.targets) == (relation.kind, relation.targets)]
            together = [number for number in alike if not standing[number]]
            copies = {number: [parts[number]] * scene.things[number].count for number in together}
            _place(standing, relation, copies)
    _settle(scene, standing)
    there = [one for group in standing for one in group]
    whole = Sketch.concatenate(_named(there))
    middle, scale = frame_of(whole)
    solid = torch.cat([one.faces for one in there])
    return replace(whole, points=(whole.points - middle) * scale), (solid - middle) * scale


def _named(there: Sequence[_Placed]) -> list[Sketch]:
    """The sketches of things, whose strokes say which thing they are part of: "chair", "chair 2"."""
    found, count = [], Counter[str]()
    for one in there:
        count[one.category] += 1
        thing = one.category if count[one.category] == 1 else f"{one.category} {count[one.category]}"
        own = one.sketch.names or ("",) * len(one.sketch)
        names = [f"{thing}/{name or f'stroke {number}'}" for number, name in enumerate(own)]
        found.append(one.sketch.replace(names=names))
    return found


def frame_of(sketch: Sketch) -> tuple[Float[Tensor, " 3"], Float[Tensor, ""]]:
    """What of a sketch's points is subtracted, and the rest multiplied by, that it fills the unit ball."""
    points = evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, SAMPLES)).reshape(-1, 3)
    middle = (points.amin(0) + points.amax(0)) / 2
    return middle, RADIUS / torch.linalg.vector_norm(points - middle, dim=1).max()


def _real_sizes(scene: Scene, sketches: Sequence[Sketch], faces: Sequence[Faces]) -> list[_Placed]:
    """Each thing as large as it is, in metres, but none too small to be seen, nor larger for being in the air."""
    metres = []
    for thing in scene.things:
        said = [SAID_SIZES[word] for word in thing.request.ignored if word in SAID_SIZES]
        metres.append(CATEGORIES[thing.request.category].metres * math.prod(said))
    # What is in the air is far away, unless something is in or on it.
    boarded = {target for r in scene.relations if r.kind in ("in", "on") for target in r.targets}
    far = [CATEGORIES[t.request.category].aloft and n not in boarded for n, t in enumerate(scene.things)]
    largest = max((size for size, away in zip(metres, far, strict=True) if not away), default=math.inf)
    metres = [min(size, largest) if away else size for size, away in zip(metres, far, strict=True)]
    found = []
    for thing, sketch, solid, size in zip(scene.things, sketches, faces, metres, strict=True):
        placed = _Placed(sketch, thing.request.category, solid)
        found.append(placed.scaled(max(size, LEAST * max(metres)) / float(placed.size.max())))
    return found


def _free(scene: Scene) -> list[int]:
    """Things that stand anywhere: those that no relation is about."""
    placed = {relation.thing for relation in scene.relations}
    return [number for number in range(len(scene.things)) if number not in placed]


def _place(standing: list[list[_Placed]], relation: Relation, copies: dict[int, list[_Placed]]) -> None:
    """Places all things of which the same is said, by their numbers."""
    targets = [one for number in relation.targets for one in standing[number]]
    if not targets or relation.kind == "beside":
        for number, alike in copies.items():
            if targets and float(targets[0].low[2]) > 0 and alike[0].size.max() < 2 * targets[0].size.max():
                # What stands beside something on a table is on the table too.
                standing[number] = _aside(targets, alike, SIDES["right of"])
            else:
                _beside(standing, number, alike)
        return
    row = [one for alike in copies.values() for one in alike]
    if relation.kind in PUT:
        found = _over(targets, row, PUT[relation.kind])
    elif relation.kind == "against":
        found = _against(targets[0], row)
    elif relation.kind == "around":
        found = _around(targets[0], row)
    elif relation.kind == "between":
        found = _between(standing, relation, targets, row)
    else:
        found = _aside(targets, row, SIDES[relation.kind])
    for number, alike in copies.items():
        standing[number], found = found[: len(alike)], found[len(alike) :]


def _over(
    targets: list[_Placed], copies: list[_Placed], put: Callable[[_Placed, _Placed, float], _Placed]
) -> list[_Placed]:
    """Dealt out to the targets, on each in a row from left to right, no longer than it."""
    found: dict[int, _Placed] = {}
    for first, target in enumerate(targets):
        mine = copies[first :: len(targets)]
        widths = [(1 + GAP) * float(one.size[1]) for one in mine]
        total = sum(widths)
        squeeze, edge = min(1.0, float(target.size[1]) / max(total, 1e-9)), -total / 2
        for k, (one, width) in enumerate(zip(mine, widths, strict=True)):
            found[first + k * len(targets)] = put(one, target, squeeze * (edge + width / 2))
            edge += width
    return [found[k] for k in range(len(copies))]


def _upon(one: _Placed, target: _Placed, aside: float) -> _Placed:
    """On its top, or on its head if that is where one wears it."""
    head, worn = CATEGORIES[target.category].head, CATEGORIES[one.category].worn
    if head is not None and worn is not None:
        length, height, wide = head
        fitted = one.scaled(worn * wide * float(target.size[2]) / float(one.size[1]))
        x, z = (float(target.low[axis] + share * target.size[axis]) for axis, share in ((0, length), (2, height)))
        return fitted.at(x, float(target.middle[1]) + aside, z)
    return one.at(float(target.middle[0]), float(target.middle[1]) + aside, target.surface)


def _below(one: _Placed, target: _Placed, aside: float) -> _Placed:
    """On the target's ground, no higher than there is room; or below it, if there is none."""
    x, y, ground = float(target.middle[0]), float(target.middle[1]) + aside, float(target.low[2])
    if target.category not in ROOM_UNDER:
        return one.at(x, y, ground - float(one.size[2]) - GAP * _larger(one, [target]) / 2)
    fitted = one.scaled(min(1.0, UNDER * (target.surface - ground) / float(one.size[2])))
    return fitted.at(x + ROOM_UNDER[target.category] * float(target.size[0]), y, ground)


def _above(one: _Placed, target: _Placed, aside: float) -> _Placed:
    """In the air over the target, half the height of the smaller of them away."""
    height = float(target.high[2]) + min(float(one.size[2]), float(target.size[2])) / 2
    return one.at(float(target.middle[0]), float(target.middle[1]) + aside, height)


def _within(one: _Placed, target: _Placed, aside: float) -> _Placed:
    """On the target's floor, no larger than there is room: where things stand on it, if that is not its top."""
    carries = CATEGORIES[target.category].carries
    floor = float(target.low[2]) + (carries * float(target.size[2]) if carries < 1 else 0.0)
    room = ROOM_WITHIN * target.size
    room[2] = float(target.high[2]) - floor if carries == 1 else torch.inf
    fitted = one.scaled(min(1.0, float((room / one.size.clamp(min=1e-9)).min())))
    return fitted.at(float(target.middle[0]), float(target.middle[1]) + aside, floor)


PUT = {"on": _upon, "under": _below, "above": _above, "in": _within}


def _beside(standing: list[list[_Placed]], number: int, copies: list[_Placed]) -> None:
    """On the ground, to the right of all that stands and to its left in turns."""
    for one in copies:
        there = [other for group in standing for other in group]
        if not there:
            standing[number].append(one.at(0.0, 0.0, 0.0))
            continue
        low, high = min(float(o.low[1]) for o in there), max(float(o.high[1]) for o in there)
        right = high <= -low
        away = float(one.size[1]) / 2 + GAP * _larger(one, there)
        standing[number].append(one.at(0.0, high + away if right else low - away, 0.0))


def _aside(targets: list[_Placed], copies: list[_Placed], side: tuple[int, int]) -> list[_Placed]:
    """In a row, before, behind, to the left or to the right of the targets."""
    low, high = (torch.stack([getattr(t, name) for t in targets]) for name in ("low", "high"))
    low, high, found = low.amin(0), high.amax(0), []
    middle = (low + high) / 2
    ground, gap = float(low[2]), GAP * _larger(copies[0], targets)
    for k, one in enumerate(copies):
        width = float(one.size[1]) + gap
        if side[0]:
            edge = float(high[0] if side[0] > 0 else low[0])
            x = edge + side[0] * (float(one.size[0]) / 2 + gap)
            found.append(one.at(x, float(middle[1]) + (k - (len(copies) - 1) / 2) * width, ground))
        else:
            edge = float(high[1] if side[1] > 0 else low[1])
            found.append(one.at(float(middle[0]), edge + side[1] * (float(one.size[1]) / 2 + gap + k * width), ground))
    return found


def _around(target: _Placed, copies: list[_Placed]) -> list[_Placed]:
    """On an oval about the target, facing it."""
    found, gap, ground = [], GAP * _larger(copies[0], [target]) / 2, float(target.low[2])
    for k, one in enumerate(copies):
        # One pair faces each other from the sides that one sees best.
        degrees = 90 + 360 * k / len(copies)
        x, y = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        facing = one.turned(degrees + 180)
        along_x, along_y = (float(n) / 2 + gap for n in target.size[:2] + one.size[0])
        found.append(facing.at(float(target.middle[0]) + x * along_x, float(target.middle[1]) + y * along_y, ground))
    return found


def _against(target: _Placed, copies: list[_Placed]) -> list[_Placed]:
    """To the right and to the left of the target in turns, each row before the last, leaning on it if they are thin."""
    found = []
    for k, one in enumerate(copies):
        thin = min(float(one.size[0]), float(one.size[1]))
        if float(one.size[0]) == thin:
            one = one.turned(90)
        side = -1 if k % 2 else 1
        if thin < THIN * float(one.size[2]):
            one = one.turned(side * LEAN, axis=0)
        touching = float(target.high[1] if side > 0 else target.low[1]) + side * float(one.size[1]) / 2
        row = float(target.middle[0]) + (k // 2) * (1 + GAP) * float(one.size[0])
        found.append(one.at(row, touching, float(target.low[2])))
    return found


def _settle(scene: Scene, standing: list[list[_Placed]]) -> None:
    """What was placed by the ground goes where it is: chairs face their table, the sun is in the sky."""
    put = {n for r in scene.relations if r.kind in PUT for n in (r.thing, *r.targets)}
    kinds = [CATEGORIES[thing.request.category] for thing in scene.things]
    for relation in scene.relations:
        if relation.kind == "beside" and kinds[relation.thing].leans:
            found = _against(standing[relation.targets[0]][0], standing[relation.thing])
            standing[relation.thing] = found
        for one, other in ((relation.thing, n) for n in relation.targets):
            for seat, table in ((one, other), (other, one)):
                if kinds[seat].faces == kinds[table].name and relation.kind not in {*PUT, "around"}:
                    standing[seat] = [_facing(chair, standing[table]) for chair in standing[seat]]
    grounded = [one for n, group in enumerate(standing) for one in group if not kinds[n].aloft]
    if grounded:
        top = max(float(one.high[2]) for one in grounded)
        for n, group in enumerate(standing):
            if kinds[n].aloft and n not in put:
                standing[n] = [one.at(float(one.middle[0]), float(one.middle[1]), top) for one in group]


def _facing(one: _Placed, others: Sequence[_Placed]) -> _Placed:
    """Turned where it stands, by quarters, with its front to the nearest of the others."""
    nearest = min(others, key=lambda other: float((other.middle - one.middle).norm()))
    x, y = (nearest.middle - one.middle)[:2].tolist()
    turned = one.turned(round(math.degrees(math.atan2(y, x)) / 90) * 90)
    return turned.at(float(one.middle[0]), float(one.middle[1]), float(one.low[2]))


def _between(
    standing: list[list[_Placed]], relation: Relation, targets: list[_Placed], copies: list[_Placed]
) -> list[_Placed]:
    """In the middle of the targets, which make room to the left and to the right."""
    gap = GAP * _larger(copies[0], targets)
    widths = [float(one.size[1]) + gap for one in copies]
    middle = float(torch.stack([t.middle for t in targets]).mean(0)[1])
    half, edge, found = len(targets) // 2, middle - sum(widths) / 2, []
    for one, width in zip(copies, widths, strict=True):
        found.append(one.at(float(targets[0].middle[0]), edge + width / 2, 0.0))
        edge += width
    right, left, moved = middle + sum(widths) / 2 + gap, middle - sum(widths) / 2 - gap, {}
    for k, target in enumerate(sorted(targets, key=lambda t: float(t.middle[1]))):
        width = float(target.size[1])
        if k < half:
            moved[id(target)] = target.at(float(target.middle[0]), left - width / 2, 0.0)
        else:
            moved[id(target)] = target.at(float(target.middle[0]), right + width / 2, 0.0)
            right += width + gap
    for number in relation.targets:
        standing[number] = [moved[id(one)] for one in standing[number]]
    return found


def _larger(one: _Placed, others: Sequence[_Placed]) -> float:
    """The longest side of the larger of neighbours."""
    return max(float(one.size.max()), *(float(other.size.max()) for other in others))
