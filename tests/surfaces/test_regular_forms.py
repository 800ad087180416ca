"""What forms share, and which kind each is, against parts whose forms are known."""

import numpy as np
import pytest

from diff3ds.surfaces.form.form_kinds import Form, FormKind, fits_of_patches, form
from diff3ds.surfaces.form.regular import regularised
from diff3ds.surfaces.form.samples import Samples
from diff3ds.surfaces.form.search import best_kind

NOISE, HEIGHT = 0.0015, 0.12


def sampled(surfaces: list[tuple[np.ndarray, np.ndarray]]) -> tuple[Samples, np.ndarray]:
    """Points and normals of surfaces with noise, and which of them each is of."""
    points, normals = (np.concatenate(part) for part in zip(*surfaces, strict=True))
    off = NOISE * np.random.default_rng(0).normal(size=(len(points), 1))
    label = np.repeat(np.arange(len(surfaces)), [len(x) for x, _ in surfaces])
    return Samples.of_points(points + off * normals, normals), label


def grid(origin: tuple[float, ...], u: tuple[float, ...], v: tuple[float, ...], step: float = 0.012) -> np.ndarray:
    """Points of a rectangle."""
    a, b = (np.linspace(0, 1, int(np.linalg.norm(way) / step) + 1) for way in (u, v))
    s, t = (x.reshape(-1, 1) for x in np.meshgrid(a, b))
    return np.asarray(np.array(origin) + s * u + t * np.array(v))


def plate(radius: float) -> tuple[Samples, np.ndarray]:
    """Two sides of a plate at right angles, the convex fillet between them, and its top."""
    far = 0.6
    turn = grid((0, 0, 0), (np.pi / 2 * radius, 0, 0), (0, 0, HEIGHT)) / [radius, 1, 1]
    round_ = np.column_stack([np.cos(turn[:, 0]), np.sin(turn[:, 0]), 0 * turn[:, 0]])
    middle = far - radius
    fillet = [middle, middle, 0] + radius * round_ + turn * [0, 0, 1]
    top = grid((0, 0, HEIGHT), (far, 0, 0), (0, far, 0))
    top = top[(np.hypot(*np.maximum(top[:, :2] - middle, 0).T) < radius)]
    sides = grid((far, 0, 0), (0, middle, 0), (0, 0, HEIGHT)), grid((0, far, 0), (middle, 0, 0), (0, 0, HEIGHT))
    ways = np.eye(3)
    surfaces = [(x, np.tile(way, (len(x), 1))) for x, way in zip((*sides, top), ways, strict=True)]
    return sampled([*surfaces, (fillet, round_)])


@pytest.mark.parametrize("radius", [0.1, 0.15])
def test_a_fillet_taken_for_a_cone_is_a_cylinder_between_the_planes_that_it_joins(radius: float) -> None:
    samples, label = plate(radius)
    planes = [form(FormKind.PLANE, 0.6 * np.eye(3)[k] if k < 2 else (0, 0, HEIGHT), np.eye(3)[k]) for k in range(3)]
    middle = 0.6 - radius
    cone = form(FormKind.CONE, (middle, middle, HEIGHT / 2), (0.1, 0.1, 1.0), 0.95 * radius, 0.15)
    found = regularised(samples, label, [*planes, cone.fitted(samples.points[label == 3], 0.003)])
    assert [one.kind for one in found] == [*[FormKind.PLANE] * 3, FormKind.CYLINDER]
    fillet = found[3]
    assert abs(fillet.axis @ [0, 0, 1]) > np.cos(np.radians(0.3))
    assert float(fillet.radius) == pytest.approx(radius, rel=0.03)
    for plane in found[:2]:
        assert abs(plane.distance(fillet.center[None])[0]) == pytest.approx(fillet.radius, abs=1e-9)


def test_a_side_that_is_hardly_round_is_a_plane() -> None:
    samples, label = plate(0.1)
    kinds = [FormKind.CYLINDER, FormKind.PLANE, FormKind.PLANE, FormKind.CYLINDER]
    starts = [
        form(FormKind.CYLINDER, (-2.4, 0.3, 0), (0, 0, 1), 3.0), form(FormKind.PLANE, (0, 0.6, 0), (0, 1, 0)),
        form(FormKind.PLANE, (0, 0, HEIGHT), (0, 0, 1)), form(FormKind.CYLINDER, (0.5, 0.5, 0), (0, 0, 1), 0.1),
    ]  # fmt: skip
    forms = [one.fitted(samples.points[label == k], 0.003) for k, one in enumerate(starts)]
    assert [one.kind for one in forms] == kinds
    assert regularised(samples, label, forms)[0].kind == FormKind.PLANE


def holes(radii: list[float]) -> tuple[Samples, np.ndarray, list[Form]]:
    """Walls of round holes beside each other, and their forms as their points say them."""
    surfaces, starts = [], []
    for k, radius in enumerate(radii):
        turn = grid((0, 0, 0), (2 * np.pi * radius, 0, 0), (0, 0, HEIGHT), 0.006) / [radius, 1, 1]
        out = np.column_stack([np.cos(turn[:, 0]), np.sin(turn[:, 0]), 0 * turn[:, 0]])
        middle = np.array([0.3 * k, 0.1 * (k % 2), 0])
        surfaces.append((middle + radius * out + turn * [0, 0, 1], -out))
        starts.append(form(FormKind.CYLINDER, middle, (0, 0, 1), radius))
    samples, label = sampled(surfaces)
    forms = [one.fitted(samples.points[label == k], 0.003) for k, one in enumerate(starts)]
    return samples, label, forms


def test_holes_of_one_radius_have_one_and_others_keep_theirs() -> None:
    samples, label, forms = holes([0.08, 0.08, 0.08, 0.083, 0.083])
    assert len({float(one.radius) for one in forms}) == 5
    radius = [float(one.radius) for one in regularised(samples, label, forms)]
    assert len(set(radius)) == 2
    assert np.allclose(radius, [0.08, 0.08, 0.08, 0.083, 0.083], atol=5e-4)


@pytest.mark.parametrize("degrees", [12.0, 18.0])
def test_a_whole_cone_with_a_blurred_rim_taken_for_a_ball_is_a_cone(degrees: float) -> None:
    height = np.repeat(np.linspace(0, 0.2, 24), 210)
    angle = np.tile(np.linspace(0, 2 * np.pi, 210, endpoint=False), 24)
    slope, up = np.radians(degrees), np.array([0.0, 0.0, 1.0])
    across = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    cone = (0.25 - height * np.tan(slope))[:, None] * across + height[:, None] * up
    # Beside its top it points up, as what goes over into a top does.
    tilt = (slope + 0.9 * np.clip((height - 0.17) / 0.03, 0, 1))[:, None]
    samples, _ = sampled([(cone, np.cos(tilt) * across + np.sin(tilt) * up)])
    fits = fits_of_patches(samples.points[None], samples.normals[None])
    ball = next(one for one in fits if one.kind == FormKind.SPHERE)[0].fitted(samples.points, 0.01)
    found = best_kind(ball, samples.points, samples.normals, samples)
    assert found.kind == FormKind.CONE
    assert abs(float(found.angle)) == pytest.approx(slope, abs=0.01)
