"""Corners on edges, as STL files of CAD programs have them: a box stays a box of twelve creases."""

from itertools import pairwise

import numpy as np
import pytest
from solids import box, icosphere

import diff3ds as ds
from diff3ds.surfaces.lines.feature_curves import feature_curves


def cut(corners, faces, rows, shares):
    """Triangles, of which some are halved at places along their first side; their neighbours know nothing of it."""
    soup = [corners[face] for face in faces]
    made = []
    for number, (a, b, c) in enumerate(soup):
        stops = [a, *(a + share * (b - a) for share in (shares if number in rows else ())), b]
        made += [np.stack([p, q, c]) for p, q in pairwise(stops)]
    return np.array(made)


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_a_box_of_which_some_sides_are_cut_finer_is_closed_and_has_twelve_edges(turn):
    """At the edges of the box and within its sides, several on an edge; in float32, as files have them."""
    corners, faces = box()
    soup = cut(1000.3 * corners + 7, np.roll(faces, turn, 1), {0, 3, 4, 7, 10}, (0.1, 1 / 3, 0.77))
    mesh = ds.TriangleMesh.of_triangles(soup.astype(np.float32))
    assert mesh.is_closed
    assert mesh.face_areas.sum() == pytest.approx(6 * 2000.6**2, rel=1e-5)
    found = feature_curves(mesh)
    assert set(found.kinds) == {"crease"}
    assert len(found) == 12
    # Each part knows which triangle it is of.
    normals = np.cross(soup[:, 1] - soup[:, 0], soup[:, 2] - soup[:, 0])[mesh.source]
    assert (np.abs(np.einsum("fi,fi->f", normals, mesh.face_normals)) > 0.999 * np.linalg.norm(normals, axis=1)).all()


def test_needles_in_such_gaps_are_left_out():
    corners, faces = box()
    soup = cut(corners, faces, {0, 5}, (0.4,))
    needles = [[corners[a], corners[a] + 0.4 * (corners[b] - corners[a]), corners[b]] for a, b, _ in faces[[0, 5]]]
    mesh = ds.TriangleMesh.of_triangles(np.concatenate([soup, needles]))
    assert mesh.is_closed
    assert set(feature_curves(mesh).kinds) == {"crease"}
    assert len(feature_curves(mesh)) == 12


def test_what_has_none_stays_as_it_is():
    vertices, faces = icosphere(3)
    assert np.array_equal(ds.TriangleMesh(vertices, faces).source, np.arange(len(faces)))
    sheet = ds.TriangleMesh([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3]])
    assert sheet.is_border.sum() == 4
    with pytest.raises(ValueError, match="a mesh needs a face with an area"):
        ds.TriangleMesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]])
