"""Faces of many corners in mesh files: they are covered once, and their own edges are the only ones."""

import warnings

import numpy as np
import pytest

import diff3ds as ds
from diff3ds.formats.mesh import read_mesh
from diff3ds.formats.mesh_files.triangulation import triangulated
from diff3ds.surfaces.lines.feature_curves import feature_curves
from diff3ds.tasks.mesh.draw_mesh import run_mesh
from diff3ds.tasks.mesh.mesh_options import MeshOptions

U = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]
L = [(0, 0), (4, 0), (4, 1), (1, 1), (1, 3), (0, 3)]
TURN = np.pi * np.arange(10) / 5
STAR = [(r * np.cos(t), r * np.sin(t)) for t, r in zip(TURN, [2.0, 0.8] * 5, strict=True)]
# A square with a square hole, to which a bridge goes and comes back.
HOLED = [(0, 0), (3, 0), (3, 3), (0, 3), (0, 0), (1, 1), (1, 2), (2, 2), (2, 1), (1, 1)]


def profile(outline, height=2.0):
    """Vertices and faces of an outline that is pulled up; vertices that are there twice are one."""
    places = list(dict.fromkeys(outline))
    row = [places.index(p) for p in outline]
    n = len(places)
    vertices = [(*p, z) for z in (0.0, height) for p in places]
    sides = list(zip(row, row[1:] + row[:1], strict=True))
    # Both ways along a bridge there is no wall.
    walls = [(a, b, b + n, a + n) for a, b in sides if (b, a) not in sides]
    return np.array(vertices), [tuple(k + n for k in row), tuple(reversed(row)), *walls]


def text(suffix, vertices, faces):
    points = [f"{x:.17g} {y:.17g} {z:.17g}" for x, y, z in vertices]
    if suffix == ".obj":
        return "\n".join([*(f"v {p}" for p in points), *("f " + " ".join(str(k + 1) for k in f) for f in faces)])
    rows = [" ".join(map(str, (len(face), *face))) for face in faces]
    if suffix == ".off":
        return "\n".join(["OFF", f"{len(points)} {len(faces)} 0", *points, *rows])
    head = f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {len(faces)}\nproperty list uchar int vertex_index\nend_header"
    return "\n".join([head, *points, *rows])


def shoelace(outline):
    x, y = np.array(outline, float).T
    return float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)


@pytest.mark.parametrize("suffix", [".obj", ".off", ".ply"])
@pytest.mark.parametrize(("outline", "strokes"), [(U, 24), (L, 18), (STAR, 30), (HOLED, 24)])
def test_profiles_have_the_area_and_the_edges_of_their_outline(outline, strokes, suffix, tmp_path):
    path = tmp_path / f"a{suffix}"
    path.write_text(text(suffix, *profile(outline)))
    mesh = ds.load_surface(path)
    around = sum(np.linalg.norm(np.subtract(outline[k - 1], outline[k])) for k in range(len(outline)))
    if outline is HOLED:
        around -= 2 * 2**0.5
    assert np.isclose(mesh.face_areas.sum(), 2 * shoelace(outline) + 2 * around)
    assert mesh.is_closed
    assert len(feature_curves(mesh)) == strokes


def test_any_polygon_is_covered_once():
    """Ears are cut off so that the triangles add up to the polygon: where none is turned over, none lie twice."""
    g = np.random.default_rng(0)
    points, sizes, areas = [], [], []
    for _ in range(60):
        count = int(g.integers(4, 30))
        turn = np.sort(g.uniform(0, 2 * np.pi, count))
        outline = np.stack([np.cos(turn), np.sin(turn)], 1) * g.uniform(0.3, 1, count)[:, None]
        # A hole of any orientation about a point that is well inside, where there is room.
        if g.random() < 0.5 and np.diff(turn, append=turn[0] + 2 * np.pi).max() < 2:
            hole = 0.05 * np.stack([np.cos(-turn[:5]), np.sin(-turn[:5])], 1)
            outline = np.concatenate([outline, outline[:1], hole, hole[:1]])
        frame, _ = np.linalg.qr(g.normal(size=(3, 3)))
        if np.linalg.det(frame) < 0:
            frame[:, 2] *= -1
        points.append(outline @ frame[:, :2].T + 1e3 * frame[:, 1])
        sizes.append(len(outline))
        areas.append(frame[:, 2] * shoelace(outline))
    flat = np.concatenate(points)
    cut = triangulated(flat, np.array(sizes))
    a, b, c = flat[cut.rows].transpose(1, 0, 2)
    product = np.cross(b - a, c - a) / 2
    for k, area in enumerate(areas):
        own = product[cut.polygon == k]
        assert len(own) == sizes[k] - 2
        assert np.allclose(own.sum(0), area, atol=1e-9)
        assert np.isclose(np.linalg.norm(own, axis=1).sum(), np.linalg.norm(area), atol=1e-9)
    assert cut.crossed == 0


def test_corners_on_a_straight_side_and_twice_the_same_make_no_edges(tmp_path):
    square = "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 1 -1 1\n"
    (tmp_path / "a.obj").write_text(square + "f 1 2 3 3 4 5\nf 2 1 6\nf 3 2 6\n")
    mesh = ds.load_surface(tmp_path / "a.obj")
    assert np.isclose(mesh.face_areas.sum(), 4 + 2**0.5)
    # The sides of the square and of the two triangles together, and the edge between these.
    assert sorted(feature_curves(mesh).kinds) == ["border"] * 5 + ["crease"]


def test_the_diagonal_of_a_bent_face_is_no_crease(tmp_path):
    """Nor is it a border where the face is there a second time, from another corner."""
    corners = "v 0 0 0\nv 2 0 1\nv 2 2 0\nv 0 2 1\n"
    for faces in ("f 1 2 3 4\n", "f 1 2 3 4\nf 2 3 4 1\n"):
        (tmp_path / "a.obj").write_text(corners + faces)
        assert feature_curves(ds.load_surface(tmp_path / "a.obj")).kinds == ("border",) * 4
    (tmp_path / "a.obj").write_text(corners + "f 1 2 3\nf 1 3 4\n")
    assert sorted(feature_curves(ds.load_surface(tmp_path / "a.obj")).kinds) == ["border"] * 4 + ["crease"]


def test_a_face_that_crosses_itself_is_said(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 3 0\nf 1 2 3 4\n")
    with pytest.warns(UserWarning, match=r"a\.obj: 1 face crosses itself"):
        read_mesh(tmp_path / "a.obj")


def test_faces_of_far_too_many_corners_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("diff3ds.formats.mesh_files.triangulation.MOST_PAIRS", 10)
    (tmp_path / "a.obj").write_text(text(".obj", *profile(STAR)))
    with pytest.raises(ValueError, match=r"a\.obj: faces have so many corners"):
        read_mesh(tmp_path / "a.obj")


def test_a_stray_triangle_does_not_set_the_frame(tmp_path):
    vertices, faces = profile([(0, 0), (4, 0), (4, 2), (0, 2)], 1.0)
    stray = np.array([[3000, 0, 0], [3000, 0.01, 0], [3000, 0, 0.01]])
    path = tmp_path / "a.obj"
    path.write_text(text(".obj", np.concatenate([vertices, stray]), [*faces, (8, 9, 10)]))
    with pytest.warns(UserWarning, match=r"a\.obj: left out: 1 face far away from the rest"):
        mesh = ds.load_surface(path)
    assert mesh.bounds.tolist() == [[0, 0, 0], [4, 2, 1]]
    # What is near, or large, stays.
    for other in (stray - [2993, 0, 0], 200 * (stray - [3000, 0, 0]) + [3000, 0, 0]):
        path.write_text(text(".obj", np.concatenate([vertices, other]), [*faces, (8, 9, 10)]))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert len(ds.load_surface(path)) == 13


def test_two_triangles_through_each_other_have_six_borders_and_a_seam(tmp_path):
    path = tmp_path / "a.obj"
    points = "v .5368 .5915 .9504\nv .1666 .3535 .1745\nv .891 .7266 .6769\n"
    path.write_text(points + "v .3431 .52 .2606\nv .3165 .3413 .6945\nv .3098 .8106 .0648\nf 1 2 3\nf 4 5 6\n")
    run_mesh(path, tmp_path / "out", MeshOptions(turntable=0, size=64))
    assert sorted(feature_curves(ds.load_surface(path)).kinds) == ["border"] * 6 + ["intersection"]
