"""Contours of quadrics against closed forms, gradients against differences, unions against rays and meshes."""

from itertools import product

import numpy as np
import pytest
import torch
from solids import icosphere, lathe, together

import diff3ds as ds
from diff3ds.curves.bernstein_roots import bernstein_roots, quadratic_form
from diff3ds.surfaces.shape.quadrics import conics

DOUBLE = torch.float64


def number(*values: object) -> torch.Tensor:
    return torch.tensor(values[0] if len(values) == 1 else values, dtype=DOUBLE)


def random_solids() -> ds.Quadrics:
    """An ellipsoid, a cylinder and a cone under any affine maps."""
    g = torch.Generator().manual_seed(1)
    center, axes = torch.randn(3, 3, generator=g, dtype=DOUBLE), torch.randn(3, 3, 3, generator=g, dtype=DOUBLE)
    return ds.Quadrics(center, axes, number(1, 1, 0.3), torch.tensor([True, False, False]))


def view(*, orthographic: bool) -> ds.Cameras:
    return ds.orbit(35.0, 25.0, 9.0, size=256, **({"height": 6.0} if orthographic else {"fov": 45.0})).to(DOUBLE)


def eye(cameras: ds.Cameras) -> torch.Tensor:
    if cameras.orthographic:
        return torch.cat([-cameras.world_to_camera[0, 2, :3], number([0])])
    return torch.cat([cameras.centers[0], number([1])])


@pytest.mark.parametrize("orthographic", [False, True])
def test_contours_lie_on_their_quadrics_and_the_lines_of_sight_touch_there(orthographic):
    solids, cameras = random_solids(), view(orthographic=orthographic)
    found = conics(solids, cameras, 0)
    points = ds.bezier.evaluate(found.points, found.weights, torch.linspace(0, 1, 9, dtype=DOUBLE))
    points = torch.cat([points, torch.ones_like(points[..., :1])], -1)
    forms = solids.forms()[found.solid]
    assert float(torch.einsum("sma,sab,smb->sm", points, forms, points).abs().max()) < 1e-9
    contour = found.kind == 0
    assert contour.sum() == 4 + 2 + 2
    assert float(torch.einsum("sma,sab,b->sm", points, forms, eye(cameras))[contour].abs().max()) < 1e-9
    # Ends are where they should be.
    local = torch.einsum("sab,smb->sma", solids.to_local()[found.solid], points)
    assert torch.allclose(local[found.kind == 1][..., 2], number(-1.0))
    assert torch.allclose(local[found.kind == 2][..., 2], number(1.0))


def test_the_contour_of_a_sphere_is_the_circle_that_everyone_knows():
    ball = ds.Quadrics.ellipsoids(number([[1.0, 2, 3]]), number([0.5]))
    cameras = ds.look_at(number([[1.0, 2, 5]]), (1.0, 2, 3), up=(0.0, 1, 0))
    (sketch,) = ds.contours(ball, cameras)
    assert len(sketch) == 1
    assert bool(sketch.chains.closed.all())
    points = ds.bezier.evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 9, dtype=DOUBLE))
    # From 2 away the tangents touch a sphere of radius 1/2 in the plane 1/8 before its middle.
    assert torch.allclose(points[..., 2], number(3 + 1 / 8), atol=1e-12)
    away = torch.linalg.vector_norm(points[..., :2] - number([1, 2]), dim=-1)
    assert torch.allclose(away, number(0.5 * (1 - 1 / 16) ** 0.5), atol=1e-12)
    inside = ds.look_at(number([[1.0, 2, 3.1]]), (1.0, 2, 3), up=(0.0, 1, 0))
    assert len(ds.contours(ball, inside)[0]) == 0


def test_from_along_an_axis_there_is_no_division_by_nothing():
    solids = ds.Quadrics.concatenate(
        [
            ds.Quadrics.ellipsoids(number([[0.0, 0, 0]]), number([[1.0, 1, 1]])),
            ds.Quadrics.cylinders(number([[0.0, 0, -1]]), number([[0.0, 0, 1]]), 0.5),
        ]
    )
    for direction in ([5.0, 0, 0], [0.0, 5, 0], [0.0, 0, 5], [3.0, 3, 3]):
        center = solids.center.clone().requires_grad_()
        axes = solids.axes.clone().requires_grad_()
        moved = ds.Quadrics(center, axes, solids.taper, solids.is_round)
        found = conics(moved, ds.look_at(number([direction]), up=(0.1, 0.2, 0.3)), 0)
        assert bool(found.points.isfinite().all())
        for gradient in torch.autograd.grad(found.points.sum(), (center, axes)):
            assert bool(gradient.isfinite().all())


@pytest.mark.parametrize("orthographic", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_gradients_of_a_picture_agree_with_differences(orthographic):
    """Of quadrics and cameras through contours, cuts and the renderer; blurred, so that differences mean something."""
    start = [
        number([[0.0, 0, 0], [0.9, 0.2, 0.1]]),
        torch.diag_embed(number([[0.8, 0.7, 0.9], [0.5, 0.6, 0.5]])),
        ds.orbit(20.0, 15.0, 6.0, size=48, **({"height": 4.0} if orthographic else {"fov": 40.0})).to(DOUBLE),
    ]
    ramp = torch.linspace(0, 1, 48, dtype=DOUBLE)
    nothing = ds.Sketch(torch.zeros(0, 4, 3, dtype=DOUBLE))

    def loss(center: torch.Tensor, axes: torch.Tensor, shift: torch.Tensor) -> torch.Tensor:
        solids = ds.Quadrics(center, axes, number([1.0, 1]), torch.tensor([True, True]))
        pose = start[2].world_to_camera.clone()
        pose[:, :3, 3] = pose[:, :3, 3] + shift
        cameras = ds.Cameras(pose, start[2].intrinsics, start[2].size, orthographic=orthographic)
        (lines,) = ds.visible_lines(nothing, cameras, solids)
        # Curves in which solids meet are fitted anew at every step, which differences see.
        conics = lines.sketch[[k for k, kind in enumerate(lines.kinds) if kind == "contour"]]
        drawn = ds.render(conics, cameras, antialiasing=ds.Analytic(blur=3.0))
        return (drawn.alpha[0] * (ramp[:, None] + 2 * ramp**2)).sum()

    values = [start[0], start[1], number([0.0, 0, 0])]
    given = [v.clone().requires_grad_() for v in values]
    gradients = torch.autograd.grad(loss(*given), given)
    g = torch.Generator().manual_seed(0)
    for k, (value, gradient) in enumerate(zip(values, gradients, strict=True)):
        way = torch.randn(value.shape, generator=g, dtype=DOUBLE) * 1e-4
        ends = [[v + s * way if i == k else v for i, v in enumerate(values)] for s in (1, -1)]
        with torch.no_grad():
            difference = (loss(*ends[0]) - loss(*ends[1])) / 2
        assert float((gradient * way).sum()) == pytest.approx(float(difference), rel=2e-3)


def test_an_end_that_is_cut_moves_as_the_cut_does():
    """Two balls on the x axis seen along y: their contours meet in x = 1/2 in the middle plane between them."""
    gap = number(1.0).requires_grad_()
    center = torch.stack([number([0.0, 0, 0]), torch.stack([gap, number(0.0), number(0.0)])])
    solids = ds.Quadrics.ellipsoids(center, torch.ones(2, dtype=DOUBLE))
    cameras = ds.look_at(number([[0.5, -50.0, 0]]), (0.5, 0, 0), height=4.0)
    (sketch,) = ds.contours(solids, cameras)
    (lines,) = ds.visible_lines(ds.Sketch(torch.zeros(0, 4, 3, dtype=DOUBLE)), cameras, solids)
    assert lines.kinds == ("contour", "contour", "intersection")
    sketch = sketch[:2]
    meeting = sketch.points[:, [0, -1]].reshape(-1, 3)
    meeting = meeting[(meeting[:, 0].detach() - 0.5).abs() < 1e-9]
    assert len(meeting) == 4
    assert torch.allclose(meeting[:, 2].abs(), number(0.75**0.5))
    # x = gap / 2, z = sqrt(1 - gap² / 4).
    (along,) = torch.autograd.grad(meeting[0, 0], gap, retain_graph=True)
    (up,) = torch.autograd.grad(meeting[0, 2].abs(), gap)
    assert float(along) == pytest.approx(0.5)
    assert float(up) == pytest.approx(-0.25 / 0.75**0.5)


def test_solids_meet_in_curves_that_lie_on_both_and_move_with_them():
    """Two balls meet in a circle, of radius sqrt(1 - gap² / 4) at half the gap."""
    gap = number(1.0).requires_grad_()
    center = torch.stack([number([0.0, 0, 0]), torch.stack([gap, number(0.0), number(0.0)])])
    cameras = ds.orbit(40.0, 20.0, 8.0, size=512, fov=30.0).to(DOUBLE)
    (lines,) = ds.visible_lines(
        ds.Sketch(torch.zeros(0, 4, 3, dtype=DOUBLE)),
        cameras,
        ds.Quadrics.ellipsoids(center, torch.ones(2, dtype=DOUBLE)),
    )
    (k,) = [k for k, kind in enumerate(lines.kinds) if kind == "intersection"]
    circle = lines.sketch[k]
    assert bool(circle.chains.closed.all())
    points = ds.bezier.evaluate(circle.points, circle.weights, torch.linspace(0, 1, 9, dtype=DOUBLE)).reshape(-1, 3)
    # 0.1 px in the picture: at this distance and size a thousandth.
    assert torch.allclose(points[:, 0], number(0.5), atol=2e-3)
    radius = torch.linalg.vector_norm(points[:, 1:], dim=1)
    assert torch.allclose(radius, number(0.75**0.5), atol=2e-3)
    (change,) = torch.autograd.grad(radius.mean() + 10 * points[:, 0].mean(), gap)
    assert float(change) == pytest.approx(-0.25 / 0.75**0.5 + 5, rel=1e-2)
    # The balls hide a part of it.
    seen = lines.strokes(True, "intersection")
    share = ds.bezier.length(seen.points, seen.weights).sum() / ds.bezier.length(circle.points, circle.weights).sum()
    assert 0.2 < float(share.detach()) < 0.8


def scene() -> tuple[ds.Quadrics, ds.TriangleMesh]:
    """Balls, a cylinder and a cone that go through each other, and a fine mesh of them."""
    solids = ds.Quadrics.concatenate(
        [
            ds.Quadrics.ellipsoids(number([[0.0, 0, 0], [0, 0, 1]]), number([[1.0, 1, 0.8], [0.5, 0.6, 0.5]])),
            ds.Quadrics.cylinders(number([[0.0, 0, -0.9]]), number([[0.0, 0, -1.6]]), 0.3),
            ds.Quadrics.cylinders(number([[0.0, -0.4, 1]]), number([[0.0, -1.6, 1.4]]), 0.2, 0.0),
        ]
    )
    ball, faces = icosphere(5)
    rod = lathe(np.array([0.0, 1, 1, 0]), np.array([-1.0, -1, 1, 1]), 256)
    tip = lathe(np.array([0.0, 1, 0]), np.array([-1.0, -1, 1]), 256)
    shapes = [(ball, faces), (ball, faces), rod, tip]
    placed = [
        (points @ axes.numpy().T + center.numpy(), corners)
        for (points, corners), axes, center in zip(shapes, solids.axes, solids.center, strict=True)
    ]
    return solids, ds.TriangleMesh(*together(*placed))


@pytest.mark.slow
@pytest.mark.parametrize("orthographic", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_what_a_union_hides_is_what_a_mesh_of_it_hides(orthographic):
    solids, mesh = scene()
    g = torch.Generator().manual_seed(2)
    points = torch.randn(40, 4, 3, generator=g, dtype=DOUBLE) * 1.2
    sketch = ds.Sketch(points)
    right = total = 0.0
    for azimuth, elevation in ((10.0, 5.0), (140.0, 40.0)):
        how = {"height": 5.0} if orthographic else {"fov": 40.0}
        cameras = ds.orbit(azimuth, elevation, 7.0, size=400, **how).to(DOUBLE)
        answers = []
        for surface in (solids, mesh):
            (lines,) = ds.visible_lines(sketch, cameras, surface, contours=False)
            t = torch.linspace(0.001, 0.999, 200).double().numpy()
            place = np.searchsorted(
                lines.parts.segment + lines.parts.start, (np.arange(40)[:, None] + t).ravel(), "right"
            )
            answers.append(lines.parts.visible[place - 1])
        assert 0.2 < answers[0].mean() < 0.9
        right += (answers[0] == answers[1]).sum()
        total += answers[0].size
    # They differ by the facets of the mesh, and by how near to it a stroke lies on it.
    assert right / total > 0.985


def test_the_lines_of_a_union_are_cut_and_hidden_as_rays_say():
    solids, _ = scene()
    forms = solids.forms().numpy()
    local = solids.to_local().numpy()
    cameras = ds.orbit(40.0, 20.0, 7.0, size=400, fov=40.0).to(DOUBLE)
    (lines,) = ds.visible_lines(ds.Sketch(torch.zeros(0, 4, 3, dtype=DOUBLE)), cameras, solids)
    assert set(lines.kinds) == {"contour", "crease", "intersection"}
    steps = np.linspace(0, 1, 4001)[1:, None]
    for visible, kind in product((True, False), ("contour", "crease")):
        strokes = lines.strokes(visible, kind)
        length = ds.bezier.length(strokes.points, strokes.weights)
        kept = length > 0.02
        middle = ds.bezier.evaluate(strokes.points[kept], strokes.weights[kept], number([0.3, 0.6])).reshape(-1, 3)
        for point in middle.detach().numpy():
            way = point + steps * (cameras.centers[0].numpy() - point)
            x = np.column_stack([way, np.ones(len(way))])
            value = np.einsum("pa,nab,pb->np", x, forms, x)
            z = np.einsum("nab,pb->nap", local, x)[:, 2]
            within = (value < -1e-3) & ((np.abs(z) < 1 - 1e-3) | solids.is_round.numpy()[:, None])
            assert within.any() != visible
            # None lies inside of another solid.
            at = np.append(point, 1.0)
            deep = np.einsum("a,nab,b->n", at, forms, at) < -1e-6
            z = (local @ at)[:, 2]
            assert not (deep & ((np.abs(z) < 1 - 1e-6) | solids.is_round.numpy())).any()


def test_a_belt_around_a_ball_goes_behind_it_where_the_contour_is():
    ball = ds.Quadrics.ellipsoids(number([[0.0, 0, 0]]), number([1.0]))
    points, weights = ds.bezier.circle((0.0, 0, 0), 1.0)
    belt = ds.Sketch(points, weights, chains=ds.Chains.of([len(points)], closed=True))
    cameras = ds.look_at(number([[4.0, 0, 1e-3]]))
    (lines,) = ds.visible_lines(belt, cameras, ball, contours=False)
    seen = lines.strokes(True)
    assert len(seen) == 1
    angle = 2 * np.arccos(1 / 4)
    assert float(ds.bezier.length(seen.points, seen.weights).sum()) == pytest.approx(angle, abs=1e-3)


def test_roots_in_bernstein_form_are_all_found():
    rng = np.random.default_rng(0)
    roots = np.sort(rng.uniform(-0.5, 1.5, (500, 6)), 1)
    control = np.stack([np.stack([-roots, 1 - roots], -1)[:, k] for k in range(6)], 1)
    rows = []
    for factors in control:
        product = np.array([1.0])
        for factor in factors:
            # In Bernstein form scaled by binomials products are convolutions.
            product = np.convolve(product, factor)
        binomials = np.array([1, 6, 15, 20, 15, 6, 1])
        rows.append(product / binomials)
    row, t = bernstein_roots(np.array(rows))
    for k in range(500):
        expected = roots[k][(roots[k] > 0) & (roots[k] < 1)]
        assert np.sort(t[row == k]) == pytest.approx(expected, abs=1e-6)
    # Zero has none, a root at an end is one.
    row, t = bernstein_roots(np.array([[0.0, 0, 0], [0.0, 1, 1], [1.0, 1, 0]]))
    assert sorted(zip(row.tolist(), t.tolist(), strict=True)) == [(1, 0.0), (2, 1.0)]
    line = np.array([[[0.0, 0, 0, 1], [2, 0, 0, 1]]])
    (_, t) = bernstein_roots(quadratic_form(line, np.diag([1.0, 1, 1, -1])[None]))
    assert t == pytest.approx([0.5])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ds.Quadrics.ellipsoids(torch.zeros(3), 1.0), r"center must have shape \(N, 3\)"),
        (lambda: ds.Quadrics.ellipsoids(number([[0.0, 0, float("nan")]]), 1.0), "center must be finite"),
        (lambda: ds.Quadrics.ellipsoids(number([[0.0, 0, 0]]), number([[1.0, 1, 0]])), "must not lie in one plane"),
        (lambda: ds.Quadrics.cylinders(number([[0.0, 0, 0]]), number([[0.0, 0, 1]]), 1.0, -1.0), "taper must not be"),
        (lambda: ds.Quadrics.cylinders(number([[0.0, 0, 0]]), number([[0.0, 0, 0]]), 1.0), "must not lie in one plane"),
        (lambda: ds.Quadrics.concatenate([]), "at least one part"),
    ],
)
def test_what_is_no_quadric_is_refused(make, message):
    with pytest.raises((TypeError, ValueError), match=message):
        make()
