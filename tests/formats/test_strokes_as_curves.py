"""Lines, arcs and splines told apart, wherever a drawing lies and however it is turned."""

import math
from itertools import pairwise

import numpy as np
import pytest
import torch

import diff3ds as ds
from diff3ds.formats.cad.arcs import Arc, arc_along
from diff3ds.formats.cad.strokes_as_curves import MOST, Line, Spline, curves_of, resolution


def turned(sketch, far, dtype, rng):
    """A sketch turned, moved, turned again and moved, as parts of assemblies are."""
    matrix = torch.eye(4, dtype=torch.float64)
    for shift in (far, far / 3):
        turn = torch.linalg.qr(torch.from_numpy(rng.normal(size=(3, 3))))[0]
        matrix = torch.cat([torch.cat([turn, torch.full((3, 1), shift).double()], 1), matrix[3:]]) @ matrix
    moved = sketch.transform(matrix)
    return ds.Sketch(moved.points.to(dtype), moved.weights.to(dtype), chains=sketch.chains)


def arc(whole, circular, rng):
    start = rng.uniform(0, 360)
    stop = start + (360 if whole else rng.uniform(15, 340))
    minor = 8.0 if circular else rng.uniform(2, 6)
    points, weights = ds.bezier.ellipse((0.0, 0.0, 0.0), (8.0, 0.0, 0.0), (0.0, minor, 0.0), start, stop)
    return ds.Sketch(points, weights, chains=ds.Chains.of([len(points)], whole)).elevate(3)


def off(sketch, curve):
    """How far the strokes lie off an arc, and its ends off theirs."""
    t = torch.linspace(0, 1, 101, dtype=torch.float64)
    on = ds.bezier.evaluate(sketch.points.double(), sketch.weights.double(), t).flatten(0, 1).numpy()
    angle = np.arctan2(
        (on - curve.center) @ curve.minor / (curve.minor @ curve.minor),
        (on - curve.center) @ curve.major / (curve.major @ curve.major),
    )
    near = curve.center + np.cos(angle)[:, None] * curve.major + np.sin(angle)[:, None] * curve.minor
    ends = [] if curve.whole else [curve.at(curve.start) - on[0], curve.at(curve.stop) - on[-1]]
    return max(np.linalg.norm(x, axis=-1).max() for x in (near - on, *ends))


@pytest.mark.parametrize(("far", "dtype"), [(0, "float64"), (1e3, "float64"), (1e7, "float64"), (0, "float32")])
def test_exact_arcs_and_lines_are_told_wherever_they_are(far, dtype):
    """Circles of 8 mm up to 10 km away."""
    rng, dtype = np.random.default_rng(0), getattr(torch, dtype)
    for circular in (True, False):
        for whole in (True, False, False):
            sketch = turned(arc(whole, circular, rng), far, dtype, rng)
            ((curve,),) = curves_of(sketch)
            assert (curve.circular, curve.whole) == (circular, whole)
            # What is computed from numbers of this size is good to tens of steps of them.
            assert off(sketch, curve) < 100 * torch.finfo(dtype).eps * float(sketch.points.abs().max())
    line = ds.Sketch(torch.from_numpy(rng.normal(size=(1, 2, 3)) * 8)).elevate(3)
    ((found,),) = curves_of(turned(line, far, dtype, rng))
    assert isinstance(found, Line)


def test_straight_rational_cubics_with_noise_are_lines():
    t = torch.tensor([0.0, 0.3, 0.7, 1.0]).double()
    points = torch.tensor([77.0, 3.0, 0.0]).double() + t[:, None] * torch.tensor([0.0, 0.0, 10.0]).double()
    noise = torch.tensor([[0, 2, -1], [1, 0, 0], [-2, 1, 0], [0, 0, 1]]).double() * 1e-13
    ((line,),) = curves_of(ds.Sketch((points + noise)[None], torch.tensor([[1.0, 1.007, 1.014, 1.02]]).double()))
    assert isinstance(line, Line)
    ((bent,),) = curves_of(ds.Sketch((points + 1e4 * noise)[None]))
    assert isinstance(bent, Spline)


def test_what_stands_for_a_curve_is_within_the_tolerance():
    """The four cubics that drawing programs write for a circle are off it by 2.7e-4 of the radius at most."""
    k = 4 / 3 * math.tan(math.pi / 8)
    quarter = torch.tensor([[1.0, 0, 0], [1, k, 0], [k, 1, 0], [0, 1, 0]]).double()
    turn = torch.tensor([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]).double()
    quarters = torch.stack([quarter @ torch.matrix_power(turn, i).T for i in range(4)])
    sketch = ds.Sketch(quarters, chains=ds.Chains.of([4], True))
    ((spline,),) = curves_of(sketch, 1e-5)
    assert isinstance(spline, Spline)
    ((circle,),) = curves_of(sketch, 3e-4)
    assert circle.circular
    assert circle.whole
    assert 1e-5 < off(sketch, circle) < 3e-4
    ((exact,),) = curves_of(sketch)
    assert isinstance(exact, Spline)


def test_small_arcs_within_a_large_tolerance_stay_arcs():
    """A quarter of a circle of .2 is nearer than .1 to its chord."""
    points, weights = ds.bezier.circle((0.0, 0.0, 0.0), 0.2, start=0.0, stop=90.0)
    ((found,),) = curves_of(ds.Sketch(points, weights), 0.1)
    assert isinstance(found, Arc)


def test_small_parts_of_large_float32_drawings_keep_their_shape():
    """The coordinates are known to .08; a curve of .01 is not made a line for it."""
    small = torch.tensor([[[0.0, 0, 0], [0.005, 0.01, 0], [0.0, 0.01, 0.002], [0.01, 0, 0]]])
    large = torch.tensor([[[0.0, 0, 0], [1, 1, 0], [2, 0, 0], [1e4, 0, 0]]])
    sketch = ds.Sketch(torch.cat([small, large]))
    assert resolution(sketch) > 0.05 > MOST * 0.01
    assert isinstance(next(curves_of(sketch))[0], Spline)


def test_a_circle_of_many_pieces_is_one():
    edges = np.linspace(0, 360, 101)
    pieces = [ds.bezier.circle((1.0, 2.0, 3.0), 8.0, (1.0, 1.0, 1.0), a, b) for a, b in pairwise(edges)]
    points, weights = (torch.cat([piece[i] for piece in pieces]) for i in (0, 1))
    ((circle,),) = curves_of(ds.Sketch(points, weights, chains=ds.Chains.of([100], True)))
    assert circle.whole


def test_ends_of_strokes_that_meet_but_for_rounding_are_at_one_place():
    corner = torch.tensor([1000.1, 2000.2, 500.3]).double()
    points = torch.stack([corner + torch.tensor([0.0, 5e-13, 0]).double(), corner + torch.eye(3).double()[0]])
    other = torch.stack([corner + torch.eye(3).double()[1], corner])
    apart = torch.stack([corner + 1e-8, corner + torch.eye(3).double()[2]])
    (first,), (second,), (third,) = curves_of(ds.Sketch(torch.stack([points, other, apart])))
    assert first.start.tolist() == second.stop.tolist() == points[0].tolist()
    assert third.start.tolist() == apart[0].tolist()


def test_a_tolerance_is_a_number():
    for wrong in (-1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="tolerance must be at least 0 and finite"):
            ds.formats.save_step("never.step", arc(True, True, np.random.default_rng(0)), tolerance=wrong)


def test_no_kind_is_off_by_more_than_the_tolerance():
    """Quarters of circles and chords, bent by up to twelve times the tolerance: what is told from splines is near."""
    rng, tolerance = np.random.default_rng(1), 1e-3
    t = torch.linspace(0, 1, 201, dtype=torch.float64)
    told = 0
    for _ in range(60):
        points, weights = ds.bezier.circle((0.0, 0.0, 0.0), 1.0, start=0.0, stop=rng.uniform(5, 90))
        sketch = ds.Sketch(points, weights).elevate(3)
        bent = torch.from_numpy(rng.normal(size=(1, 2, 3))) * rng.uniform(0, 12) * tolerance
        points = torch.cat([sketch.points[:, :1], sketch.points[:, 1:3] + bent, sketch.points[:, 3:]], 1)
        ((curve,),) = curves_of(ds.Sketch(points, sketch.weights), tolerance)
        on = ds.bezier.evaluate(points, sketch.weights, t)[0].numpy()
        if isinstance(curve, Arc) and curve.circular:
            normal = np.cross(curve.major, curve.minor) / np.linalg.norm(curve.major) ** 2
            rise = (on - curve.center) @ normal
            around = np.linalg.norm(on - curve.center - rise[:, None] * normal, axis=1) - np.linalg.norm(curve.major)
            distance = np.hypot(rise, around)
        elif isinstance(curve, Line):
            along = (curve.stop - curve.start) / np.linalg.norm(curve.stop - curve.start)
            distance = np.linalg.norm(np.cross(on - curve.start, along), axis=1)
        else:
            continue
        told += 1
        # 1.09: between the points that are looked at.
        assert distance.max() < 1.09 * tolerance
    assert 10 < told < 50


@pytest.mark.filterwarnings("error")
def test_what_begins_in_its_own_middle_is_no_arc():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 0]], float)
    assert arc_along(points, 1e-3, 1.0, True) is None
