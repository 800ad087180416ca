"""`diff3ds mesh`: sketches and drawings of meshes whose lines are known."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

import diff3ds as ds
from diff3ds.cli import FAULT, main
from diff3ds.formats import load_image
from diff3ds.tasks.mesh.draw_mesh import MeshSketch, run_mesh
from diff3ds.tasks.mesh.mesh_options import MeshOptions

pytest.importorskip("trimesh", reason="makes balls")

FEW = ["--quiet", "--turntable", "0", "--size", "128"]


def obj(path: Path, vertices: np.ndarray, faces: np.ndarray) -> Path:
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
    lines += ["f " + " ".join(str(i + 1) for i in face) for face in faces]
    path.write_text("\n".join(lines))
    return path


def box(path: Path, size=(3.0, 2.0, 1.0), at=(0.0, 0.0, 0.0)) -> Path:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) * size + at
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return obj(path, corners, np.array(faces))


def cylinder(path: Path, count: int = 48, height: float = 2.0) -> Path:
    turn = 2 * np.pi * np.arange(count) / count
    ring = np.stack([np.cos(turn), np.sin(turn)], 1)
    vertices = np.concatenate([np.column_stack([ring, np.full(count, z)]) for z in (0.0, height)])
    sides = [(i, (i + 1) % count, count + (i + 1) % count, count + i) for i in range(count)]
    lines = [f"v {x} {y} {z}" for x, y, z in vertices]
    for face in (*sides, tuple(reversed(range(count))), tuple(range(count, 2 * count))):
        lines.append("f " + " ".join(str(i + 1) for i in face))
    path.write_text("\n".join(lines))
    return path


def ball(path: Path, radius: float = 2.0) -> Path:
    import trimesh

    mesh = trimesh.creation.icosphere(3, radius)
    return obj(path, mesh.vertices, mesh.faces)


def ran(out: Path) -> dict:
    return json.loads((out / "run.json").read_text())


def paths(file: Path) -> int:
    return file.read_text().count("<path")


def test_a_box_has_twelve_edges_and_shows_nine(tmp_path):
    main(["mesh", str(box(tmp_path / "box.obj", at=(100.0, 50.0, -3.0))), "-o", str(tmp_path / "out"), *FEW])
    sketch, run = ds.load(tmp_path / "out" / "sketch.json"), ran(tmp_path / "out")
    assert len(sketch) == 12
    assert run["kinds"] == {"crease": 12}
    assert run["outlines_drawn"] == 1
    ends = sketch.points[:, [0, -1]].reshape(-1, 3)
    # In the file's own place.
    assert ends.amin(0).tolist() == [100, 50, -3]
    assert ends.amax(0).tolist() == [103, 52, -2]
    assert [paths(tmp_path / "out" / f"drawing-{i}.svg") for i in (1, 2, 3, 4)] == [9] * 4
    assert load_image(tmp_path / "out" / "drawing-2.png").shape == (128, 128, 3)
    surface = ds.load_surface(tmp_path / "out" / "surface.glb")
    assert np.allclose(surface.bounds, [[100, 50, -3], [103, 52, -2]])
    assert not (tmp_path / "out" / "turntable.webp").exists()


@pytest.mark.parametrize(("hidden", "strokes"), [("show", 12), ("faint", 12), ("drop", 9)])
def test_hidden_lines_are_what_one_asks_for(tmp_path, hidden, strokes):
    main(
        [
            "mesh",
            str(box(tmp_path / "box.obj")),
            "-o",
            str(tmp_path / "out"),
            *FEW,
            "--hidden",
            hidden,
            "--azimuth",
            "40",
        ]
    )
    assert paths(tmp_path / "out" / "drawing-1.svg") == strokes


def test_a_cylinder_has_two_circles_and_two_outlines_from_each_side(tmp_path):
    source = cylinder(tmp_path / "can.obj")
    main(["mesh", str(source), "-o", str(tmp_path / "a"), *FEW, "--azimuth", "40", "--hidden", "show"])
    main(["mesh", str(source), "-o", str(tmp_path / "b"), *FEW, "--azimuth", "40", "--hidden", "show", "--no-contours"])
    sketch = ds.load(tmp_path / "a" / "sketch.json")
    assert sketch.chains.closed.tolist() == [True, True]
    assert ran(tmp_path / "a")["kinds"] == {"crease": 2}
    assert paths(tmp_path / "a" / "drawing-1.svg") == 4
    assert paths(tmp_path / "b" / "drawing-1.svg") == 2


def test_the_strokes_of_a_run_are_sorted_by_importance(tmp_path):
    """With their layers: a box's edges, and what the file says is what the function gives."""
    out = tmp_path / "out"
    sketch = run_mesh(box(tmp_path / "box.obj", (8, 1, 2)), out, MeshOptions(turntable=0, size=64))
    found = ds.load(out)
    assert torch.equal(found.importance, sketch.importance)
    assert torch.equal(found.points, sketch.points)
    assert len(found) == 12
    assert bool((found.importance[1:] <= found.importance[:-1]).all())
    lengths = (found.points[:, -1] - found.points[:, 0]).norm(dim=1)
    assert lengths[:4].tolist() == pytest.approx([8] * 4)
    assert lengths[8:].tolist() == pytest.approx([1] * 4)
    assert len(found.at_detail(0.2)) == 4


def test_a_ball_is_drawn_by_great_circles(tmp_path, capsys):
    main(["mesh", str(ball(tmp_path / "ball.obj")), "-o", str(tmp_path / "out"), *FEW[1:], "--strokes", "3"])
    assert "the mesh is smooth: its creases and borders draw 0% of its outlines" in " ".join(
        capsys.readouterr().err.split()
    )
    sketch = ds.load(tmp_path / "out" / "sketch.json")
    assert ran(tmp_path / "out")["kinds"] == {"contour": 3}
    on = ds.bezier.evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 9, dtype=sketch.points.dtype))
    assert float((on.norm(dim=-1) - 2).abs().max()) < 0.03
    # Each in a plane through the middle, which are far from each other.
    normals = []
    for stroke in range(3):
        places = on[sketch.chains.stroke == stroke].flatten(0, 1)
        normal = torch.linalg.svd(places, full_matrices=False).Vh[2]
        assert float((places @ normal).abs().max()) < 0.2
        normals.append(normal)
    across = torch.stack(normals)
    assert float((across @ across.T - torch.eye(3)).abs().max()) < 0.6


def test_creases_that_are_scraps_are_left_out_unless_an_angle_is_given(tmp_path, monkeypatch):
    """A ball with three bumps whose tops are sharp along one edge; what is made of its outlines is left out here."""
    import trimesh

    mesh = trimesh.creation.icosphere(2, 1.0)
    vertices = np.array(mesh.vertices)
    a, b = mesh.edges_unique[[10, 200, 400]].T
    vertices[a] *= 1.12
    vertices[b] *= 1.12
    source = obj(tmp_path / "ball.obj", vertices, mesh.faces)
    creases = []

    def features(surface, options, report, edges):
        creases.append(int(surface.is_crease.sum()))
        stroke = ds.Sketch(torch.tensor([[[0.0, 0, -1], [0, 0, 1]]], dtype=torch.float64))
        return MeshSketch(stroke, ("crease",), 0.0)

    monkeypatch.setattr("diff3ds.tasks.mesh.draw_mesh.sketch_mesh", features)
    main(["mesh", str(source), "-o", str(tmp_path / "a"), *FEW, "--azimuth", "0"])
    main(["mesh", str(source), "-o", str(tmp_path / "b"), *FEW, "--azimuth", "0", "--angle", "38"])
    assert creases == [0, 3]


@pytest.mark.slow
def test_the_function_is_the_command(tmp_path):
    sketch = ds.mesh_to_sketch(box(tmp_path / "box.obj"), strokes=4, up="y", turntable=0, size=32)
    # The four longest edges, along x in the file, which with y up lie along y.
    span = (sketch.points[:, -1] - sketch.points[:, 0]).abs()
    assert span.tolist() == [[0, 3, 0]] * 4
    every, low = (ds.mesh_to_sketch(tmp_path / "box.obj", detail=d, up="y", turntable=0, size=32) for d in (1.0, 0.3))
    assert 1 <= len(low) < len(every)
    assert torch.equal(low.points, every.at_detail(0.3).points)
    assert low.kinds == every.at_detail(0.3).kinds
    with pytest.raises(TypeError, match="no option 'stroke'"):
        ds.mesh_to_sketch(tmp_path / "box.obj", stroke=4)


def test_what_an_overwritten_run_drew_is_gone(tmp_path):
    arguments = ["mesh", str(box(tmp_path / "box.obj")), "-o", str(tmp_path / "out"), "--quiet", "--size", "32"]
    main([*arguments, "--azimuth", "0", "40", "80", "--turntable", "2"])
    main([*arguments, "--azimuth", "10", "--turntable", "0", "--overwrite"])
    drawn = {path.name for path in (tmp_path / "out").iterdir() if path.name.startswith(("drawing", "turntable"))}
    assert drawn == {"drawing-1.svg", "drawing-1.png", "drawing-1.step"}


def test_a_run_that_was_killed_between_its_drawings_does_not_look_done(tmp_path, monkeypatch):
    def killed(*arguments):
        raise KeyboardInterrupt

    out = tmp_path / "out"
    monkeypatch.setattr("diff3ds.tasks.mesh.draw_mesh.save_movie", killed)
    with pytest.raises(KeyboardInterrupt):
        run_mesh(box(tmp_path / "box.obj"), out, MeshOptions(size=32, turntable=2))
    assert (out / "drawing-1.svg").exists()
    assert not (out / "run.json").exists()


def test_a_run_that_is_killed_leaves_the_one_that_it_overwrites(tmp_path, monkeypatch):
    def killed(*arguments, page):
        raise KeyboardInterrupt

    source, out = box(tmp_path / "box.obj"), tmp_path / "out"
    run_mesh(source, out, MeshOptions(size=32, turntable=2))
    before = sorted(path.name for path in out.iterdir())
    monkeypatch.setattr("diff3ds.tasks.mesh.draw_mesh.write_results", killed)
    with pytest.raises(KeyboardInterrupt):
        run_mesh(source, out, MeshOptions(size=32, turntable=0, strokes=2, overwrite=True))
    assert sorted(path.name for path in out.iterdir()) == before


def test_a_turntable_turns(tmp_path):
    main(
        [
            "mesh",
            str(box(tmp_path / "box.obj")),
            "-o",
            str(tmp_path / "out"),
            *FEW[:1],
            "--size",
            "64",
            "--turntable",
            "3",
        ]
    )
    with Image.open(tmp_path / "out" / "turntable.webp") as film:
        assert film.n_frames == 3


def fails(arguments, capsys) -> str:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code in (FAULT, 2)
    return " ".join(capsys.readouterr().err.split())


def test_what_is_refused_leaves_no_files(tmp_path, capsys):
    out = ["-o", str(tmp_path / "out"), "--quiet"]
    (tmp_path / "empty.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    assert "empty.obj" in fails(["mesh", str(tmp_path / "empty.obj"), *out], capsys)
    assert "none.obj" in fails(["mesh", str(tmp_path / "none.obj"), *out], capsys)
    (tmp_path / "a.txt").write_text("x")
    assert "cannot load '.txt' as a mesh" in fails(["mesh", str(tmp_path / "a.txt"), *out], capsys)
    good = str(box(tmp_path / "box.obj"))
    assert "--strokes must be a whole number, at least 1" in fails(["mesh", good, *out, "--strokes", "0"], capsys)
    assert "--angle must be between 0 and 180" in fails(["mesh", good, *out, "--angle", "180"], capsys)
    assert "--turntable must be 0" in fails(["mesh", good, *out, "--turntable", "1"], capsys)
    assert not (tmp_path / "out").exists()
    main(["mesh", good, *out, *FEW[1:], "--azimuth", "0"])
    assert "holds a run" in fails(["mesh", good, *out], capsys)


def labels(file: Path) -> set[str]:
    """The layers of an SVG file, as Inkscape shows them."""
    import xml.etree.ElementTree as ET

    groups = ET.fromstring(file.read_text()).iter("{http://www.w3.org/2000/svg}g")
    found = {g.get("{http://www.inkscape.org/namespaces/inkscape}label"): len(g) for g in groups}
    assert all(count > 0 for count in found.values())
    return set(found)


@pytest.mark.slow
def test_hatching_is_a_layer_of_its_own(tmp_path):
    source = cylinder(tmp_path / "can.obj")
    how = ["--azimuth", "40", "--hatch", "light", "--spacing", "8"]
    main(["mesh", str(source), "-o", str(tmp_path / "out"), *FEW, *how])
    assert labels(tmp_path / "out" / "drawing-1.svg") == {"crease", "contour", "hatching"}
    told = json.loads((tmp_path / "out" / "run.json").read_text())
    assert told["options"]["hatch"] == "light"
    # The sketch itself, which is seen from everywhere, has none.
    assert len(ds.load(tmp_path / "out" / "sketch.json")) == 2


def test_layers_say_what_lines_are(tmp_path):
    source = cylinder(tmp_path / "can.obj")
    for hidden, wanted in (
        ("drop", {"crease", "contour"}),
        ("show", {"crease", "contour"}),
        ("dashed", {"crease", "contour", "crease, hidden"}),
        ("faint", {"crease", "contour", "crease, hidden"}),
    ):
        main(["mesh", str(source), "-o", str(tmp_path / hidden), *FEW, "--azimuth", "40", "--hidden", hidden])
        assert labels(tmp_path / hidden / "drawing-1.svg") == wanted
        step = (tmp_path / hidden / "drawing-1.step").read_text()
        assert set(re.findall(r"LAYER_ASSIGNMENT\('(.*?)'", step)) == {name.replace(",", "") for name in wanted}
    assert "LAYER_ASSIGNMENT('crease'" in (tmp_path / "drop" / "sketch.step").read_text()
