"""Forms against closed forms: distances, fits, where they meet, and the edges of solids that are known."""

import numpy as np
import pytest

import diff3ds as ds
from diff3ds.curves.shapes.curve_set import sampled
from diff3ds.curves.shapes.primitives import Kind
from diff3ds.surfaces.form.exact_meets import exact_paths, onto
from diff3ds.surfaces.form.form_curves import form_curves
from diff3ds.surfaces.form.form_kinds import FREE, Form, FormKind, fits_of_patches, form
from diff3ds.surfaces.form.samples import Samples
from diff3ds.surfaces.form.search import _Search

AXIS = np.array([0.2, -0.5, 0.8])
EVERY = [
    form(FormKind.PLANE, (0.1, 0.2, 0.3), AXIS),
    form(FormKind.CYLINDER, (0.1, 0.2, 0.3), AXIS, 0.7),
    form(FormKind.SPHERE, (0.1, 0.2, 0.3), AXIS, 0.7),
    form(FormKind.CONE, (0.1, 0.2, 0.3), AXIS, 0.6, 0.4),
    form(FormKind.TORUS, (0.1, 0.2, 0.3), AXIS, 0.3, 0.0, 0.9),
]


def patch(one: Form, count: int, seed: int = 0) -> np.ndarray:
    """Points of a form, to one side of it."""
    rng = np.random.default_rng(seed)
    return one.projected(one.center + rng.uniform((0.2, 0.1, 0), (1, 0.9, 0.8), (count, 3)))


@pytest.mark.parametrize("one", EVERY, ids=lambda one: one.kind.name)
def test_normals_are_gradients_of_distances(one):
    x, step = np.random.default_rng(1).normal(size=(50, 3)), 1e-6
    numeric = [(one.distance(x + step * way) - one.distance(x - step * way)) / (2 * step) for way in np.eye(3)]
    assert np.allclose(one.normal(x), np.stack(numeric, 1), atol=1e-7)
    assert np.allclose(np.linalg.norm(one.normal(x), axis=1), 1)
    distance, cosine = one.measured(x, AXIS / np.linalg.norm(AXIS) + 0 * x)
    assert np.allclose(distance, one.distance(x), atol=1e-7)
    assert np.allclose(cosine, one.normal(x) @ AXIS / np.linalg.norm(AXIS), atol=1e-6)


@pytest.mark.parametrize("one", EVERY, ids=lambda one: one.kind.name)
def test_derivatives_of_a_fit_are_those_of_the_distance(one):
    x, step = np.random.default_rng(1).normal(size=(20, 3)), 1e-6
    _, rows, basis = one._linearised(x)
    for k in FREE[one.kind]:
        there, back = (one._moved(way * step * np.eye(8)[k], basis).distance(x) for way in (1, -1))
        assert np.allclose(rows[k], (there - back) / (2 * step), atol=1e-6), k


@pytest.mark.parametrize("one", EVERY, ids=lambda one: one.kind.name)
def test_patches_and_fits_find_the_form_again(one):
    x = patch(one, 400)
    fitted = next(f for f in fits_of_patches(x[None], one.normal(x)[None]) if f.kind == one.kind)[0]
    assert np.abs(fitted.distance(x)).max() < 1e-5
    noisy = x + 0.003 * np.random.default_rng(2).normal(size=x.shape)
    again = fitted.fitted(noisy, 0.01)
    assert np.abs(again.distance(x)).max() < 0.003
    if one.kind != FormKind.CONE:
        assert np.isclose(again.radius, one.radius, atol=0.01)


@pytest.mark.parametrize("one", EVERY, ids=lambda one: one.kind.name)
def test_compiled_measures_and_fits_are_those_of_numpy(one, monkeypatch):
    pytest.importorskip("diff3ds._kernels")
    x, ways = patch(one, 300) + 0.01 * np.random.default_rng(2).normal(size=(300, 3)), np.tile(AXIS, (300, 1))
    x[:5] += 0.5  # outliers
    numbers = np.stack([one._numbers(), one._numbers() + 0.01])
    two = form(one.kind, numbers[:, :3], numbers[:, 3:6], *numbers[:, 6:].T)
    held = frozenset(FREE[one.kind][-1:])
    compiled = one.measured(x, ways), two.measured(x, ways), two[1].fitted(x, 0.02), two[1].fitted(x, 0.02, held)
    monkeypatch.setattr("diff3ds.surfaces.form.form_kinds.kernels", lambda: None)
    numpy = one.measured(x, ways), two.measured(x, ways), two[1].fitted(x, 0.02), two[1].fitted(x, 0.02, held)
    for some, others in zip(compiled[:2], numpy[:2], strict=True):
        assert np.allclose(some, others, rtol=0, atol=1e-9)
        assert some[0].shape == others[0].shape
    for fitted, other in zip(compiled[2:], numpy[2:], strict=True):
        assert np.allclose(fitted._numbers(), other._numbers(), rtol=0, atol=1e-9)
    assert not np.allclose(compiled[2]._numbers(), two[1]._numbers(), atol=1e-3)


def test_the_compiled_largest_piece_is_that_of_scipy(monkeypatch):
    pytest.importorskip("diff3ds._kernels")
    rng = np.random.default_rng(0)
    search = _Search(Samples.of_points(block_with_hole(2000, 0.0, 0)), rng)
    some = [np.sort(rng.choice(2000, count, replace=False)) for count in (0, 1, 2, 60, 600, 1900)]
    compiled = [search._largest(rows) for rows in some]
    monkeypatch.setattr("diff3ds.surfaces.form.search.kernels", lambda: None)
    for rows, found in zip(some, compiled, strict=True):
        assert np.array_equal(found, search._largest(rows))
    assert 1 < len(compiled[3]) < 60
    assert 300 < len(compiled[4]) < 600


def test_meets_are_exact_conics_on_both_forms():
    z = (0.0, 0.0, 1.0)
    plane, slant = form(FormKind.PLANE, (0, 0, 0.2), z), form(FormKind.PLANE, (0, 0, 0.2), (0.3, 0.1, 1.0))
    cylinder, sphere = form(FormKind.CYLINDER, (0, 0, 0), z, 0.5), form(FormKind.SPHERE, (0, 0, 0), z, 0.7)
    cone, torus = form(FormKind.CONE, (0, 0, 0), z, 0.4, -0.3), form(FormKind.TORUS, (0, 0, 0.1), z, 0.2, 0, 0.5)
    beside, side = form(FormKind.CYLINDER, (0.4, 0.1, 0), z, 0.3), form(FormKind.PLANE, (0.2, 0, 0), (1.0, 0.2, 0))
    for a, b, kind, count in [
        (plane, slant, Kind.LINE, 1), (plane, cylinder, Kind.CIRCLE, 1), (slant, cylinder, Kind.ELLIPSE, 1),
        (side, cylinder, Kind.LINE, 2), (slant, sphere, Kind.CIRCLE, 1), (plane, cone, Kind.CIRCLE, 1),
        (slant, cone, Kind.ELLIPSE, 1), (plane, torus, Kind.CIRCLE, 2), (cylinder, cone, Kind.CIRCLE, 1),
        (cylinder, sphere, Kind.CIRCLE, 2), (cylinder, torus, Kind.CIRCLE, 2), (sphere, torus, Kind.CIRCLE, 2),
        (cylinder, beside, Kind.LINE, 2),
    ]:  # fmt: skip
        paths = exact_paths(a, b)
        assert [p.kind for p in paths] == [kind] * count, (a.kind, b.kind)
        for path in paths:
            x = path.at(np.linspace(-1, 2, 20))
            assert max(np.abs(a.distance(x)).max(), np.abs(b.distance(x)).max()) < 1e-9, (a.kind, b.kind)
            assert np.allclose(path.at(path.parameter(x)), x)


def test_onto_three_forms_is_their_corner():
    planes = [form(FormKind.PLANE, (0.1, 0.2, 0.3), way) for way in np.eye(3)]
    assert np.allclose(onto(planes, np.array([[0.4, -0.1, 0.5]])), [[0.1, 0.2, 0.3]])


def block_with_hole(count: int, noise: float, seed: int) -> np.ndarray:
    """Points of a block of 1 by .8 by .3 with a hole of radius .2 from its top to its bottom."""
    rng = np.random.default_rng(seed)
    half = np.array([0.5, 0.4, 0.15])
    x = rng.uniform(-half, half, (8 * count, 3))
    areas = np.array([0.8 * 0.3, 0.3, 0.8])
    side = rng.choice(3, len(x), p=areas / areas.sum())
    x[np.arange(len(x)), side] = half[side] * rng.choice([-1, 1], len(x))
    x = x[np.hypot(x[:, 0], x[:, 1]) > 0.2][:count]
    angle = rng.uniform(0, 2 * np.pi, count // 8)
    wall = np.column_stack([0.2 * np.cos(angle), 0.2 * np.sin(angle), rng.uniform(-0.15, 0.15, len(angle))])
    x = np.concatenate([x, wall])
    return x + noise * rng.normal(size=x.shape)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, pytest.param(0.003, marks=pytest.mark.slow)])
def test_edges_of_a_cloud_are_those_of_the_block_that_it_was_taken_from(noise):
    found = form_curves(Samples.of_points(block_with_hole(6000, noise, 0)))
    assert sorted(one.kind for one in found.found.forms) == [FormKind.PLANE] * 6 + [FormKind.CYLINDER]
    kinds = sorted(found.curves.kind.tolist())
    assert kinds == [Kind.LINE] * 12 + [Kind.CIRCLE] * 2
    corners = found.curves.points[found.curves.kind == Kind.LINE][:, [0, 3]].reshape(-1, 3).abs().numpy()
    assert np.abs(corners - [0.5, 0.4, 0.15]).max() < (1e-6 if noise == 0 else 0.004)
    for radius in (circle.radius for circle in found.curves.circles.values()):
        assert abs(radius - 0.2) < (1e-6 if noise == 0 else 0.002)
    # Twelve edges meet in eight corners, to the last digit.
    assert len(np.unique(np.round(corners * 1e9))) <= 24 * 3
    again = form_curves(Samples.of_points(block_with_hole(6000, noise, 0)))
    assert np.array_equal(found.curves.points.numpy(), again.curves.points.numpy())


def test_a_rounded_edge_of_a_mesh_is_one_line_where_its_faces_would_meet():
    # A block through a blurred distance field.
    from scipy.ndimage import gaussian_filter

    from diff3ds.surfaces.shape.level_set import level_set

    axis = np.linspace(-0.63, 0.63, 73)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1)
    away = np.abs(grid) - np.array([0.5, 0.4, 0.3])
    inside = -np.maximum(np.linalg.norm(np.maximum(away, 0), axis=-1), 0) - np.minimum(away.max(-1), 0)
    mesh = level_set(gaussian_filter(inside, 1.0), np.full(3, -0.63), float(axis[1] - axis[0]))
    found = form_curves(Samples.of_mesh(mesh))
    assert found.curves.kind.tolist() == [Kind.LINE] * 12
    corners = np.abs(sampled(found.curves)[:, [0, -1]].reshape(-1, 3))
    assert np.abs(corners - [0.5, 0.4, 0.3]).max() < 0.005


@pytest.mark.slow
def test_fillets_of_a_plate_have_its_radius_and_begin_where_its_sides_end():
    radius, noise, rng = 0.12, 0.002, np.random.default_rng(3)
    # Around a square of side one with rounded corners, and between two of them.
    x = rng.uniform(-0.5, 0.5, (60_000, 2))
    over = np.maximum(np.abs(x) - (0.5 - radius), 0)
    inside = np.linalg.norm(over, axis=1) < radius
    flat, rim = x[inside][:14_000], x[np.abs(np.linalg.norm(over, axis=1) - radius) < 0.01][:6000]
    inner = np.clip(rim, radius - 0.5, 0.5 - radius)
    rim = inner + radius * (rim - inner) / np.linalg.norm(rim - inner, axis=1, keepdims=True)
    points = np.concatenate(
        [
            np.column_stack([flat, rng.choice([-0.15, 0.15], len(flat))]),
            np.column_stack([rim, rng.uniform(-0.15, 0.15, len(rim))]),
        ]
    )
    curves = form_curves(Samples.of_points(points + noise * rng.normal(size=points.shape))).curves
    arcs = [c for c, kind in zip(sampled(curves), curves.kind.tolist(), strict=True) if kind == Kind.ARC]
    assert len(arcs) == 8
    for arc in arcs:
        middle = np.sign(arc.mean(0)) * [0.5 - radius, 0.5 - radius, 0.15]
        assert np.linalg.norm(arc - middle, axis=1) == pytest.approx(radius, abs=0.01 * radius)
        # It goes over into the sides without a corner.
        ends = np.abs(np.diff(arc, axis=0)[[0, -1]])
        assert (ends.max(1) > 30 * np.sort(ends, axis=1)[:, 1]).all()


def test_a_ball_has_one_form_and_no_edge():
    rng = np.random.default_rng(0)
    x = rng.normal(size=(4000, 3))
    found = form_curves(Samples.of_points(x / np.linalg.norm(x, axis=1, keepdims=True)))
    assert [one.kind for one in found.found.forms] == [FormKind.SPHERE]
    assert np.isclose(found.found.forms[0].radius, 1)
    assert len(found.curves) == 0


def test_noise_is_measured():
    x = block_with_hole(8000, 0.004, 1)
    assert 0.003 < Samples.of_points(x).noise < 0.005
    assert Samples.of_points(block_with_hole(8000, 0.0, 1)).noise < 1e-6


def test_clean_meshes_are_samples_too():
    box = ds.TriangleMesh(*_box())
    assert Samples.of_mesh(box).oriented
    assert len(Samples.of_mesh(box)) == len(box)


def _box() -> tuple[np.ndarray, np.ndarray]:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
