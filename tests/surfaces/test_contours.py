"""Contours of meshes of smooth solids, against the true contours of those solids in the picture."""

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree
from solids import box, icosphere, lathe, torus

import diff3ds as ds
from diff3ds.page.picture import Picture
from diff3ds.surfaces.lines.contours import walks
from diff3ds.surfaces.lines.fit_picture import fit_chains

RING, TUBE = 1.0, 0.4


def pixels(sketch: ds.Sketch, cameras: ds.Cameras) -> np.ndarray:
    """Points along all strokes in the picture."""
    points = ds.bezier.evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 9, dtype=torch.float64))
    ones = torch.ones_like(points[..., :1])
    return cameras.seen(torch.cat([points, ones], -1) @ cameras.projection[0].mT)[0].reshape(-1, 2).numpy()


def view(*, orthographic: bool = False, azimuth: float = 25.0, elevation: float = 35.0) -> ds.Cameras:
    how = {"height": 3.2} if orthographic else {"fov": 45.0}
    return ds.orbit(azimuth, elevation, 4.0, size=512, **how).to(torch.float64)


def torus_contour(cameras: ds.Cameras) -> np.ndarray:
    """n·(C - x) = 0 on a torus is A cos v + B sin v = D for every u, in pixels."""
    u = np.linspace(0, 2 * np.pi, 20001)
    if cameras.orthographic:
        d = -cameras.world_to_camera[0, 2, :3].numpy()
        a, b, right = d[0] * np.cos(u) + d[1] * np.sin(u), np.full_like(u, d[2]), np.zeros_like(u)
    else:
        c = cameras.centers[0].numpy()
        a, b, right = c[0] * np.cos(u) + c[1] * np.sin(u) - RING, np.full_like(u, c[2]), np.full_like(u, TUBE)
    places = []
    for sign in (-1, 1):
        v = np.arctan2(b, a) + sign * np.arccos(right / np.hypot(a, b))
        out = RING + TUBE * np.cos(v)
        places.append(np.stack([out * np.cos(u), out * np.sin(u), TUBE * np.sin(v)], 1))
    points = torch.from_numpy(np.concatenate(places))
    projected = torch.cat([points, torch.ones_like(points[:, :1])], 1) @ cameras.projection[0].mT
    return cameras.seen(projected)[0].numpy()


def test_a_sphere_has_one_round_contour_and_its_error_falls_with_the_square_of_the_edges():
    cameras = view()
    # Seen from distance 4, a sphere of radius 1 has a contour at the angle with sine 1/4.
    radius = float(cameras.intrinsics[0, 0, 0]) * np.tan(np.arcsin(1 / 4))
    errors = []
    for levels in (1, 2, 3, 4, 5):
        (sketch,) = ds.contours(ds.TriangleMesh(*icosphere(levels)), cameras, tolerance=0.01)
        assert len(sketch) == 1
        assert bool(sketch.chains.closed.all())
        errors.append(np.abs(np.linalg.norm(pixels(sketch, cameras) - 256, axis=1) - radius).max())
    assert errors[-1] < 0.1
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert ((ratios > 2.5) & (ratios < 7)).all(), ratios
    assert (errors[0] / errors[-1]) ** (1 / 4) == pytest.approx(4, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("orthographic", [False, True])
def test_a_torus_has_two_contours_where_they_are(orthographic):
    cameras = view(orthographic=orthographic)
    errors = []
    for around in (64, 256):
        (sketch,) = ds.contours(ds.TriangleMesh(*torus(RING, TUBE, around, around // 2)), cameras, tolerance=0.1)
        assert len(sketch) == 2
        assert bool(sketch.chains.closed.all())
        errors.append(cKDTree(torus_contour(cameras)).query(pixels(sketch, cameras))[0].max())
    assert errors[1] < 0.25
    assert errors[0] > 4 * errors[1]


def test_strokes_are_few_where_a_mesh_is_fine():
    (sketch,) = ds.contours(ds.TriangleMesh(*icosphere(5)), view())
    assert len(sketch.points) <= 8


def test_a_cylinder_seen_from_the_side_is_a_rectangle_and_a_box_a_hexagon():
    walls = lathe(np.array([0.0, 0.5, 0.5, 0]), np.array([-1.0, -1, 1, 1]), 48)
    cameras = view(elevation=0)
    (sketch,) = ds.contours(ds.TriangleMesh(*walls), cameras)
    assert len(sketch) == 1
    assert bool(sketch.chains.closed.all())
    # The tangents from distance 4 to a circle of radius 1/2 touch it where the cosine to the camera is 1/8.
    toward = cameras.centers[0, :2] / 4
    points = ds.bezier.evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 9, dtype=torch.float64))
    side = points[points[..., 2].abs() < 0.9]
    assert torch.allclose(side[..., :2] @ toward, torch.tensor(0.5 / 8, dtype=torch.float64), atol=2e-3)
    # The ends turn over on the side of the camera, where the wall is seen and the end is not.
    assert float((points[..., :2] @ toward).min()) > 0.5 / 8 - 2e-3
    mesh = ds.TriangleMesh(*box())
    (outline,) = ds.contours(mesh, view())
    assert bool(outline.chains.closed.all())
    assert float(ds.bezier.length(outline.points, outline.weights).sum()) == pytest.approx(12, abs=1e-6)
    # Strokes that draw the creases make contours along them needless.
    edges = ds.Sketch(torch.from_numpy(mesh.vertices[mesh.edges[mesh.is_crease]]))
    (lines,) = ds.visible_lines(edges, view(), mesh)
    assert set(lines.kinds) == {"stroke"}
    (lines,) = ds.visible_lines(edges[:3], view(), mesh)
    assert "contour" in lines.kinds


def test_all_views_have_contours_of_their_own_and_what_is_behind_a_camera_has_none():
    mesh = ds.TriangleMesh(*icosphere(3))
    cameras = ds.orbit([0.0, 90, 180], 0.0, 3.0).to(torch.float64)
    sketches = ds.contours(mesh, cameras)
    assert len(sketches) == 3
    for k, sketch in enumerate(sketches):
        assert torch.allclose(sketch.points[:, 0] @ cameras.centers[k], torch.tensor(1.0).double(), atol=0.05)
    away = ds.look_at(torch.tensor([[3.0, 0, 0]]), (9.0, 0, 0)).to(torch.float64)
    assert len(ds.contours(mesh, away)[0]) == 0
    # From within a closed ball nothing turns away.
    assert len(ds.contours(mesh, ds.look_at(torch.tensor([[0.1, 0, 0]])).to(torch.float64))[0]) == 0


def test_a_tolerance_is_positive():
    with pytest.raises(ValueError, match="tolerance must be a positive number of pixels, got 0"):
        ds.contours(ds.TriangleMesh(*box()), view(), tolerance=0)


def test_corners_of_a_contour_stay_sharp_where_few_strokes_are_drawn():
    """Whichever edges of a box are drawn, contours run along the others; and straight sides of a slot stay straight."""
    mesh = ds.TriangleMesh(*box())
    sharp = torch.from_numpy(mesh.vertices[mesh.edges[mesh.is_crease]])
    generator = np.random.default_rng(0)
    cameras = view(azimuth=70.0)
    for _ in range(8):
        rows = generator.choice(12, 6, replace=False)
        (lines,) = ds.visible_lines(ds.Sketch(sharp[rows]), cameras, mesh)
        assert farthest(contour_of(lines), sharp) < 1e-9
    turn = np.linspace(0, np.pi, 9)
    half = np.stack([np.cos(turn), np.sin(turn) + 2], 1)
    rim = np.concatenate([half, -half])
    count = len(rim)
    points = np.concatenate([np.column_stack([rim, np.full(count, z)]) for z in (-0.3, 0.3)])
    k = np.arange(count)
    n = (k + 1) % count
    fan = np.stack([np.zeros(count - 2, int), k[1:-1], n[1:-1]], 1)
    walls = [np.stack([k, n, n + count], 1), np.stack([k, n + count, k + count], 1)]
    slot = ds.TriangleMesh(points, np.concatenate([*walls, fan[:, ::-1], fan + count]))
    rims = torch.from_numpy(slot.vertices[slot.edges[slot.is_crease]])
    (lines,) = ds.visible_lines(NOTHING, ds.orbit(90.0, 60.0, 12.0, size=512).to(torch.float64), slot)
    outline = contour_of(lines)
    dense = ds.bezier.evaluate(outline.points, outline.weights, torch.linspace(0, 1, 65, dtype=torch.float64))
    straight = dense.reshape(-1, 3)[dense.reshape(-1, 3)[:, 1].abs() < 1.9]
    assert len(straight) > 60
    # Uprights from rim to rim lie at the rounds.
    assert float((straight[:, 0].abs() - 1).abs().max()) < 1e-9
    assert len(rims) == 2 * count


NOTHING = ds.Sketch(torch.zeros(0, 4, 3, dtype=torch.float64))


def contour_of(lines):
    return lines.sketch[[i for i, kind in enumerate(lines.kinds) if kind == "contour"]]


def farthest(sketch, edges):
    """The largest distance of strokes from edges, given by their ends."""
    t = torch.linspace(0, 1, 17, dtype=torch.float64)
    points = ds.bezier.evaluate(sketch.points, sketch.weights, t).reshape(-1, 1, 3)
    way = edges[:, 1] - edges[:, 0]
    share = (((points - edges[:, 0]) * way).sum(-1) / (way**2).sum(-1)).clamp(0, 1)
    return float((points - edges[:, 0] - share[..., None] * way).norm(dim=-1).amin(1).max())


def test_walks_go_along_each_step_once_from_ends_first_and_close_where_they_began():
    rng = np.random.default_rng(1)
    for count in range(2, 40):
        # A chain, a loop, and some steps anywhere, which branch and come back.
        chain = np.arange(count - 1)[:, None] + [0, 1]
        loop = count + (np.arange(count)[:, None] + [0, 1]) % count
        steps = np.concatenate([chain, loop, rng.integers(0, 2 * count, (count // 5, 2))])
        steps = rng.permutation(2 * count)[steps][rng.permutation(len(steps))]
        found = walks(steps, 2 * count)
        assert sorted(step for _, along, _ in found for step in along) == list(range(len(steps)))
        degree = np.bincount(steps.ravel(), minlength=2 * count)
        ends = [int(degree[nodes[0]] == 1) for nodes, _, _ in found]
        assert ends == sorted(ends, reverse=True)
        for nodes, along, closed in found:
            around = [*nodes, nodes[0]] if closed else nodes
            pairs = np.stack([around[:-1], around[1:]], 1)
            assert (np.sort(pairs, 1) == np.sort(steps[along], 1)).all()
            assert closed or around[0] != around[-1]


def test_a_chain_that_is_finer_than_pixels_is_fitted_by_few_of_its_points_and_all_have_their_places():
    cameras = ds.orbit(20.0, 30.0, 5.0, fov=40.0, size=128).to(torch.float64)
    picture = Picture.of(cameras, 0)
    angle = np.linspace(0, 2 * np.pi, 4001)
    points = np.stack([np.cos(angle), np.sin(angle), 0.3 * np.cos(3 * angle)], 1)
    first, corner = np.array([0, len(points)]), np.array([1234])
    fitted = fit_chains(points, first, corner, picture, 0.05, spacing=0.5)
    assert len(fitted.start) < 30
    assert (fitted.start[1:] == fitted.stop[:-1]).all()
    assert 1234 in fitted.start
    # Each point lies where its cubic is at its parameter.
    axis, place = fitted.places
    assert (np.diff(axis) >= 0).all()
    cubic = np.minimum(axis.astype(int), len(fitted.control) - 1)
    t = (axis - cubic)[:, None]
    weights = np.concatenate([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], 1)
    value = np.einsum("qk,qki->qi", weights, fitted.control[cubic])
    seen, _ = picture.seen(value[:, :3] / value[:, 3:])
    expected, _ = picture.seen(points[place.astype(int)])
    assert np.linalg.norm(seen - expected, axis=1).max() < 0.2
