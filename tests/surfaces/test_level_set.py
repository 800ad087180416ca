"""Level sets of values on grids: solids whose volumes are known."""

import numpy as np
import pytest

from diff3ds.surfaces.shape.level_set import level_set


def grid(count: int, reach: float) -> tuple[np.ndarray, float]:
    axis = np.linspace(-reach, reach, count)
    return np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1), float(axis[1] - axis[0])


def volume(mesh) -> float:
    return float(np.linalg.det(mesh.vertices[mesh.faces]).sum() / 6)


def test_a_ball_is_closed_and_as_near_as_the_square_of_the_spacing():
    off = {}
    for count in (17, 33):
        p, spacing = grid(count, 1.2)
        mesh = level_set(1 - np.linalg.norm(p - 0.05, axis=-1), np.full(3, -1.2), spacing)
        assert mesh.is_closed
        assert volume(mesh) == pytest.approx(4 / 3 * np.pi, rel=1.5 * spacing**2)
        off[count] = np.abs(np.linalg.norm(mesh.vertices - 0.05, axis=1) - 1).max()
    assert off[33] < off[17] / 2.5


def test_a_plane_is_met_exactly_and_the_end_of_the_grid_closes_it():
    p, spacing = grid(5, 1.0)
    mesh = level_set(p[..., 2] - 0.3, np.full(3, -1.0), spacing)
    assert mesh.is_closed
    inner = mesh.vertices[np.abs(mesh.vertices[:, :2]).max(1) < 0.9]
    assert np.isclose(inner[:, 2], 0.3).sum() == 16
    # The margin is half a cell wide at most.
    assert np.abs(mesh.vertices).max() <= 1 + spacing


def test_values_without_an_inside_are_refused():
    with pytest.raises(ValueError, match="nothing inside"):
        level_set(np.full((3, 3, 3), -1.0), np.zeros(3), 1.0)
    with pytest.raises(ValueError, match="finite"):
        level_set(np.full((3, 3, 3), np.nan), np.zeros(3), 1.0)
