"""What can be seen from outside: of a box in a box nothing, of one in a box without a lid all."""

import numpy as np

import diff3ds as ds
from diff3ds.sketch import Sketch
from diff3ds.surfaces.hidden.outside import Outside, outer_faces
from diff3ds.tasks.mesh.mesh_lines import feature_lines, from_outside


def box(half: float, lid: bool = True, inward: bool = False) -> tuple[np.ndarray, np.ndarray]:
    corners = half * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([face for a, b, c, d in sides[: 6 if lid else 5] for face in ((a, b, c), (a, c, d))])
    return corners, faces[:, ::-1] if inward else faces


def together(*parts: tuple[np.ndarray, np.ndarray]) -> ds.TriangleMesh:
    counts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = [faces + start for (_, faces), start in zip(parts, counts, strict=False)]
    return ds.TriangleMesh(np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces))


def middles(sketch: Sketch) -> np.ndarray:
    return np.abs(sketch.points.mean(1).numpy()).max(1)


def test_edges_of_a_box_in_a_box_give_no_lines_unless_there_is_no_lid() -> None:
    closed, open_ = (together(box(1.0, lid), box(0.5)) for lid in (True, False))
    # Those of its lid and its sides; some of its bottom are seen too.
    for mesh, inner in ((closed, {0}), (open_, range(8, 13))):
        lines = feature_lines(mesh)
        assert (middles(lines[0]) < 0.6).sum() == 12
        sketch, kinds = from_outside(lines, mesh)
        assert len(kinds) == len(sketch)
        assert (middles(sketch) > 0.9).sum() == 12
        assert (middles(sketch) < 0.6).sum() in inner


def test_the_inner_side_of_a_double_wall_is_not_seen() -> None:
    mesh = together(box(1.0), box(0.985, inward=True))
    seen = Outside.of(mesh)
    outer = np.abs(seen.points).max(1) > 0.99
    assert seen.seen[outer].mean() > 0.99
    assert seen.seen[~outer].mean() < 0.02


def test_pieces_inside_of_others_are_no_outer_ones() -> None:
    mesh = together(box(1.0), box(0.985, inward=True), box(0.5))
    corners = np.abs(mesh.vertices[mesh.faces]).max((1, 2))
    np.testing.assert_array_equal(outer_faces(mesh), corners == 1)
    assert outer_faces(together(box(1.0, lid=False), box(0.5))).all()
