"""Sketches: what they accept, what they say of what they refuse, and that their operations keep the drawing."""

import math
import pickle
from dataclasses import fields, replace

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

import diff3ds as ds
from diff3ds.optimize.checkpoint import read_checkpoint, start, write_checkpoint
from diff3ds.sketch import of_parts, parts_of
from diff3ds.tasks.exact_prior.folder_phrase import Name
from diff3ds.tasks.exact_prior.sketch_folder import FolderMember

POINTS = torch.arange(24, dtype=torch.float32).reshape(2, 4, 3)


def _sketch(count: int, controls: int = 4, width_space: str = "image", seed: int = 0) -> ds.Sketch:
    """A float64 sketch in which every value is its own."""
    g = torch.Generator().manual_seed(seed)

    def uniform(*shape: int) -> torch.Tensor:
        return torch.rand(*shape, generator=g, dtype=torch.float64)

    return ds.Sketch(
        uniform(count, controls, 3) - 0.5,
        uniform(count, controls) + 0.5,
        0.01 + 0.02 * uniform(count),
        uniform(count, 3),
        0.3 + 0.7 * uniform(count),
        width_space,
    )


def test_defaults():
    sketch = ds.Sketch(POINTS)
    assert len(sketch) == 2
    assert sketch.weights.tolist() == [[1, 1, 1, 1]] * 2
    torch.testing.assert_close(sketch.width, torch.full((2,), 0.006))
    assert sketch.color.tolist() == [[0, 0, 0]] * 2
    assert sketch.opacity.tolist() == [1, 1]
    assert sketch.width_space == "image"


def test_numbers_do_for_all_strokes():
    sketch = ds.Sketch(POINTS.double(), width=0.1, color=(1.0, 0.5, 0.0), opacity=0.25)
    assert sketch.width.tolist() == [0.1, 0.1]
    assert sketch.color.tolist() == [[1, 0.5, 0]] * 2
    assert sketch.opacity.tolist() == [0.25, 0.25]
    assert {v.dtype for v in sketch.tensors().values()} == {torch.float64}
    assert ds.Sketch(POINTS, color=torch.tensor([1.0, 0.5, 0.0])).color.tolist() == [[1, 0.5, 0]] * 2


@pytest.mark.parametrize("controls", [2, 3, 4])
def test_no_strokes(controls):
    sketch = ds.Sketch(torch.zeros(0, controls, 3))
    assert len(sketch) == 0
    assert sketch.color.shape == (0, 3)


def _set(shape, index, value):
    tensor = torch.ones(shape)
    tensor[index] = value
    return tensor


NAN, INF = math.nan, math.inf
BAD_VALUES = [
    ("points", _set((3, 4, 3), (2, 1, 0), NAN), "points of stroke 2 must be finite, got nan"),
    ("points", _set((3, 4, 3), (1, 3, 2), INF), "points of stroke 1 must be finite, got inf"),
    ("weights", _set((3, 4), (2, 3), 0.0), "weights of stroke 2 must be finite and positive, got 0.0"),
    ("weights", _set((3, 4), (0, 1), -2.5), "weights of stroke 0 must be finite and positive, got -2.5"),
    ("weights", _set((3, 4), (1, 1), INF), "weights of stroke 1 must be finite and positive, got inf"),
    ("weights", _set((3, 4), (1, 0), NAN), "weights of stroke 1 must be finite and positive, got nan"),
    ("width", _set(3, 1, -0.5), "width of stroke 1 must be finite and not negative, got -0.5"),
    ("width", _set(3, 2, NAN), "width of stroke 2 must be finite and not negative, got nan"),
    ("width", -1.0, "width of stroke 0 must be finite and not negative, got -1.0"),
    ("color", _set((3, 3), (2, 2), NAN), "color of stroke 2 must be finite, got nan"),
    ("opacity", _set(3, 2, 1.5), r"opacity of stroke 2 must be in \[0, 1\], got 1.5"),
    ("opacity", _set(3, 0, -0.25), r"opacity of stroke 0 must be in \[0, 1\], got -0.25"),
    ("opacity", _set(3, 1, NAN), r"opacity of stroke 1 must be in \[0, 1\], got nan"),
]


@pytest.mark.parametrize(("name", "value", "message"), BAD_VALUES)
def test_bad_values_are_refused_by_field_stroke_and_value(name, value, message):
    fields = {"points": torch.ones(3, 4, 3), name: value}
    with pytest.raises(ValueError, match=message):
        ds.Sketch(**fields)


BAD_SHAPES = [
    ("points", torch.ones(4, 3), ValueError, r"K = 2, 3 or 4, got \(4, 3\): add a leading stroke axis with points\[No"),
    ("points", torch.ones(2, 5, 3), ValueError, r"points must have shape \(N, K, 3\), K = 2, 3 or 4, got \(2, 5, 3\)"),
    ("points", torch.ones(2, 1, 3), ValueError, r"got \(2, 1, 3\)"),
    ("points", torch.ones(2, 4, 2), ValueError, r"got \(2, 4, 2\)"),
    ("points", torch.ones(2, 4, 3, dtype=torch.int64), TypeError, "points must be a floating .* got torch.int64"),
    ("points", [[1.0]], TypeError, "points must be a floating point tensor, got list"),
    ("weights", torch.ones(3, 3), ValueError, r"weights must have shape \(3, 4\) for 3 strokes, got \(3, 3\)"),
    ("weights", torch.ones(4), ValueError, r"weights must have shape \(3, 4\) for 3 strokes, got \(4,\)"),
    ("weights", torch.ones(3, 4).double(), TypeError, "weights must have the dtype of points, torch.float32, got torc"),
    ("width", torch.ones(2), ValueError, r"width must have shape \(3,\) for 3 strokes, got \(2,\)"),
    ("width", torch.ones(3, dtype=torch.int32), TypeError, "width must have the dtype of points, .* got torch.int32"),
    ("width", "thin", TypeError, "width must be a number, a list of numbers or a tensor, got str"),
    ("width", torch.ones(3, device="meta"), ValueError, "width must be on the device of points, cpu, got meta"),
    ("color", torch.ones(3), None, ""),
    ("color", torch.ones(3, 4), ValueError, r"color must have shape \(3, 3\) for 3 strokes, got \(3, 4\)"),
    ("color", (1.0, 0.0), ValueError, r"color must have shape \(3, 3\) for 3 strokes, got \(2,\)"),
    ("color", None, TypeError, "color must be a number, a list of numbers or a tensor, got None"),
    ("opacity", torch.ones(3, 1), ValueError, r"opacity must have shape \(3,\) for 3 strokes, got \(3, 1\)"),
    ("width_space", "screen", ValueError, 'width_space must be "image" or "world", got \'screen\''),
]


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(("name", "value", "error", "message"), BAD_SHAPES)
def test_bad_shapes_are_refused_by_field(name, value, error, message):
    fields = {"points": torch.ones(3, 4, 3), name: value}
    if error is None:
        ds.Sketch(**fields)
        return
    with pytest.raises(error, match=message):
        ds.Sketch(**fields)


def test_sketches_are_frozen():
    sketch = ds.Sketch(POINTS)
    with pytest.raises(AttributeError, match="cannot assign to field 'width'"):
        sketch.width = torch.ones(2)


def test_values_changed_in_place_are_found():
    sketch = ds.Sketch(POINTS.clone())
    sketch.points[1, 2, 0] = NAN
    with pytest.raises(ValueError, match="points of stroke 1 must be finite, got nan"):
        sketch.check_values()


# Selection and conversion


def test_strokes_are_selected():
    sketch = _sketch(5, width_space="world")
    for index, rows in (
        (2, [2]),
        (-1, [4]),
        (slice(1, 4, 2), [1, 3]),
        ([3, 0], [3, 0]),
        (torch.tensor([False, True, False, False, True]), [1, 4]),
    ):
        some = sketch[index]
        assert some.width_space == "world"
        for name, value in some.tensors().items():
            assert torch.equal(value, sketch.tensors()[name][rows]), name


def _full(count: int) -> ds.Sketch:
    """A sketch of strokes of two segments that has a value of its own in every field."""
    points, weights = _sketch(2 * count).points, _sketch(2 * count, seed=1).weights
    chains = ds.Chains.of([2] * count)
    looks = _sketch(count, width_space="world")
    fixed = torch.arange(count) % 2 == 0
    return replace(looks, points=chains.joined(points), weights=weights, chains=chains, fixed=fixed)


def test_other_curves_keep_the_look_of_their_strokes():
    sketch = _full(3)
    parts = sketch.select([2, 0, 2], points=sketch.points[:3], weights=sketch.weights[:3], chains=None)
    assert len(parts) == 3
    for name in ("width", "color", "opacity", "fixed"):
        assert torch.equal(getattr(parts, name), getattr(sketch, name)[[2, 0, 2]]), name
    assert parts.width_space == "world"
    plain = sketch.segments()
    assert torch.equal(plain.points, sketch.points)
    assert plain.fixed.tolist() == [True, True, False, False, True, True]
    along = sketch.with_widths_along()
    assert torch.equal(along.segments().width, along.width)
    with pytest.raises(ValueError, match="must be given with such widths"):
        along.select([0], points=sketch.points[:1], weights=sketch.weights[:1], chains=None)


def test_fields_are_replaced():
    sketch = _full(2)
    wide = sketch.replace(width=0.5)
    assert wide.width.tolist() == [0.5, 0.5]
    others = [name for name in sketch.tensors() if name != "width"]
    assert all(torch.equal(getattr(wide, name), getattr(sketch, name)) for name in others)
    assert torch.equal(wide.fixed, sketch.fixed)
    assert wide.width_space == "world"
    with pytest.raises(ValueError, match="opacity of stroke 0"):
        sketch.replace(opacity=2.0)


@pytest.mark.parametrize("chosen", [1, [1], slice(1, 2), torch.tensor([False, True, False]), torch.tensor([1])])
def test_some_strokes_get_another_colour(chosen):
    sketch = _full(3)
    red = sketch.with_color(chosen, (1.0, 0.0, 0.0))
    assert red.color[1].tolist() == [1, 0, 0]
    assert torch.equal(red.color[[0, 2]], sketch.color[[0, 2]])
    assert torch.equal(red.points, sketch.points)
    with pytest.raises(ValueError, match="color must have shape"):
        sketch.with_color(chosen, (1.0, 0.0))
    with pytest.raises(IndexError):
        sketch.with_color(3, (1.0, 0.0, 0.0))


def test_to_and_detach():
    sketch = _sketch(3, width_space="world")
    single = sketch.to(torch.float32)
    assert {v.dtype for v in single.tensors().values()} == {torch.float32}
    assert single.width_space == "world"
    learned = ds.Sketch(sketch.points.clone().requires_grad_(), width=sketch.width)
    assert learned.points.requires_grad
    assert not learned.detach().points.requires_grad
    assert learned.to(torch.float32).points.requires_grad
    assert sketch.to("cpu").to(torch.device("cpu")).points.device.type == "cpu"


# Operations

CAMERAS = ds.orbit([20.0, 130.0], [10.0, 40.0], 2.0, size=48).to(torch.float64)


def _images(sketch: ds.Sketch, cameras: ds.Cameras = CAMERAS) -> torch.Tensor:
    r = ds.render(sketch, cameras, backend="reference")
    return torch.cat([r.color, r.alpha[..., None], r.depth[..., None]], -1)


def _similarity(seed: int, scale: float, mirrored: bool = False) -> torch.Tensor:
    g = torch.Generator().manual_seed(seed)
    rotation = torch.linalg.qr(torch.randn(3, 3, generator=g, dtype=torch.float64)).Q
    rotation = rotation * (rotation.det().sign() * (-1 if mirrored else 1))
    matrix = torch.eye(4, dtype=torch.float64)
    matrix[:3, :3], matrix[:3, 3] = scale * rotation, torch.randn(3, generator=g, dtype=torch.float64)
    return matrix


@pytest.mark.parametrize("scale", [0.2, 1.0, 7.0])
@pytest.mark.parametrize("width_space", ["image", "world"])
def test_moved_with_its_cameras_a_sketch_looks_the_same(width_space, scale):
    """World widths are lengths: they scale. Image widths are not."""
    sketch, matrix = _sketch(6, width_space=width_space), _similarity(1, scale)
    moved = sketch.transform(matrix)
    expected = sketch.width * scale if width_space == "world" else sketch.width
    torch.testing.assert_close(moved.width, expected, rtol=1e-14, atol=0)
    # Rigid cameras: the scale goes to distances, so depth scales and nothing else.
    rigid = torch.diag(torch.tensor([scale, scale, scale, 1], dtype=torch.float64)) @ CAMERAS.world_to_camera
    cameras = ds.Cameras(rigid @ torch.linalg.inv(matrix), CAMERAS.intrinsics, CAMERAS.size, CAMERAS.near * scale)
    before, after = _images(sketch), _images(moved, cameras)
    assert before[..., 3].sum() > 50
    before[..., 4] *= scale
    torch.testing.assert_close(after, before, rtol=1e-9, atol=1e-9)


def test_transform_moves_points_and_mirrors_too():
    sketch, matrix = _sketch(3), _similarity(2, 2.0, mirrored=True)
    expected = torch.cat([sketch.points, torch.ones(3, 4, 1)], -1) @ matrix.T
    torch.testing.assert_close(sketch.transform(matrix).points, expected[..., :3])


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: m[:3], "matrix must be a 4x4 similarity"),
        (lambda m: m * torch.tensor([1.0, 2.0, 1.0, 1.0]), "matrix must be a 4x4 similarity"),
        (lambda m: m + torch.tensor([[0, 0.3, 0, 0]] + [[0.0] * 4] * 3), "matrix must be a 4x4 similarity"),
        (lambda m: m * 0, "matrix must be a 4x4 similarity"),
        (lambda m: m * NAN, "matrix must be a 4x4 similarity"),
        (lambda m: m + torch.tensor([[0.0] * 4] * 3 + [[0, 0, 1, 0.0]]), "last row of matrix must be"),
    ],
)
def test_other_maps_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        _sketch(2).transform(change(_similarity(0, 1.0)))


@pytest.mark.parametrize("controls", [2, 3])
def test_elevation_keeps_the_drawing(controls):
    sketch = _sketch(5, controls)
    raised = sketch.elevate()
    assert raised.points.shape == (5, 4, 3)
    torch.testing.assert_close(_images(raised), _images(sketch), rtol=1e-9, atol=1e-9)
    t = torch.linspace(0, 1, 9, dtype=torch.float64)
    torch.testing.assert_close(
        ds.bezier.evaluate(raised.points, raised.weights, t), ds.bezier.evaluate(sketch.points, sketch.weights, t)
    )
    with pytest.raises(ValueError, match="degree must lie between the curve's degree 3 and 3, got 2"):
        raised.elevate(2)


def test_concatenation_keeps_strokes_in_order_and_raises_degrees():
    parts = [_sketch(2, 2, seed=1), _sketch(3, 4, seed=2), _sketch(1, 3, seed=3)]
    joined = ds.Sketch.concatenate(parts)
    assert joined.points.shape == (6, 4, 3)
    start = 0
    for part in parts:
        mine, start = joined[start : start + len(part)], start + len(part)
        for name in ("width", "color", "opacity"):
            assert torch.equal(getattr(mine, name), getattr(part, name))
        raised = part.elevate(3)
        assert torch.equal(mine.points, raised.points)
        assert torch.equal(mine.weights, raised.weights)
    assert ds.Sketch.concatenate(parts[:1]).points.shape == (2, 2, 3)
    assert ds.Sketch.concatenate([parts[0], parts[2]]).points.shape == (3, 3, 3)
    assert ds.Sketch.concatenate([_sketch(1, width_space="world")] * 2).width_space == "world"


def test_concatenation_refuses_what_does_not_fit():
    with pytest.raises(ValueError, match="expected at least one sketch, got none"):
        ds.Sketch.concatenate([])
    with pytest.raises(ValueError, match="widths in image and in world units cannot be joined"):
        ds.Sketch.concatenate([_sketch(1), _sketch(1, width_space="world")])


# Marks


def _marked(*fixed, **more):
    return replace(_sketch(len(fixed), **more), fixed=torch.tensor(fixed))


def test_marks_of_strokes_that_stay_are_kept():
    sketch = _marked(True, False, True)
    assert sketch[[2, 1]].fixed.tolist() == [True, False]
    assert sketch[1].fixed is None
    assert sketch[torch.tensor([False, True, True])].fixed.tolist() == [False, True]
    assert sketch.to(torch.float64).fixed.tolist() == [True, False, True]
    for same in (sketch.detach(), sketch.elevate(), sketch.with_widths_along(), sketch.transform(torch.eye(4))):
        assert same.fixed.tolist() == [True, False, True]
    assert ds.Sketch.concatenate([_sketch(1), sketch]).fixed.tolist() == [False, True, False, True]
    assert ds.Sketch.concatenate([_sketch(1), _sketch(2)]).fixed is None
    assert _marked(False, False).fixed is None
    lines = torch.tensor([[[0.0, 0, 0], [1, 0, 0]], [[1, 0, 0], [2, 0, 0]], [[3, 0, 0], [4, 0, 0]]])
    chained = ds.Sketch(lines, chains=ds.Chains.of([2, 1]), fixed=torch.tensor([True, False]))
    assert chained.segments().fixed.tolist() == [True, True, False]
    assert chained[[1, 0]].fixed.tolist() == [False, True]


def test_parts_hold_every_field(tmp_path):
    """And so do the files and processes that hand a sketch on by its parts."""
    sketch = ds.Sketch(
        torch.arange(36.0).reshape(3, 4, 3),
        torch.rand(3, 4) + 1,
        width=torch.rand(3, 4),
        color=torch.rand(3, 3),
        opacity=torch.rand(3),
        width_space="world",
        chains=ds.Chains.of([1, 1, 1], [False, False, False]),
        fixed=torch.tensor([False, True, False]),
        names=["a", "", "b"],
        kinds=["crease", "", "border"],
        importance=torch.rand(3),
    )
    closed = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0]])[None]
    more = {"names": ["ring"], "kinds": ["contour"], "importance": torch.rand(1)}
    ring = ds.Sketch(closed, width_space="world", chains=ds.Chains.of([1], [True]), **more)
    sketch = ds.Sketch.concatenate([sketch, ring])
    given = {field.name: getattr(sketch, field.name) for field in fields(ds.Sketch)}
    assert all(value is not None for value in given.values())
    ds.save(tmp_path / "a.json", sketch)
    write_checkpoint(tmp_path / "a.safetensors", start(sketch, 0), {})
    member = pickle.loads(pickle.dumps(FolderMember(sketch, Name("chair", (), "chair"))))
    copy = pickle.loads(pickle.dumps(sketch))
    kept = of_parts(*parts_of(sketch)), ds.load(tmp_path / "a.json"), member.sketch, copy
    for other in (*kept, read_checkpoint(tmp_path / "a.safetensors").sketch):
        for name, value in given.items():
            got = getattr(other, name)
            if isinstance(value, ds.Chains):
                assert torch.equal(got.stroke, value.stroke)
                assert torch.equal(got.closed, value.closed)
            elif isinstance(value, torch.Tensor):
                assert torch.equal(got, value)
            else:
                assert got == value


def test_names_of_strokes_are_kept():
    sketch = replace(_sketch(3), names=["a", "", "c"])
    assert sketch[[2, 1]].names == ("c", "")
    assert sketch[1].names is None
    assert sketch[1:].names == sketch[torch.tensor([False, True, True])].names == ("", "c")
    for same in (
        sketch.to(torch.float64),
        sketch.elevate(),
        sketch.with_widths_along(),
        sketch.transform(torch.eye(4)),
    ):
        assert same.names == ("a", "", "c")
    assert ds.Sketch.concatenate([_sketch(1), sketch]).names == ("", "a", "", "c")
    assert replace(sketch, names=["", "", ""]).names is None
    lines = torch.tensor([[[0.0, 0, 0], [1, 0, 0]], [[1, 0, 0], [2, 0, 0]], [[3, 0, 0], [4, 0, 0]]])
    chained = ds.Sketch(lines, chains=ds.Chains.of([2, 1]), names=["a", "b"])
    assert chained.segments().names == ("a", "a", "b")
    assert chained[[1, 0]].names == ("b", "a")
    kinds = ("crease", "contour")
    assert replace(chained, kinds=kinds)[[1]].kinds == ("contour",)
    assert ds.Sketch.concatenate([_sketch(1), replace(chained, kinds=kinds).segments()]).kinds == (
        "",
        "crease",
        "crease",
        "contour",
    )


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("names", "error", "message"),
    [
        ("ab", TypeError, "names must be strings, one a stroke, or None, got 'ab'"),
        (["a", 1], TypeError, r"names must be strings, one a stroke, or None, got \['a', 1\]"),
        (["a"], ValueError, "names must be 2, one a stroke, got 1"),
    ],
)
def test_wrong_names_are_refused(names, error, message):
    with pytest.raises(error, match=message):
        replace(_sketch(2), names=names)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("fixed", "error", "message"),
    [
        ([True, False], TypeError, "fixed must be a tensor of torch.bool or None, got list"),
        (torch.ones(2), TypeError, "got a tensor of torch.float32"),
        (torch.ones(3, dtype=torch.bool), ValueError, r"fixed must have shape \(2,\) for 2 strokes, got \(3,\)"),
    ],
)
def test_marks_that_do_not_fit_are_refused(fixed, error, message):
    with pytest.raises(error, match=message):
        replace(_sketch(2), fixed=fixed)


# Random sketches


@given(st.integers(0, 2**31))
def test_random_sketches_repeat(seed):
    one, two = (ds.Sketch.random(5, generator=torch.Generator().manual_seed(seed)) for _ in range(2))
    assert torch.equal(one.points, two.points)
    other = ds.Sketch.random(5, generator=torch.Generator().manual_seed(seed + 1))
    assert not torch.equal(one.points, other.points)


def test_random_does_not_touch_the_global_generator(generator):
    before = torch.get_rng_state()
    ds.Sketch.random(5, generator=generator)
    assert torch.equal(torch.get_rng_state(), before)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"count": -1}, ValueError, "count must be a whole number, not negative, got -1"),
        ({"count": 1.5}, ValueError, "count must be a whole number, not negative, got 1.5"),
        ({"generator": 3}, TypeError, "generator must be a torch.Generator, such as .*manual_seed.*, got 3"),
        ({"radius": NAN}, ValueError, "radius must be a finite number, not negative, got nan"),
        ({"radius": -1}, ValueError, "radius must be a finite number, not negative, got -1"),
        ({"extent": "x"}, TypeError, "extent must be a number, a list of numbers or a tensor, got str"),
        ({"width": NAN}, ValueError, "width of stroke 0 must be finite"),
    ],
)
def test_bad_random_sketches_are_refused_by_name(generator, change, error, message):
    with pytest.raises(error, match=message):
        ds.Sketch.random(**{"generator": generator, **change})


def test_random_strokes_fill_the_ball(generator):
    """Centres uniform in the ball: the cube of their distance over the radius is uniform in [0, 1]."""
    sketch = ds.Sketch.random(4000, generator=generator, radius=2.0, extent=0.2, width=0.01)
    assert sketch.points.shape == (4000, 4, 3)
    assert sketch.width.unique().tolist() == pytest.approx([0.01])
    centers = sketch.points.mean(1)
    share = (torch.linalg.vector_norm(centers, dim=-1) / 2) ** 3
    # Deciles of 4,000: 400 with a standard deviation of 19; the jitter of the points blurs the last one.
    counts = torch.histc(share, 10, 0, 1)
    assert ((counts[:9] - 400).abs() < 5 * 19).all()
    assert centers.mean(0).abs().max() < 5 * 2 * math.sqrt(0.2 / 4000)
    chord = torch.linalg.vector_norm(sketch.points[:, 3] - sketch.points[:, 0], dim=-1)
    assert abs(chord.mean() - 0.4) < 0.02
    assert len(ds.Sketch.random(generator=generator)) == 56
