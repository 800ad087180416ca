"""Hidden lines against brute force: every face asked about every point, with no index and no outlines."""

import numpy as np
import pytest
import torch
from solids import box, icosphere, lathe, together, torus

import diff3ds as ds
from diff3ds.page.boxes import BoxIndex, in_order
from diff3ds.page.picture import Picture
from diff3ds.surfaces.hidden.mesh_view import MeshView
from diff3ds.surfaces.shape.nearest import Nearest
from diff3ds.surfaces.shape.smooth_surface import SmoothMesh, smooth_for_pictures

PROFILE = np.array([[0, -1], [0.8, -1], [0.8, -0.5], [0.3, -0.4], [0.3, 0.6], [1, 0.9], [0, 1]])
SCENES = {
    "box": box(),
    "lathe": lathe(PROFILE[:, 0], PROFILE[:, 1], 24),
    # They go through each other.
    "three": together(box(), box((1.5, -0.5, -3), (2, 2, 2)), torus(2.2, 0.3, 48, 24)),
    "open": lathe(np.array([0.5, 1.0, 0.7]), np.array([-1.0, 0, 1]), 16),
}


def hidden(mesh: ds.TriangleMesh, cameras: ds.Cameras, points: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Möller and Trumbore's test of every face but those at each point's edge."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    u, v = b - a, c - a
    answers = np.zeros(len(points), bool)
    forward = cameras.world_to_camera[0, 2, :3].numpy()
    for k, point in enumerate(points):
        d = -100 * forward if cameras.orthographic else cameras.centers[0].numpy() - point
        p = np.cross(d, v)
        det = (u * p).sum(1)
        inverse = 1 / np.where(det == 0, np.inf, det)
        w = point - a
        q = np.cross(w, u)
        s, t, r = (w * p).sum(1) * inverse, (q * d).sum(1) * inverse, (v * q).sum(1) * inverse
        hit = (s >= -1e-12) & (t >= -1e-12) & (s + t <= 1 + 1e-12) & (r > 1e-9) & (r < 1)
        own = [(mesh.faces[hit] == vertex).any(1) for vertex in edge[k]]
        answers[k] = (~(own[0] & own[1])).any()
    return answers


@pytest.mark.parametrize("orthographic", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", SCENES)
def test_edges_are_hidden_where_every_ray_says_so(name, orthographic):
    mesh = ds.TriangleMesh(*SCENES[name])
    edges = mesh.edges[mesh.is_crease | mesh.is_border]
    sketch = ds.Sketch(torch.from_numpy(mesh.vertices[edges]))
    rng = np.random.default_rng(3)
    how = {"height": 5.0} if orthographic else {"fov": 40.0}
    for _ in range(2):
        cameras = ds.orbit(rng.uniform(0, 360), rng.uniform(-60, 60), 7.0, size=500, **how).to(torch.float64)
        (lines,) = ds.visible_lines(sketch, cameras, mesh, contours=False)
        count = 30 if len(edges) < 50 else 8
        share = (np.arange(count * len(edges)) % count + rng.uniform(0, 1, count * len(edges))) / count
        row = np.repeat(np.arange(len(edges)), count)
        points = mesh.vertices[edges[row, 0]] * (1 - share)[:, None] + mesh.vertices[edges[row, 1]] * share[:, None]
        parts = lines.parts
        seen = parts.visible[np.searchsorted(parts.segment + parts.start, row + share, "right") - 1]
        wrong = seen == hidden(mesh, cameras, points, edges[row])
        length = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)[row]
        assert length[wrong].sum() <= 0.002 * length.sum()
        assert 0.2 < seen.mean() < 1


def test_strokes_are_cut_exactly_where_a_box_begins_to_hide_them():
    mesh = ds.TriangleMesh(*box())
    cameras = ds.look_at(torch.tensor([[0.0, -6, 0]]), size=400).to(torch.float64)
    stroke = torch.tensor([[[-3.0, 3, 0.2], [3, 3, 0.2]]], dtype=torch.float64)
    (lines,) = ds.visible_lines(ds.Sketch(stroke), cameras, mesh, contours=False)
    # From 6 away, the front of the box at 5 and the stroke at 9: it hides x from -9/5 to 9/5.
    assert lines.parts.visible.tolist() == [True, False, True]
    assert lines.parts.stop.tolist() == pytest.approx([0.2, 0.8, 1.0], abs=1e-12)
    # A stroke into the box is hidden from where it goes through the wall.
    stroke = torch.tensor([[[0.3, -3.0, 0.2], [0.3, 1, 0.2]]], dtype=torch.float64)
    (lines,) = ds.visible_lines(ds.Sketch(stroke), cameras, mesh, contours=False)
    assert lines.parts.visible.tolist() == [True, False]
    # What is nearer to a surface than 1/256 of its size lies on it.
    assert lines.parts.stop[0] == pytest.approx(0.5, abs=1.01 * 2 / 256 / 4)


def test_contours_of_a_torus_are_seen_outside_and_hidden_behind_its_front():
    mesh = ds.TriangleMesh(*torus(1.0, 0.4, 128, 64))
    cameras = ds.orbit(20.0, 20.0, 5.0, size=512, fov=40.0).to(torch.float64)
    (lines,) = ds.visible_lines(ds.Sketch(torch.zeros(0, 4, 3, dtype=torch.float64)), cameras, mesh)
    assert set(lines.kinds) == {"contour"}
    visible = lines.strokes(True)
    # The outline is one closed stroke; of the hole's contour the far arc is seen: from here the near rim of the hole
    # hides a part of what lies behind it.
    assert visible.chains.closed.sum() == 1
    assert len(visible) >= 2
    inner = visible[~visible.chains.closed]
    assert len(lines.strokes(False)) >= 1
    assert float(inner.points[:, [0, -1], :2].norm(dim=2).max()) < 1.01


def test_where_a_solid_bends_towards_the_line_of_sight_its_contour_is_hidden_on_coarse_meshes_too():
    """There rays leave out the very faces, within two rings, that hide it."""
    cameras = ds.orbit(20.0, 20.0, 5.0, size=512, fov=40.0).to(torch.float64)
    lengths = []
    for around in (20, 128):
        mesh = ds.TriangleMesh(*torus(1.0, 0.4, around, around // 2))
        (lines,) = ds.visible_lines(ds.Sketch(torch.zeros(0, 4, 3, dtype=torch.float64)), cameras, mesh)
        seen = lines.strokes(True)
        lengths.append(float(ds.bezier.length(seen.points, seen.weights).sum()))
    assert lengths[0] < 1.01 * lengths[1]


@pytest.mark.slow
def test_turning_a_little_changes_little():
    """No line flickers: what is seen of a ball with a belt changes by the turn, not by the facets."""
    mesh = ds.TriangleMesh(*icosphere(4))
    t = torch.linspace(0, 2 * torch.pi, 9, dtype=torch.float64)[:-1]
    points, weights = ds.bezier.circle((0.0, 0, 0.3), 0.91**0.5)
    belt = ds.Sketch(points, weights, chains=ds.Chains.of([len(points)], closed=True))
    shares = []
    for azimuth in t.rad2deg().tolist():
        cameras = ds.orbit([azimuth, azimuth + 0.1], 20.0, 4.0, size=512).to(torch.float64)
        for lines in ds.visible_lines(belt, cameras, mesh):
            strokes = lines.strokes(True, "stroke")
            assert len(strokes) == 1
            shares.append(float(ds.bezier.length(strokes.points, strokes.weights).sum()))
    assert max(shares) - min(shares) < 0.1


@pytest.mark.parametrize("compiled", [True, False])
def test_boxes_around_points_and_boxes_that_meet_are_found_and_no_others(compiled, monkeypatch):
    if not compiled:
        monkeypatch.setattr("diff3ds.page.boxes.kernels", lambda: None)
    # As few at a time as can be: what comes in many runs is the same.
    monkeypatch.setattr("diff3ds.page.boxes.MOST_PAIRS", 7)
    rng = np.random.default_rng(0)
    for dimensions in (2, 3):
        low = rng.uniform(-1, 1, (300, dimensions))
        high = low + rng.uniform(0, 1, (300, 1)) ** 6 * rng.uniform(0, 1, (300, dimensions))
        index = BoxIndex.of(low, high, 0.05)
        points = rng.uniform(-1.2, 1.5, (200, dimensions))
        inside = ((points[:, None] >= low) & (points[:, None] <= high)).all(2)
        found = np.zeros_like(inside)
        found[index.around(points)] = True
        assert inside.sum() > 10
        assert (found == inside).all()
        nowhere = np.array([[np.nan] * dimensions, [np.inf] * dimensions, [-1e300] * dimensions])
        assert len(index.around(nowhere)[0]) == 0
        ends = points + rng.uniform(0, 0.05, (200, dimensions))
        meet = ((ends[:, None] >= low) & (points[:, None] <= high)).all(2)
        found[:] = False
        found[index.meeting(points, ends)] = True
        assert (found == meet).all()
    assert len(BoxIndex.of(np.zeros((0, 2)), np.zeros((0, 2)), 1.0).around(np.zeros((3, 2)))[0]) == 0


def test_rows_by_rising_keys_are_those_of_a_stable_sort():
    rng = np.random.default_rng(0)
    for count in (0, 1, 7, 5000):
        keys = rng.integers(-(1 << 60), 1 << 60, 50)[rng.integers(0, 50, count)]
        assert np.array_equal(in_order(keys), np.argsort(keys, kind="stable"))


@pytest.mark.skipif("cpu" not in ds.available_backends(), reason="installed without the compiled kernels")
@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("smooth", [False, True])
def test_points_on_and_beside_a_mesh_are_hidden_by_the_kernel_as_without_it(orthographic, smooth, monkeypatch):
    mesh = ds.TriangleMesh(*together(icosphere(3), box((-0.2, -1.7, -0.6), (1.5, 0.05, 0.3))))
    mesh = smooth_for_pictures(mesh, 512) if smooth else mesh
    assert isinstance(mesh, SmoothMesh) == smooth
    how = {"height": 4.0} if orthographic else {"fov": 40.0}
    # A camera near by, so that some triangles are cut at the near plane.
    picture = Picture.of(ds.orbit(35.0, 20.0, 1.4, size=300, **how).to(torch.float64), 0)
    rng = np.random.default_rng(3)
    corners = mesh.vertices[mesh.faces[rng.integers(len(mesh), size=3000)]]
    points = (corners * rng.dirichlet([0.2] * 3, 3000)[..., None]).sum(1) + rng.normal(0, 0.01, (3000, 3))
    moved, own = Nearest(mesh, 0.02).places(points)
    on = own[:, 0] >= 0

    def answers() -> list[np.ndarray]:
        view = MeshView(mesh, picture)
        of_rings = [view.in_front(moved[on], own[on], rings) for rings in (1, 2)]
        return [view.in_front(points), view.in_front(moved, own), *of_rings]

    found = answers()
    monkeypatch.setattr("diff3ds.surfaces.hidden.mesh_view.kernels", lambda: None)
    for hidden, expected in zip(found, answers(), strict=True):
        assert 0.03 < expected.mean() < 0.97
        assert (hidden == expected).all()


@pytest.mark.skipif("cpu" not in ds.available_backends(), reason="installed without the compiled kernels")
def test_the_kernel_finds_the_places_of_points_on_a_mesh_as_numpy_does(monkeypatch):
    mesh = ds.TriangleMesh(*together(icosphere(3), box((-0.2, -1.7, -0.6), (1.5, 0.05, 0.3))))
    rng = np.random.default_rng(5)
    corners = mesh.vertices[mesh.faces[rng.integers(len(mesh), size=3000)]]
    # In faces, on edges and at vertices, and beside them; some too far away.
    shares = np.concatenate([rng.dirichlet([0.2] * 3, 2000), np.eye(3)[rng.integers(3, size=1000)]])
    points = (corners * shares[..., None]).sum(1) + rng.normal(0, 0.01, (3000, 1)) * rng.normal(size=(3000, 3))
    nearest = Nearest(mesh, 0.02)
    moved, own = nearest.places(points)
    monkeypatch.setattr("diff3ds.surfaces.shape.nearest.kernels", lambda: None)
    expected, lies_on = nearest.places(points)
    assert 0.5 < (own[:, 0] >= 0).mean() < 0.99
    assert np.abs(moved - expected).max() < 1e-14
    assert (np.sort(own, 1) == np.sort(lies_on, 1)).all()


@pytest.mark.parametrize("orthographic", [False, True])
def test_triangles_of_very_different_sizes_hide_as_each_asked_alone(orthographic):
    """Fans of needles beside large faces, as in meshes of solids: all triangles that a view finds, and no other."""
    angles = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    rim = np.stack([np.cos(angles), np.sin(angles), 0.1 * np.cos(3 * angles)], 1)
    fan = np.stack([np.full(200, 200), np.arange(200), (np.arange(200) + 1) % 200], 1)
    needles = (np.concatenate([rim, [[0.6, 0.2, 0.3]]]), fan)
    mesh = ds.TriangleMesh(*together(needles, box((-0.2, -0.7, -0.6), (1.5, 0.05, 0.3))))
    how = {"height": 4.0} if orthographic else {"fov": 40.0}
    picture = Picture.of(ds.orbit(35.0, 20.0, 5.0, size=300, **how).to(torch.float64), 0)
    view = MeshView(mesh, picture)
    # Beside the edges, and far outside.
    points = np.random.default_rng(5).uniform(-2, 2, (2000, 3))
    query, _, face = view.crossed(points)
    found = set(zip(query.tolist(), face.tolist(), strict=True))
    corners, (at, depth) = picture.seen(mesh.vertices), picture.seen(points)
    expected = set()
    for number, triangle in enumerate(mesh.faces):
        a, b, c = corners[0][triangle]
        matrix = np.stack([b - a, c - a], 1)
        if abs(np.linalg.det(matrix)) < 1e-12:
            continue
        share = np.linalg.solve(matrix, (at - a).T).T
        share = np.column_stack([1 - share.sum(1), share])
        deep = corners[1][triangle]
        where = share @ deep if orthographic else 1 / (share @ (1 / deep))
        inside = (share >= 0).all(1) & (where < depth - mesh.touching)
        expected |= {(int(k), number) for k in np.flatnonzero(inside)}
    assert len(expected) > 300
    assert found == expected
