"""Members of the library: in the ball, repeatable, symmetric as declared, all different, every attribute visible."""

import functools
import importlib
import itertools
import pkgutil

import pytest
import torch
from sweep import sweep

import diff3ds as ds
from diff3ds.bezier import evaluate, length
from diff3ds.library import CATEGORIES, kinds, member

ONE_EACH = [(name, a) for name, c in CATEGORIES.items() for a in ((), *((a.name,) for a in c.attributes))]
# Of each the first is quick.
SEEDS = pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
# Few enough to draw and to distil, enough to tell what it is.
STROKES = (8, 64)


@functools.cache
def drawn(name, attributes=(), seed=0):
    return member(name, torch.Generator().manual_seed(seed), attributes)


@functools.cache
def on(name, attributes=(), seed=0):
    """Points along the strokes of a member, (N, 33, 3)."""
    sketch = drawn(name, attributes, seed).sketch
    return evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 33))


def hausdorff(a, b):
    """Largest distance from a point of one drawing to the nearest of the other."""
    distance = torch.cdist(a.reshape(-1, 3), b.reshape(-1, 3))
    return float(torch.maximum(distance.amin(0).max(), distance.amin(1).max()))


def both_ways(sketch):
    """Every stroke as a row of numbers, forwards and backwards: (2, N, 16)."""
    strokes = torch.cat([sketch.points, sketch.weights[..., None]], -1)
    return torch.stack([strokes.flatten(1), strokes.flip(1).flatten(1)])


def test_there_are_at_least_thirty_two():
    assert len(CATEGORIES) >= 32
    assert all(name == category.name for name, category in CATEGORIES.items())


def test_no_file_is_left_off_the_list():
    modules = [importlib.import_module(f"diff3ds.library.kinds.{m.name}") for m in pkgutil.iter_modules(kinds.__path__)]
    found = {id(module.CATEGORY) for module in modules if hasattr(module, "CATEGORY")}
    assert found == {id(category) for category in CATEGORIES.values()}


def test_faces_lie_in_the_frame_of_the_strokes():
    """Of a house all corners of the body are ends of strokes."""
    one = drawn("house")
    ends = one.sketch.points[:, [0, 3]].double().reshape(-1, 3)
    assert float(torch.cdist(one.faces.reshape(-1, 3), ends).amin(1).max()) < 1e-6
    # One looks through what these are made of.
    assert {name for name in CATEGORIES if not drawn(name).solids} == {"bicycle", "glasses", "ladder"}


@pytest.mark.parametrize("name", ["cow", "person", "train"])
def test_what_lies_behind_a_thing_is_hidden_and_what_lies_before_is_not(name):
    """From the side, where the left half lies behind the right one; the thing reaches as far as its wires."""
    one = drawn(name)
    camera = ds.orbit(90.0, 0.0, 3.0, fov=40.0, size=160)
    surface = ds.TriangleMesh.of_triangles(one.faces)
    wires = ds.render(one.sketch, camera).alpha[0]
    strokes = ds.render(one.sketch, camera, surface=surface, contours=False).alpha[0]
    assert 0.3 < float(strokes.sum() / wires.sum()) < 0.8
    seen = ds.render(one.sketch, camera, surface=surface).alpha[0]
    for axis in (0, 1):
        whole, left = ((picture > 0.5).any(axis).nonzero().flatten() for picture in (wires, seen))
        assert int((whole[[0, -1]] - left[[0, -1]]).abs().max()) <= 2


@pytest.mark.slow
@sweep(("name", "attributes"), ONE_EACH)
def test_faces_are_no_larger_than_the_thing(name, attributes):
    faces = drawn(name, attributes).faces
    assert bool(faces.isfinite().all())
    assert not len(faces) or float(faces.norm(dim=-1).max()) < 1.0


@SEEDS
@sweep(("name", "attributes"), ONE_EACH)
def test_members_fill_the_unit_ball(name, attributes, seed):
    sketch, points = drawn(name, attributes, seed).sketch, on(name, attributes, seed)
    assert bool(points.isfinite().all())
    farthest = float(points.norm(dim=-1).max())
    assert 0.94 < farthest < 0.952
    # The extents are measured at 65 points of a stroke: both ends to .0003 of the size.
    low, high = points.flatten(0, 1).amin(0), points.flatten(0, 1).amax(0)
    torch.testing.assert_close(low, -high, atol=2e-3, rtol=0)
    assert STROKES[0] <= len(sketch) <= STROKES[1]
    assert sketch.points.shape[1:] == (4, 3)
    assert float(length(sketch.points, sketch.weights).min()) > 0.005


@pytest.mark.slow
@sweep("name", CATEGORIES)
def test_all_attributes_that_go_together_can_be_drawn(name):
    for attributes in CATEGORIES[name].combinations():
        assert 0.94 < float(on(name, attributes).norm(dim=-1).max()) < 0.952
        assert drawn(name, attributes).attributes == attributes


# Without attributes, and with one.
@pytest.mark.parametrize("some", [False, pytest.param(True, marks=pytest.mark.slow)])
@sweep(("name", "attributes"), ONE_EACH)
def test_one_seed_gives_the_same_bytes_and_another_other_proportions(name, attributes, some):
    if bool(attributes) != some:
        return
    first = drawn(name, attributes, 0).sketch
    again = member(name, torch.Generator().manual_seed(0), attributes).sketch
    assert all(torch.equal(value, again.tensors()[key]) for key, value in first.tensors().items())
    assert hausdorff(on(name, attributes, 0), on(name, attributes, 1)) > 0.005


@sweep(("name", "attributes"), ONE_EACH)
def test_no_stroke_is_drawn_twice(name, attributes):
    forwards, backwards = both_ways(drawn(name, attributes).sketch)
    same = torch.minimum(torch.cdist(forwards, forwards), torch.cdist(forwards, backwards)).triu(1)
    assert int((same < 1e-4).sum()) == len(same) * (len(same) + 1) // 2


@SEEDS
@sweep(("name", "attributes"), [(n, a) for n, a in ONE_EACH if CATEGORIES[n].mirror])
def test_members_are_symmetric_where_declared(name, attributes, seed):
    sign = torch.ones(3)
    sign["xy".index(CATEGORIES[name].mirror)] = -1
    sketch = drawn(name, attributes, seed).sketch
    strokes = both_ways(sketch)
    mirrored = strokes[0] * torch.cat([sign, torch.ones(1)]).repeat(4)
    distance = (mirrored[:, None] - strokes.flatten(0, 1)[None]).abs().amax(-1)
    assert float(distance.amin(1).max()) < 1e-5


def test_most_categories_are_symmetric():
    assert sum(category.mirror is not None for category in CATEGORIES.values()) >= 0.75 * len(CATEGORIES)


@pytest.mark.parametrize(("name", "count"), [("mug", 3), ("lamp", 4), ("wine glass", 2), ("clock", 3), ("car", 8)])
def test_circles_are_exact(name, count):
    sketch, points = drawn(name).sketch, on(name)
    halves = (sketch.weights - torch.tensor([1, 1 / 3, 1 / 3, 1])).abs().amax(1) < 1e-6
    assert int(halves.sum()) == 2 * count
    for circle in points[halves]:
        middle = (circle[0] + circle[-1]) / 2
        distance = (circle - middle).norm(dim=-1)
        assert float(distance.max() - distance.min()) < 1e-6


@SEEDS
@sweep(("name", "attributes"), [(n, a) for n, a in ONE_EACH if a])
def test_every_attribute_is_seen(name, attributes, seed):
    # A pixel in the 64 that the coarsest prior sees; a bar across a windmill's sail is the finest.
    assert hausdorff(on(name, (), seed), on(name, attributes, seed)) > 0.03


def test_categories_differ_from_each_other():
    for a, b in itertools.combinations(CATEGORIES, 2):
        assert hausdorff(on(a)[:, ::4], on(b)[:, ::4]) > 0.15, (a, b)


@pytest.mark.usefixtures("unchecked")
def test_what_is_unknown_is_refused_with_what_is_known():
    generator = torch.Generator()
    with pytest.raises(ValueError, match="no category is named 'char'; did you mean chair"):
        member("char", generator)
    with pytest.raises(ValueError, match="chair has no attribute 'arm rests'; did you mean armrests"):
        member("chair", generator, ("arm rests",))
    with pytest.raises(ValueError, match="chair has no attribute 'zzz'; there are armrests, high back"):
        member("chair", generator, ("zzz",))
    with pytest.raises(ValueError, match="no table has all of round, square"):
        member("table", generator, ("square", "round"))
    for attributes in ("round", 3):
        with pytest.raises(ValueError, match=f"attributes must be a collection of names, got {attributes!r}"):
            member("table", generator, attributes)
    with pytest.raises(ValueError, match="no category is named 3; there are airplane"):
        member(3, generator)
    with pytest.raises(TypeError, match=r"generator must be a torch.Generator, such as .*, got 3"):
        member("chair", 3)


@pytest.mark.parametrize("attributes", [("panels",), ("stripes",), ()])
def test_lines_on_a_ball_are_not_hidden_by_it(attributes):
    """Each is seen from one of six sides: none goes through the ball, which would hide it from all."""
    ball = member("ball", torch.Generator().manual_seed(0), attributes)
    surface = ds.TriangleMesh.of_triangles(ball.faces.numpy())
    cameras = ds.orbit([0, 60, 120, 180, 240, 300], [15, -25, 15, 40, -25, 15], 2.2, size=128)
    seen = torch.zeros(len(ball.sketch))
    for lines in ds.visible_lines(ball.sketch, cameras, surface, contours=False):
        parts = lines.parts[lines.parts.visible]
        shares = torch.from_numpy(parts.stop - parts.start).float()
        share = torch.zeros(len(seen)).index_add_(0, torch.from_numpy(parts.segment), shares)
        seen = torch.maximum(seen, share)
    assert seen.min() > 0.4


@pytest.mark.parametrize("attributes", [(), ("panels",), ("stripes",)])
def test_lines_of_a_ball_are_on_it(attributes):
    """Where they were inside, hidden lines would swallow them."""
    sketch = member("ball", torch.Generator().manual_seed(1), attributes).sketch
    points = evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 33)).reshape(-1, 3)
    radii = torch.linalg.vector_norm(points, dim=1)
    assert radii.max() - radii.min() < 1e-4


def test_icing_runs_down_on_the_cake():
    sketch = member("cake", torch.Generator().manual_seed(1)).sketch
    points = evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 33))
    radii = torch.linalg.vector_norm(points[..., :2], dim=-1)
    on = radii.amax(1) - radii.amin(1) < 1e-4
    # The plate's two strokes, those of two rings, four lines up, and eight bows: all there are.
    assert on.all()
