"""GLB, read back by trimesh: closed tubes of the right place, size, volume and colour."""

import io
import json
import math
import struct

import numpy as np
import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds.formats.mesh import load_mesh
from diff3ds.formats.scenes.glb import save_glb
from diff3ds.formats.scenes.tubes import TOLERANCE

pytestmark = needs("trimesh")


def read(path):
    import trimesh

    return trimesh.load(io.BytesIO(path.read_bytes()), "glb", force="scene", process=False)


def surface(path):
    """All strokes as one mesh, in the frame of the sketch."""
    import trimesh

    return trimesh.Trimesh(*load_mesh(path), process=False)


def stroke(points, width, **more):
    return ds.Sketch(torch.tensor(points, dtype=torch.float64)[None], width=width, width_space="world", **more)


def test_a_straight_tube_is_a_cylinder_with_half_balls(tmp_path):
    ds.save(tmp_path / "a.glb", stroke([[1.0, 2, 3], [1, 2, 5]], 0.4))
    mesh = surface(tmp_path / "a.glb")
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    exact = math.pi * 0.2**2 * 2 + 4 / 3 * math.pi * 0.2**3
    # Chords of n sides take sin(2 pi / n) n / (2 pi) of a disc: .9 of it with the 10 that the tolerance asks for.
    assert 0.88 * exact < mesh.volume < exact
    np.testing.assert_allclose(mesh.bounds, [[0.8, 1.8, 2.8], [1.2, 2.2, 5.2]], atol=0.02)


def test_a_closed_circle_is_a_torus(tmp_path):
    points, weights = ds.bezier.circle((0.0, 0.0, 0.0), 1.0, normal=(1.0, 0.5, 0.2))
    chains = ds.Chains.of([len(points)], True)
    ds.save(tmp_path / "a.glb", ds.Sketch(points, weights, width=0.2, width_space="world", chains=chains))
    mesh = surface(tmp_path / "a.glb")
    assert mesh.is_watertight
    assert mesh.euler_number == 0
    assert 0.85 * 2 * math.pi**2 * 0.1**2 < mesh.volume < 2 * math.pi**2 * 0.1**2
    # From the torus by at most the tolerance of the chord and of the sides.
    normal = np.array([1.0, 0.5, 0.2]) / np.linalg.norm([1.0, 0.5, 0.2])
    height = mesh.vertices @ normal
    around = np.linalg.norm(mesh.vertices - height[:, None] * normal, axis=1)
    off = np.abs(np.hypot(around - 1, height) - 0.1)
    assert off.max() < 2 * TOLERANCE * 0.1


def test_widths_change_along_the_stroke(tmp_path):
    """A cone from radius .1 to .3."""
    sketch = ds.Sketch(torch.tensor([[[0.0, 0, 0], [0, 0, 4]]]), width=torch.tensor([[0.2, 0.6]]), width_space="world")
    ds.save(tmp_path / "a.glb", sketch)
    mesh = surface(tmp_path / "a.glb")
    assert mesh.is_watertight
    for z, radius in ((1.0, 0.15), (3.0, 0.25)):
        near = mesh.section(plane_origin=[0, 0, z], plane_normal=[0, 0, 1])
        assert np.hypot(*near.vertices[:, :2].T).max() == pytest.approx(radius, rel=0.02)


def test_a_stroke_may_be_thick_in_its_middle(tmp_path):
    """Radius .1, .3 in the middle, .1: the volume is the integral of pi r^2, and that of two half balls."""
    width = torch.tensor([[0.2, 1.0, 0.2]])
    sketch = ds.Sketch(torch.tensor([[[0.0, 0, 0], [0, 0, 2], [0, 0, 4]]]), width=width, width_space="world")
    ds.save(tmp_path / "a.glb", sketch)
    t = np.linspace(0, 1, 1001)
    radius = 0.1 * (1 - t) ** 2 + t * (1 - t) + 0.1 * t**2
    exact = 4 * math.pi * np.mean(radius**2) + 4 / 3 * math.pi * 0.1**3
    # A decagon is .935 of its circle.
    assert surface(tmp_path / "a.glb").volume == pytest.approx(0.935 * exact, rel=0.04)


def test_a_closed_stroke_that_turns_in_space_is_not_pinched(tmp_path):
    """Where a tube closes, its frame has turned by some angle, which is spread all round."""
    t = torch.arange(24) * 2 * math.pi / 24
    knots = torch.stack([t.sin() + 2 * (2 * t).sin(), t.cos() - 2 * (2 * t).cos(), -(3 * t).sin()], 1)
    points = ds.bezier.catmull_rom(knots, closed=True)
    sketch = ds.Sketch(points, width=0.2, width_space="world", chains=ds.Chains.of([24], True))
    ds.save(tmp_path / "a.glb", sketch)
    mesh = surface(tmp_path / "a.glb")
    assert mesh.is_watertight
    # All edges along the tube are as long as their like: none crosses from side to side.
    edges = np.linalg.norm(np.diff(mesh.vertices[mesh.edges_unique], axis=1)[:, 0], axis=1)
    length = float(ds.bezier.length(points, None).sum())
    assert mesh.volume == pytest.approx(0.935 * math.pi * 0.1**2 * length, rel=0.04)
    assert edges.max() < 2 * np.percentile(edges, 90)


def test_sharp_corners_are_round(tmp_path):
    """Two tubes that meet at a right angle, each closed; nothing is thinner at the corner."""
    points = torch.tensor([[[0.0, 0, 0], [1, 0, 0]], [[1, 0, 0], [1, 1, 0]]])
    sketch = ds.Sketch(points, width=0.2, width_space="world", chains=ds.Chains.of([2]))
    ds.save(tmp_path / "a.glb", sketch)
    mesh = surface(tmp_path / "a.glb")
    assert mesh.is_watertight
    assert mesh.body_count == 2
    np.testing.assert_allclose(mesh.bounds, [[-0.1, -0.1, -0.1], [1.1, 1.1, 0.1]], atol=0.01)


@pytest.mark.parametrize("start", [0, 1, 2])
def test_a_closed_stroke_with_corners_has_no_gap(start, tmp_path):
    """A triangle whose one corner is smooth, begun at each of its corners: every point of it is in the surface."""
    import trimesh

    a, b, c = (0.0, 0, 0), (1.0, 0, 0), (1.0, 1, 0)
    sides = [[a, (0.5, 0, 0), (0.9, 0, 0), b], [b, (1.5, 0, 0), (1, 0.5, 0), c], [c, (0.7, 0.7, 0), (0.3, 0.3, 0), a]]
    points = torch.tensor([*sides[start:], *sides[:start]])
    sketch = ds.Sketch(points, width=0.1, width_space="world", chains=ds.Chains.of([3], True))
    ds.save(tmp_path / "a.glb", sketch)
    mesh = surface(tmp_path / "a.glb")
    assert mesh.is_watertight
    on = torch.cat([ds.bezier.evaluate(side, None, torch.linspace(0, 1, 30)) for side in points]).numpy()
    # One tube from corner to corner, and one the other way.
    assert mesh.body_count == 2
    samples = trimesh.sample.sample_surface(mesh, 4000, seed=0)[0]
    off = np.linalg.norm(samples[:, None] - on, axis=-1)
    # The radius is .05; samples lie some .01 from each other, points of the stroke .035.
    assert off.min(0).max() < 0.06
    assert off.min(1).max() < 0.057


@pytest.mark.parametrize(
    "points",
    [
        [[0.0, 0, 0], [0, 0, 0]],
        [[0.0, 0, 0], [1, 0, 0], [1, 0, 0], [0.0, 0, 0]],
        [[0.0, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, 0]],
        [[1.0, 1, 1], [1, 1, 1], [1, 1, 1], [2.0, 1, 1]],
    ],
)
def test_points_hairpins_and_cusps_are_closed_surfaces(points, tmp_path):
    ds.save(tmp_path / "a.glb", stroke(points, 0.2))
    mesh = surface(tmp_path / "a.glb")
    assert mesh.is_watertight
    assert mesh.volume > 0.8 * 4 / 3 * math.pi * 0.1**3


def test_random_strokes_are_closed_surfaces(tmp_path, generator):
    ds.save(tmp_path / "a.glb", ds.Sketch.random(60, generator=generator))
    for mesh in read(tmp_path / "a.glb").geometry.values():
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        assert mesh.volume > 0


def test_names_colours_units_and_far_places(tmp_path):
    color = torch.tensor([[1.0, 0.5, 0], [0, 0, 0], [1.0, 0.5, 0]], dtype=torch.float64)
    points = torch.tensor([[[0.0, 0, 0], [1, 0, 0]]], dtype=torch.float64).repeat(3, 1, 1) + 4e6
    sketch = ds.Sketch(points, width=0.1, width_space="world", color=color, opacity=torch.tensor([1, 1, 1.0]).double())
    ds.save(tmp_path / "a.glb", sketch, unit="cm")
    scene = read(tmp_path / "a.glb")
    assert sorted(scene.geometry) == ["stroke 0", "stroke 1", "stroke 2"]
    looks = [scene.geometry[f"stroke {i}"].visual.material for i in range(3)]
    # glTF has linear colours, which trimesh shows as they are.
    assert looks[0].baseColorFactor.tolist() == [255, round(255 * 0.2140), 0, 255]
    assert looks[0].name == looks[2].name == "#ff8000"
    mesh = surface(tmp_path / "a.glb")
    extent = mesh.bounds[1] - mesh.bounds[0]
    np.testing.assert_allclose(extent, [0.011, 0.001, 0.001], rtol=0.06)
    np.testing.assert_allclose(mesh.bounds.mean(0), [40000.005, 40000, 40000], atol=1e-5)


def test_strokes_without_width_show_nothing(tmp_path):
    with pytest.raises(ValueError, match="needs at least one stroke with a width, got none of 1"):
        ds.save(tmp_path / "a.glb", stroke([[0.0, 0, 0], [1, 0, 0]], 0.0))
    assert list(tmp_path.iterdir()) == []


def primitives(path):
    """What the JSON of a file says of each mesh, and its numbers: read by the standard's own rules, not by our code."""
    content = path.read_bytes()
    length = struct.unpack("<I", content[12:16])[0]
    said, buffer = json.loads(content[20 : 20 + length]), content[28 + length :]

    def values(number):
        accessor = said["accessors"][number]
        view = said["bufferViews"][accessor["bufferView"]]
        kind = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
        numbers = np.frombuffer(buffer[view["byteOffset"] :][: view["byteLength"]], kind)
        return numbers.reshape(accessor["count"], -1)

    for mesh in said["meshes"]:
        (primitive,) = mesh["primitives"]
        place = said["accessors"][primitive["attributes"]["POSITION"]]
        yield primitive, said["materials"][primitive["material"]], place, values


def test_lines_in_place_of_tubes(tmp_path):
    """A closed circle of radius 2 and an open line of width 0, each in its colour, by trimesh and by the standard."""
    points, weights = ds.bezier.circle((5.0, 0.0, 0.0), 2.0, normal=(0.0, 0.0, 1.0))
    ring = ds.Sketch(points, weights, color=(1.0, 0.5, 0.0), chains=ds.Chains.of([len(points)], True))
    line = ds.Sketch(torch.tensor([[[1.0, 2, 3], [2, 2, 3], [3, 2, 3], [4, 2, 3]]]).double(), width=0.0, opacity=0.5)
    save_glb(tmp_path / "a.glb", ds.Sketch.concatenate([ring, line]), unit="m", lines=True)
    scene = read(tmp_path / "a.glb")
    assert sorted(scene.geometry) == ["stroke 0", "stroke 1"]
    circle, straight = (path for path in (scene.geometry[f"stroke {i}"] for i in range(2)))
    # z, x, y of the file are x, y, z of the sketch; the root's place is the middle of all.
    place = scene.graph.get("stroke 0")[0][:3, 3]
    places = (np.asarray(circle.vertices) + place)[:, [2, 0, 1]]
    np.testing.assert_allclose(np.hypot(places[:, 0] - 5, places[:, 1]), 2, atol=1e-3)
    assert (circle.vertices[0] == circle.vertices[-1]).all()
    assert circle.length == pytest.approx(4 * math.pi, rel=1e-3)
    assert straight.length == pytest.approx(3, rel=1e-6)
    for primitive, _, bounds, values in primitives(tmp_path / "a.glb"):
        vertices, indices = values(primitive["attributes"]["POSITION"]), values(primitive["indices"])[:, 0]
        assert primitive["mode"] == 1
        assert len(indices) % 2 == 0
        assert indices.max() == len(vertices) - 1
        assert bounds["min"] == vertices.min(0).tolist()
        assert bounds["max"] == vertices.max(0).tolist()
        # Each line goes on where the one before ends.
        assert (indices[1:-1:2] == indices[2::2]).all()
    looks = [material for _, material, _, _ in primitives(tmp_path / "a.glb")]
    assert [look["name"] for look in looks] == ["#ff8000", "#000000"]
    assert looks[1]["alphaMode"] == "BLEND"


def test_a_file_of_lines_needs_a_stroke(tmp_path):
    with pytest.raises(ValueError, match=r"a GLB file needs at least one stroke, got none$"):
        save_glb(tmp_path / "a.glb", ds.Sketch(torch.zeros(0, 4, 3)), lines=True)
    assert list(tmp_path.iterdir()) == []
