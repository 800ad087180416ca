"""Triangle meshes: welding, winding, edges, creases and normals of solids whose own are known."""

import numpy as np
import pytest
from solids import box, icosphere, lathe, together, torus

import diff3ds as ds
from diff3ds.formats.mesh_files.same_rows import MIXED, different
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh


def soup(solid) -> tuple[np.ndarray, np.ndarray]:
    """Every face with vertices of its own, as in STL files."""
    points = solid[0][solid[1]].reshape(-1, 3)
    return points, np.arange(len(points)).reshape(-1, 3)


def volume(mesh: TriangleMesh) -> float:
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def test_soup_of_triangles_is_welded_within_rounding_and_no_farther():
    solid = icosphere(3)
    points, faces = soup(solid)
    noise = np.random.default_rng(0).uniform(-1e-7, 1e-7, points.shape)
    mesh = TriangleMesh(points + noise, faces)
    assert len(mesh.vertices) == len(solid[0])
    assert len(mesh) == len(solid[1])
    assert mesh.is_closed
    assert len(mesh.vertices) - len(mesh.edges) + len(mesh) == 2
    # Neighbours that are farther apart than the cells stay two.
    assert len(TriangleMesh(points + 3e4 * noise, faces).vertices) == len(points)


def test_rows_that_differ_are_found_even_where_their_mixed_numbers_do_not():
    rows = np.random.default_rng(0).integers(-4, 5, (500, 3))
    first, same = different(list(rows.T))
    _, index, whose = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    assert first.tolist() == sorted(index)
    assert np.array_equal(first[same], index[whose])
    # The factors are odd, so that a third column can make up for the second.
    b, c = (int(factor) for factor in MIXED[1:])
    third = -b * pow(c, -1, 1 << 64) % (1 << 64)
    rows = np.array([[0, 0, 0], [0, 1, third ^ (third >> 32)]] * 3)
    assert len(set(((rows ^ (rows >> 32)) * MIXED).sum(1))) == 1
    first, same = different(list(rows.T))
    assert first.tolist() == [0, 1]
    assert same.tolist() == [0, 1] * 3


def test_another_angle_of_creases_changes_nothing_else():
    mesh = TriangleMesh(*box())
    assert mesh.is_crease.sum() == 12
    other = mesh.with_crease(95)
    assert not other.is_crease.any()
    assert mesh.is_crease.sum() == 12
    assert other.vertices is mesh.vertices
    assert other.faces is mesh.faces
    with pytest.raises(ValueError, match="crease must be an angle from 0 to 180 degrees, got 181"):
        mesh.with_crease(181)


def test_duplicate_and_degenerate_faces_go_and_the_source_says_which_stay():
    points, faces = box()
    more = np.concatenate([faces, faces[:3][:, [1, 2, 0]], faces[3:5][:, ::-1], [[0, 0, 1], [2, 5, 2]]])
    mesh = TriangleMesh(points, more, np.arange(len(more)))
    assert mesh.source.tolist() == list(range(12))
    assert mesh.part.tolist() == list(range(12))
    assert mesh.is_closed


@pytest.mark.parametrize("solid", [icosphere(2), torus(1.0, 0.4, 24, 12), together(box(), box((2, 2, 2), (3, 3, 4)))])
def test_faces_are_wound_alike_and_outwards(solid):
    points, faces = solid
    right = TriangleMesh(points, faces)
    assert volume(right) > 0
    flip = np.random.default_rng(1).random(len(faces)) < 0.4
    for wrong in (faces[:, ::-1], np.where(flip[:, None], faces[:, ::-1], faces)):
        mesh = TriangleMesh(points, wrong)
        assert volume(mesh) == pytest.approx(volume(right))
        assert np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, 1)], 2), 2).tolist() == (
            mesh.edges[mesh.face_edges].tolist()
        )


def test_a_hollow_keeps_its_faces_inwards():
    """The wall of a box within a box looks into the hollow: a file that is right stays as it is."""
    outer, (points, faces) = box((-2, -2, -2), (2, 2, 2)), box()
    mesh = TriangleMesh(*together(outer, (points, faces[:, ::-1])))
    assert volume(mesh) == pytest.approx(64 - 8)


def test_a_strip_with_one_side_stays_as_it_is():
    u = np.linspace(0, 2 * np.pi, 25)[:-1]
    across = np.stack([np.cos(u / 2) * np.cos(u), np.cos(u / 2) * np.sin(u), np.sin(u / 2)], 1)
    middle = 2 * np.stack([np.cos(u), np.sin(u), 0 * u], 1)
    points = np.concatenate([middle - across / 2, middle + across / 2])
    i = np.arange(24)
    j = np.where(i < 23, i + 1, 24)  # it closes turned over
    k = np.where(i < 23, i + 25, 0)
    faces = np.concatenate([np.stack([i, j, i + 24], 1), np.stack([j, k, i + 24], 1)])
    mesh = TriangleMesh(points, faces)
    assert len(mesh) == 48
    assert (mesh.edge_counts <= 2).all()
    assert not mesh.is_closed
    assert mesh.is_border.sum() == 48


def test_edges_of_a_box_are_creases_and_its_diagonals_not():
    mesh = TriangleMesh(*box())
    assert mesh.is_crease.sum() == 12
    assert np.allclose(np.sort(mesh.turns), [0] * 6 + [90] * 12)
    assert np.allclose(mesh.corner_normals, mesh.face_normals[:, None])
    assert not TriangleMesh(*box(), crease=91).is_crease.any()
    # A step: where the high box stands on the low one, the surface turns inwards.
    u_shape = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], float)
    low, high = (np.column_stack([u_shape, np.full(6, z)]) for z in (0.0, 1.0))
    k, n = np.arange(6), (np.arange(6) + 1) % 6
    sides = np.concatenate([np.stack([k, n, n + 6], 1), np.stack([k, n + 6, k + 6], 1)])
    cap = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    mesh = TriangleMesh(np.concatenate([low, high]), np.concatenate([sides, cap[:, ::-1], cap + 6]))
    assert np.allclose(np.sort(mesh.turns)[[0, 1]], [-90, 0])


def test_normals_of_a_sphere_come_closer_with_its_edges():
    """With their length, where the triangles around a vertex differ: no worse, and no better."""
    off = []
    for levels in (2, 3, 4):
        mesh = TriangleMesh(*icosphere(levels))
        off.append(np.linalg.norm(mesh.corner_normals - mesh.vertices[mesh.faces], axis=2).max())
    assert off[2] < 3e-3
    assert off[1] / off[2] == pytest.approx(2, rel=0.1)


def test_normals_are_smooth_around_a_cylinder_and_part_at_its_rims():
    radius, height = np.array([0.0, 1, 1, 0]), np.array([-1.0, -1, 1, 1])
    mesh = TriangleMesh(*lathe(radius, height, 64))
    assert mesh.is_closed
    assert mesh.is_crease.sum() == 128
    wall = np.abs(mesh.face_normals[:, 2]) < 0.5
    points = mesh.vertices[mesh.faces[wall]]
    assert np.allclose(mesh.corner_normals[wall], points * [1, 1, 0], atol=1e-6)
    assert np.allclose(np.abs(mesh.corner_normals[~wall]), [0, 0, 1])


def test_open_meshes_have_borders_and_books_have_branches():
    mesh = TriangleMesh(*lathe(np.array([1.0, 1.0]), np.array([0.0, 1.0]), 12))
    assert not mesh.is_closed
    assert mesh.is_border.sum() == 24
    points = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, -1, 0]], float)
    book = TriangleMesh(points, np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]]))
    assert book.is_branch.sum() == 1
    assert np.isnan(book.turns).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"vertices": np.zeros((4, 2))}, r"vertices must have shape \(V, 3\)"),
        ({"vertices": np.where(np.arange(24).reshape(8, 3) == 5, np.nan, box()[0])}, "finite: those of face 0"),
        ({"vertices": np.outer(np.arange(8), [1.0, 2, 3])}, "a face with an area"),
        ({"faces": np.zeros((0, 3), int)}, "at least one face"),
        ({"faces": box()[1] + 1}, "vertices 0 to 7, got 1 to 8"),
        ({"faces": box()[1] * 1.0}, "whole numbers"),
        ({"crease": 200}, "0 to 180"),
        ({"part": np.zeros(3, int)}, "one number a face, 12"),
    ],
)
def test_what_is_no_mesh_is_refused(change, message):
    points, faces = box()
    with pytest.raises((TypeError, ValueError), match=message):
        TriangleMesh(**({"vertices": points, "faces": faces} | change))


def test_a_file_of_two_objects_becomes_one_surface(tmp_path):
    first, second = box(), box((3, 0, 0), (4, 1, 2))
    lines = []
    before = 1
    for name, (points, faces) in (("a", first), ("b", second)):
        lines += [f"o {name}", *(f"v {x} {y} {z}" for x, y, z in points)]
        lines += [f"f {a + before} {b + before} {c + before}" for a, b, c in faces]
        before += len(points)
    path = tmp_path / "two.obj"
    path.write_text("\n".join(lines))
    surface = ds.load_surface(path)
    assert len(surface) == 24
    assert surface.is_closed
    assert surface.bounds.tolist() == [[-1, -1, -1], [4, 1, 2]]
    # z of the file is x, y is z.
    assert ds.load_surface(path, up="y").bounds.tolist() == [[-1, -1, -1], [2, 4, 1]]
    with pytest.raises(ValueError, match='"y" or "z"'):
        ds.load_surface(path, up="x")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not a mesh|needs triangles"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "not a mesh|needs triangles"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "a face with an area"),
        ("v 0 0 nan\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "finite"),
    ],
)
def test_broken_files_are_refused_by_name(text, message, tmp_path):
    (tmp_path / "bad.obj").write_text(text)
    with pytest.raises(ValueError, match=rf"bad\.obj: .*({message})"):
        ds.load_surface(tmp_path / "bad.obj")
