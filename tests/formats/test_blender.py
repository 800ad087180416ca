"""Scripts for Blender: what they build, read by SciPy; `in_blender` has them run by Blender itself."""

import ast
import json
import re
import sys
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
import torch
from scipy.interpolate import BSpline

from diff3ds import Chains, Sketch, bezier, save
from diff3ds.bezier import evaluate
from diff3ds.formats.scenes.blender import FRAMES, save_blender


def sketch() -> Sketch:
    """A closed chain of a circle, rational cubics, and translucent lines that taper."""
    points, weights = bezier.circle((0.0, 0.0, 0.2), 0.8)
    ring = Sketch(points.float(), weights.float(), width=0.02, chains=Chains.of([len(points)], True))
    generator = torch.Generator().manual_seed(0)
    bent = Sketch(
        torch.rand(3, 4, 3, generator=generator) - 0.5,
        0.4 + torch.rand(3, 4, generator=generator),
        width=0.01,
        color=(0.8, 0.1, 0.1),
    )
    lines = Sketch(
        torch.rand(2, 2, 3, generator=generator) - 0.5,
        width=torch.tensor([[0.02, 0.0], [0.01, 0.03]]),
        color=(0.1, 0.1, 0.8),
        opacity=0.5,
    )
    return Sketch.concatenate([ring, bent, lines])


def along(whole: Sketch, stroke: int, count: int) -> np.ndarray:
    """Points of a stroke, and the full widths there."""
    chains = whole.chains
    assert chains is not None
    rows = slice(int(chains.first[stroke]), int(chains.first[stroke + 1]))
    return evaluate(whole.points[rows].double(), whole.weights[rows].double(), torch.linspace(0, 1, count)).numpy()


def scene_of(path) -> dict:
    text = path.read_text()
    ast.parse(text)
    found = re.search(r'json\.loads\(r"""(.*?)"""\)', text)
    assert found is not None
    return json.loads(found[1])


def test_the_numbers_are_the_sketch(tmp_path) -> None:
    whole = sketch()
    save(tmp_path / "scene.py", whole)
    scene = scene_of(tmp_path / "scene.py")
    assert len(scene["strokes"]) == len(whole)
    assert scene["frames"] == FRAMES
    for n, stroke in enumerate(scene["strokes"]):
        points = np.array(stroke["points"])
        # As Blender evaluates a spline of order 4 with Bezier ends: knots of multiplicity 3.
        segments = (len(points) - 1) // 3
        knots = np.repeat(np.arange(segments + 1.0), [4, *[3] * (segments - 1), 4])
        homogeneous = np.concatenate([points[:, :3] * points[:, 3:], points[:, 3:]], 1)
        curve = BSpline(knots, homogeneous, 3)
        expected = along(whole, n, 9)
        at = np.linspace(0, 1, 9) + np.arange(segments)[:, None]
        got = curve(np.minimum(at, segments))
        np.testing.assert_allclose(got[..., :3] / got[..., 3:], expected, atol=1e-12)
        assert stroke["color"] == pytest.approx([*whole.color[n].tolist(), float(whole.opacity[n])])
    taper = scene["strokes"][-2]["radii"]
    # Straight from its thick end to nothing.
    assert np.allclose(np.diff(taper), taper[-1] / 3 - taper[0] / 3)
    assert taper[-1] == 0
    assert taper[0] > 0


def test_world_widths_are_diameters(tmp_path) -> None:
    save(tmp_path / "scene.py", Sketch(torch.rand(1, 4, 3), width=0.25, width_space="world"))
    assert scene_of(tmp_path / "scene.py")["strokes"][0]["radii"] == [0.125] * 4


def test_a_sketch_that_has_become_invalid_leaves_the_old_file(tmp_path) -> None:
    whole = sketch()
    (tmp_path / "scene.py").write_text("old")
    whole.opacity.data[1] = 3.0
    with pytest.raises(ValueError, match="opacity of stroke 1"):
        save(tmp_path / "scene.py", whole)
    assert (tmp_path / "scene.py").read_text() == "old"


class Told:
    """Settings of a scene that remember in which order they were set.

    A video is none before its kind is said, and has no transparency.
    """

    def __init__(self, **values) -> None:
        known = [SimpleNamespace(identifier=name, is_readonly=False, type="ENUM") for name in values]
        self.__dict__.update(values, told=[], bl_rna=SimpleNamespace(properties=known))

    def __setattr__(self, name, value) -> None:
        if (name, value) == ("file_format", "FFMPEG") and getattr(self, "media_type", "VIDEO") != "VIDEO":
            raise TypeError('enum "FFMPEG" not found in ("JPEG", "PNG")')
        self.told.append((name, value))
        self.__dict__[name] = value
        if value == "FFMPEG":
            self.__dict__["color_mode"] = "RGB"


def thing(name, kind, **data) -> SimpleNamespace:
    """An object that stands where Blender's own does."""
    place = {"Light": (4.07625, 1.00545, 5.90386), "Camera": (7.35889, -6.92579, 4.95831)}.get(name, (0.0, 0.0, 0.0))
    none = dict.fromkeys(("animation_data", "parent", "modifiers", "constraints"))
    return SimpleNamespace(name=name, type=kind, data=SimpleNamespace(**data), location=place, scale=(1, 1, 1), **none)


def corners(count, side=1.0) -> list[SimpleNamespace]:
    return [SimpleNamespace(co=(side, -side, side)) for _ in range(count)]


def opened(monkeypatch, tmp_path, objects, image, arguments=(), file="", camera=None, world=None):
    """Runs the script in a Blender that does nothing, with this scene open; the scene and what was removed of it."""
    scene = MagicMock(camera=camera, world=world, objects=objects, frame_start=7, frame_end=999, frame_current=8)
    scene.render.image_settings = image
    data = MagicMock(filepath=file, scenes=[scene])
    data.objects.__iter__.side_effect = lambda: iter(list(objects))
    data.objects.remove.side_effect = objects.remove
    bpy = MagicMock(data=data, context=SimpleNamespace(scene=scene))
    monkeypatch.setitem(sys.modules, "bpy", bpy)
    monkeypatch.setitem(sys.modules, "mathutils", MagicMock())
    monkeypatch.setattr(sys, "argv", ["blender", "--", *arguments] if arguments else ["blender"])
    save(tmp_path / "scene.py", sketch())
    exec(compile((tmp_path / "scene.py").read_text(), "scene.py", "exec"), {"__name__": "__main__"})
    return scene, bpy


BEGUN = [("Cube", "MESH", {"vertices": corners(8)}), ("Light", "LIGHT", {}), ("Camera", "CAMERA", {})]


@pytest.mark.parametrize(
    ("file", "names", "cube", "changed"),
    [
        ("house.blend", ("Cube", "Light", "Camera"), corners(8), {}),
        ("", ("Cube", "Light", "Camera"), corners(240), {}),
        ("", ("Cube", "Light", "Camera"), corners(8, 1.5), {}),
        ("", ("Cube", "Light", "Camera"), corners(8), {"location": (0.0, 0.0, 1.0)}),
        ("", ("Cube", "Light", "Camera"), corners(8), {"modifiers": ["subdivision"]}),
        ("", ("Cube", "Light", "Camera.001"), corners(8), {}),
        ("", ("three weeks of work", "Light", "Camera"), corners(8), {}),
    ],
)
def test_what_was_there_stays_as_it_was(monkeypatch, tmp_path, file, names, cube, changed) -> None:
    kinds = ("MESH", "LIGHT", "CAMERA")
    objects = [thing(name, kind, vertices=cube) for name, kind in zip(names, kinds, strict=True)]
    vars(objects[0]).update(changed)
    camera, world = objects[2], object()
    scene, bpy = opened(monkeypatch, tmp_path, objects, Told(), file=file, camera=camera, world=world)
    assert [made.name for made in objects] == list(names)
    assert (scene.camera, scene.world, scene.frame_start, scene.frame_end) == (camera, world, 7, 999)
    assert not bpy.data.cameras.new.called
    assert not bpy.data.lights.new.called
    assert not bpy.data.worlds.new.called
    # All of it lies in one collection of the open scene.
    scene.collection.children.link.assert_called_once()
    assert not scene.collection.objects.link.called


def test_only_what_blender_begins_with_gives_way(monkeypatch, tmp_path) -> None:
    objects = [thing(name, kind, **data) for name, kind, data in BEGUN]
    scene, bpy = opened(monkeypatch, tmp_path, objects, Told(), camera=None, world=object())
    assert objects == []
    assert scene.world is bpy.data.worlds.new.return_value
    assert scene.frame_end == FRAMES
    assert bpy.data.lights.new.called


@pytest.mark.parametrize("newest", [True, False])
@pytest.mark.parametrize("turning", [True, False])
def test_pictures_and_films_leave_the_settings_as_they_were(monkeypatch, tmp_path, newest, turning) -> None:
    """Since Blender 5.0 the kind of media comes before the format, which it changes."""
    image = Told(file_format="OPEN_EXR", color_mode="RGBA", **({"media_type": "IMAGE"} if newest else {}))
    camera, arguments = object(), ["film.mp4", "64", "32", *(["--turntable"] if turning else [])]
    scene, bpy = opened(monkeypatch, tmp_path, [], image, arguments, "house.blend", camera)
    bpy.ops.render.render.assert_called_once_with(animation=turning, write_still=not turning)
    expected = [("media_type", "VIDEO" if turning else "IMAGE"), ("file_format", "FFMPEG" if turning else "PNG")]
    # Back again, but for what stayed as it was.
    expected += [*[("media_type", "IMAGE")] * turning, ("file_format", "OPEN_EXR"), *[("color_mode", "RGBA")] * turning]
    assert image.told == [told for told in expected if newest or told[0] != "media_type"]
    assert (scene.camera, scene.frame_start, scene.frame_end) == (camera, 7, 999)
    assert bpy.data.cameras.new.called == turning
    scene.frame_set.assert_called_once_with(8)


def test_strokes_have_names_and_lie_in_collections_of_things_and_kinds(tmp_path) -> None:
    whole = sketch().replace(names=("lamp/rod/edge 1", "lamp/edge", "", "", "", ""), kinds=["crease", *[""] * 4, "rim"])
    save(tmp_path / "scene.py", whole)
    strokes = scene_of(tmp_path / "scene.py")["strokes"]
    assert [stroke["name"] for stroke in strokes[:3]] == ["lamp/rod/edge 1", "lamp/edge", "stroke 2"]
    assert [stroke["layers"] for stroke in strokes[:3]] == [["lamp", "rod", "crease"], ["lamp"], ["strokes"]]
    assert strokes[5]["layers"] == ["rim"]


def test_widths_of_weighted_strokes_are_those_of_the_sketch(tmp_path) -> None:
    """Blender weighs radii as it does points: a stroke whose width changes is cut until that makes no difference."""
    weights = torch.tensor([[1.0, 6.0, 0.3, 2.0]], dtype=torch.float64)
    width = torch.tensor([[0.0, 0.3, 0.05, 0.2]], dtype=torch.float64)
    points = torch.rand(1, 4, 3, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    whole = Sketch(points, weights, width=width, width_space="world")
    save(tmp_path / "scene.py", whole)
    (stroke,) = scene_of(tmp_path / "scene.py")["strokes"]
    control, radii = torch.tensor(stroke["points"], dtype=torch.float64), torch.tensor(stroke["radii"]).double()
    rows = torch.arange((len(control) - 1) // 3)[:, None] * 3 + torch.arange(4)
    assert len(rows) > 1
    t = torch.linspace(0, 1, 33, dtype=torch.float64)
    basis = bezier.curves.bernstein(t, 3)
    there = evaluate(control[rows][..., :3], control[rows][..., 3], t).flatten(0, 1)
    weighed = (basis @ (radii * control[:, 3])[rows].T / (basis @ control[:, 3][rows].T)).T.flatten()
    at, _, away = bezier.closest_point(points[0], weights[0], there)
    assert away.max() < 1e-9
    np.testing.assert_allclose(weighed, bezier.curves.bernstein(at, 3) @ width[0] / 2, atol=3e-3 * 0.15)


def test_grease_pencil_is_within_a_thousandth_of_the_sketch(tmp_path) -> None:
    whole = sketch()
    save_blender(tmp_path / "scene.py", whole, strokes="grease-pencil", unit="cm")
    scene = scene_of(tmp_path / "scene.py")
    assert [layer["name"] for layer in scene["layers"]] == ["#000000", "#cc1a1a", "#1a1acc"]
    assert scene["metres"] == 0.01
    strokes = [stroke for layer in scene["layers"] for stroke in layer["frames"][0]]
    assert [stroke["cyclic"] for stroke in strokes] == [True, *[False] * 5]
    for n, stroke in enumerate(strokes):
        knots = torch.tensor([*stroke["points"], *stroke["points"][: stroke["cyclic"]]], dtype=torch.float64)
        cubics = torch.cat([knots[:-1, 1:], knots[1:, :2]], 1)
        there = evaluate(cubics, torch.ones(len(cubics), 4).double(), torch.linspace(0, 1, 17).double()).numpy()
        exact = along(whole, n, 4001).reshape(-1, 3)
        away = np.sqrt(((there.reshape(-1, 1, 3) - exact) ** 2).sum(-1)).min(1)
        assert away.max() < 1e-3


@pytest.mark.parametrize("given", [{"strokes": "tubes"}, {"unit": "parsec"}])
def test_what_blender_cannot_be_told_is_refused(unchecked, tmp_path, given) -> None:
    with pytest.raises(ValueError, match="must be"):
        save_blender(tmp_path / "scene.py", sketch(), **given)
    assert not (tmp_path / "scene.py").exists()
