"""Borders of rounded corners go; edges of sharp corners, and what ends on a line, stay."""

from dataclasses import replace

import numpy as np
import torch
from edge_scenes import circular_arc, lines_between

from diff3ds.curves.shapes.curve_set import concatenated, curves_of
from diff3ds.edges.clean.rounded_faces import without_rounded_faces

# Two sides of a plate with a rounded corner between them, and what leaves the ends of these.
START, JOINT, OTHER, STOP = (-1.0, 0, 0), (0.0, 0, 0), (0.5, 0.5, 0), (0.5, 1.5, 0)
DOWN = np.array([0, 0, -0.4])


def plate(*down):
    """The sides and the corner, and lines down from some of four places; vertices are their numbers."""
    places = START, JOINT, OTHER, STOP
    lines = lines_between((START, JOINT), (OTHER, STOP), *((places[k], np.array(places[k]) + DOWN) for k in down))
    corner = curves_of([circular_arc((0, 0.5, 0), (0, -0.5, 0), (0.5, 0, 0), 0, np.pi / 2)])
    vertex = [[0, 1], [2, 3], *([k, 10 + k] for k in down), [1, 2]]
    return replace(concatenated(lines, corner), vertex=torch.tensor(vertex))


def test_a_line_that_leaves_where_a_line_goes_on_in_an_arc_goes():
    found = without_rounded_faces(plate(0, 1, 2, 3))
    assert found.vertex.tolist() == [[0, 1], [2, 3], [0, 10], [3, 13], [1, 2]]
    assert len(without_rounded_faces(plate(1))) == 3


def test_what_leaves_a_straight_line_or_a_corner_stays():
    through = lines_between((START, JOINT), (JOINT, (1.0, 0, 0)), (JOINT, DOWN))
    through = replace(through, vertex=torch.tensor([[0, 1], [1, 2], [1, 3]]))
    corner = lines_between((START, JOINT), (JOINT, (0.0, 1, 0)), (JOINT, DOWN))
    corner = replace(corner, vertex=through.vertex)
    for curves in (plate(), plate(0, 3), through, corner):
        assert torch.equal(without_rounded_faces(curves).points, curves.points)
