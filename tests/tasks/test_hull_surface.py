"""Surfaces from silhouettes: bars and balls, whose outlines are known."""

import functools

import numpy as np
import pytest
import torch

import diff3ds as ds
from diff3ds.cli import main
from diff3ds.formats import save_png
from diff3ds.pictures.content.outlines import depths
from diff3ds.pictures.dataset import PosedPictures
from diff3ds.pictures.store import store_of
from diff3ds.surfaces.shape.hull_surface import hull_surface
from diff3ds.tasks.mesh.draw_mesh import MeshSketch
from diff3ds.tasks.views.run_views import run_views
from diff3ds.tasks.views.views_options import ViewsOptions
from diff3ds.transforms import save_transforms

AROUND = ds.orbit([137.508 * i for i in range(21)], [-50 + 5.0 * i for i in range(21)], 4.0, fov=45, size=96)
MIDDLE = torch.tensor([10.0, 20.0, 5.0])


def posed(pixels: torch.Tensor, target: str = "color") -> PosedPictures:
    names = tuple(f"{i}.png" for i in range(len(pixels)))
    return PosedPictures(cameras(), target, store_of(pixels), names)


def cameras() -> ds.Cameras:
    pose = AROUND.world_to_camera.double()
    pose[:, :3, 3] -= pose[:, :3, :3] @ MIDDLE.double()
    return ds.Cameras(pose, AROUND.intrinsics.double(), AROUND.size)


def bar() -> torch.Tensor:
    """Colour and alpha of a bar along x with round ends, .4 thick, 1.6 long without its ends."""
    points = torch.tensor([[[-0.8, 0, 0], [0.8, 0, 0]]]) + MIDDLE
    drawn = ds.render(ds.Sketch(points, width=0.4, width_space="world"), cameras(), background=0.0)
    return torch.cat([drawn.color, drawn.alpha[..., None]], -1)


def from_axis(surface: ds.TriangleMesh) -> np.ndarray:
    points = surface.vertices - MIDDLE.double().numpy()
    points[:, 0] -= np.clip(points[:, 0], -0.8, 0.8)
    return np.linalg.norm(points, axis=1)


def test_a_bar_is_as_thick_as_it_is_and_one_wrong_picture_carves_nothing():
    pixels = bar()
    off = from_axis(hull_surface(posed(pixels), 40)) - 0.2
    # A hull is nowhere thinner; a cell of the grid is .06 wide here.
    assert -0.02 < off.mean() < 0.03
    assert np.abs(off).max() < 0.07
    pixels[3] = 0
    assert np.abs(from_axis(hull_surface(posed(pixels), 40)) - 0.2).max() < 0.07


@pytest.mark.slow
def test_outlines_of_drawings_close_in_what_they_show():
    ball = ds.Quadrics.ellipsoids([MIDDLE.tolist()], [[0.8, 0.8, 0.8]])
    nothing = ds.Sketch(torch.zeros(0, 4, 3))
    ink = ds.render(nothing, cameras(), surface=ball).alpha[..., None]
    # A gap in one of them, through which all runs out.
    ink[5, 48, :48] = 0
    surface = hull_surface(posed(ink.float(), "edges"), 40)
    radius = np.linalg.norm(surface.vertices - MIDDLE.double().numpy(), axis=1)
    assert surface.is_closed
    assert abs(radius.mean() - 0.8) < 0.02
    assert np.abs(radius - 0.8).max() < 0.07


def test_depths_are_distances_from_the_outline():
    alpha = torch.zeros(1, 9, 20, 4)
    alpha[0, :, 6:14] = 1
    deep = depths(store_of(alpha).batch([0]))[0, 4]
    assert deep[3:10].tolist() == [-2.5, -1.5, -0.5, 0.5, 1.5, 2.5, 3.5]
    square = torch.zeros(1, 24, 24, 1)
    square[0, 4:20, 4:20] = 1
    square[0, 6:18, 6:18] = 0
    # Lines two pixels wide, whose middles are at 5 and 19.
    deep = depths(store_of(square).batch([0]))[0, 12]
    assert deep[[2, 4, 5, 8]] == pytest.approx([-2.5, -0.5, 0.5, 3.5], abs=0.2)
    square[0, 12, :8] = 0
    # Through a gap all is outside but the lines.
    assert depths(store_of(square).batch([0]))[0, 12, 12] < 0


def test_a_run_with_contours_hides_lines_and_goes_with_the_sketch(tmp_path):
    """Of coloured pictures, in a world that is made ten times as large."""
    names = [f"{i}.png" for i in range(21)]
    for name, pixels in zip(names, bar(), strict=True):
        straight = torch.cat([pixels[..., :3] / pixels[..., 3:].clamp(min=1e-6), pixels[..., 3:]], -1)
        save_png(tmp_path / name, straight)
    save_transforms(tmp_path / "transforms.json", cameras(), names)
    few = {"target": "color", "strokes": 4, "steps": 2, "size": 48, "contours": True}
    apart = float((cameras().centers[0] - cameras().centers[1]).norm())
    run_views(tmp_path, tmp_path / "out", ViewsOptions(**few, scale=10 * apart, between=("0", "1")))
    surface = ds.load_surface(tmp_path / "out" / "surface.glb")
    middle, size = surface.bounds.mean(0), surface.bounds[1] - surface.bounds[0]
    assert np.abs(middle - 10 * MIDDLE.numpy()).max() < 0.5
    assert size == pytest.approx([20, 4, 4], abs=0.7)
    main(["render", str(tmp_path / "out"), "-o", str(tmp_path / "a.svg"), "--hidden", "drop"])
    main(["render", str(tmp_path / "out"), "-o", str(tmp_path / "b.svg")])
    assert (tmp_path / "a.svg").read_text() != (tmp_path / "b.svg").read_text()


def test_pictures_without_silhouettes_are_refused():
    with pytest.raises(ValueError, match="no silhouettes"):
        hull_surface(posed(torch.ones(21, 96, 96, 4)), 10)
    gaps = torch.zeros(21, 96, 96, 1)
    gaps[:, 30:60, 30] = 1
    with pytest.raises(ValueError, match="no place lies in the silhouettes"):
        hull_surface(posed(gaps, "edges"), 10)


def picture_a_ball(folder, seen):
    """Drawings of its outlines, which no two views have in the same place."""
    ball = ds.Quadrics.ellipsoids([MIDDLE.tolist()], [[0.8, 0.8, 0.8]])
    nothing = ds.Sketch(torch.zeros(0, 4, 3), width=torch.zeros(0))
    drawn = ds.render(nothing, seen, surface=ball).color.float()
    names = [f"{i}.png" for i in range(len(drawn))]
    for name, picture in zip(names, drawn, strict=True):
        save_png(folder / name, picture)
    save_transforms(folder / "transforms.json", seen, names)


def off_the_ball(sketch):
    on_curves = ds.bezier.evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 9))
    return float(((on_curves - MIDDLE).norm(dim=-1) - 0.8).abs().mean())


def test_where_no_edges_agree_the_surface_is_drawn(tmp_path, monkeypatch):
    """As meshes are: what they become is the subject of their own tests, here their strokes are the axes."""

    def axes(surface, options, report):
        radius = np.linalg.norm(surface.vertices - MIDDLE.double().numpy(), axis=1)
        assert abs(radius.mean() - 0.8) < 0.03
        return MeshSketch(
            ds.Sketch(torch.stack([MIDDLE - torch.eye(3), MIDDLE + torch.eye(3)], 1)), ("contour",) * 3, 0
        )

    monkeypatch.setattr("diff3ds.tasks.views.run_views.sketch_mesh", axes)
    monkeypatch.setattr("diff3ds.tasks.views.read_scene.hull_surface", functools.partial(hull_surface, side=24))
    picture_a_ball(tmp_path, cameras())
    said: list[str] = []
    sketch = run_views(tmp_path, tmp_path / "out", ViewsOptions(contours=True), say=said.append)
    assert torch.equal(sketch.points.mean(1), MIDDLE.expand(3, 3))
    assert "outlines of its surface" in said[-1]


@pytest.mark.slow
def test_of_what_has_no_edges_outlines_of_its_surface_are_the_strokes(tmp_path):
    picture_a_ball(tmp_path, cameras())
    said: list[str] = []
    sketch = run_views(tmp_path, tmp_path / "out", ViewsOptions(contours=True), say=said.append)
    assert 1 <= len(sketch) <= 24
    assert "outlines of its surface" in said[-1]
    assert off_the_ball(sketch) < 0.05
    with pytest.raises(ValueError, match="no edges that agree"):
        run_views(tmp_path, tmp_path / "other", ViewsOptions())
