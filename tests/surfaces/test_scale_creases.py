"""Creases at a scale: ridges and valleys of bodies whose sharpest lines are known, bumpy and rounded."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import diff3ds as ds
from diff3ds.curves.shapes.curve_set import sampled
from diff3ds.surfaces.lines.scale_creases import scale_creases
from diff3ds.surfaces.shape.level_set import level_set
from diff3ds.tasks.mesh.mesh_options import MeshOptions
from diff3ds.tasks.mesh.source import Source

SPACING = 1 / 60
# Centres of two balls of radius .4 are so far to both sides; they meet on a circle of this radius.
OFF = 0.3
RIM = np.sqrt(0.4**2 - OFF**2)


def body(kind: str, bumps: float = 0.0) -> ds.TriangleMesh:
    """Both balls together, what they share, one ball, or a pipe; its distances blurred and off by bumps."""
    axes = [np.arange(-0.8, 0.8, SPACING)] * 3
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    one, other = (np.linalg.norm(points - [side * OFF, 0, 0], axis=-1) - 0.4 for side in (-1, 1))
    if kind == "pipe":
        away = np.hypot(np.hypot(points[..., 0], points[..., 1]) - 0.5, points[..., 2]) - 0.06
    else:
        away = {"two": np.minimum(one, other), "lens": np.maximum(one, other), "ball": one}[kind]
    noise = gaussian_filter(np.random.default_rng(0).normal(size=away.shape), 1.0)
    return level_set(bumps * noise / noise.std() - gaussian_filter(away, 1.0), points[0, 0, 0], SPACING)


@pytest.mark.parametrize(("kind", "line"), [("two", "valley"), ("lens", "ridge")])
@pytest.mark.parametrize("bumps", [0.0, 0.001])
def test_where_two_balls_meet_is_one_line_around(kind: str, line: str, bumps: float) -> None:
    curves, kinds = scale_creases(body(kind, bumps))
    assert set(kinds) == {line}
    places = np.concatenate(list(sampled(curves)))
    # The blur of a cell moves the line itself by nearly as much.
    assert np.abs(np.linalg.norm(places[:, 1:], axis=1) - RIM).max() < 1.5 * SPACING
    assert np.abs(places[:, 0]).max() < SPACING / 2
    lengths = [np.linalg.norm(np.diff(np.asarray(c), axis=0), axis=1).sum() for c in sampled(curves)]
    assert sum(lengths) == pytest.approx(2 * np.pi * RIM, rel=0.08)


@pytest.mark.parametrize("kind", ["ball", "pipe"])
def test_what_turns_alike_everywhere_has_none(kind: str) -> None:
    assert len(scale_creases(body(kind, 0.001))[0]) == 0


@pytest.mark.slow
def test_a_smooth_bumpy_mesh_has_them_unless_an_angle_is_given() -> None:
    source = Source(body("two", 0.001))
    found = source.by_forms(MeshOptions(), lambda line: None)
    assert found.edges is not None
    assert set(found.edges[1]) == {"valley"}
    with_angle = source.by_forms(MeshOptions(angle=40.0), lambda line: None)
    assert with_angle.edges is not None
    assert len(with_angle.edges[0]) == 0
