"""`diff3ds export`: sizes, units and frames as other programs read them."""

import json

import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds.cli import main

SKETCH = ds.Sketch(torch.tensor([[[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]], dtype=torch.float64), width=0.25)


@pytest.fixture
def source(tmp_path):
    ds.save(tmp_path / "run" / "sketch.json", SKETCH)
    return tmp_path / "run"


def fails(arguments, capsys) -> str:
    with pytest.raises(SystemExit) as ended:
        main([str(a) for a in arguments])
    assert ended.value.code == 1
    return " ".join(capsys.readouterr().err.split())


def test_a_run_and_a_file_are_the_same_source(source, tmp_path):
    main(["export", str(source), str(tmp_path / "a ü.json"), "--quiet"])
    main(["export", str(source / "sketch.json"), str(tmp_path / "b.json"), "--quiet"])
    assert (tmp_path / "a ü.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert torch.equal(ds.load(tmp_path / "a ü.json").points, SKETCH.points)


def test_scale_and_the_axis_that_points_up(source, tmp_path):
    """With y up, what was up (z) is y, and what came towards the viewer of the front (-y) is z."""
    main(["export", str(source), str(tmp_path / "a.json"), "--scale", "10", "--up", "y", "--quiet"])
    points = ds.load(tmp_path / "a.json").points
    torch.testing.assert_close(points[0, 1], torch.tensor([10.0, 30.0, -20.0], dtype=torch.float64))


def test_so_many_strokes_at_most(tmp_path):
    """The two longest of three lines, of a file that says nothing of importance; what is written does."""
    lines = torch.tensor([[[0.0, 0, 0], [1, 0, 0]], [[0, 5, 0], [3, 5, 0]], [[0, 0, 5], [2, 0, 5]]])
    ds.save(tmp_path / "a.json", ds.Sketch(lines))
    main(["export", str(tmp_path / "a.json"), str(tmp_path / "b.json"), "--strokes", "2", "--quiet"])
    few = ds.load(tmp_path / "b.json")
    assert torch.equal(few.points, lines[[1, 2]])
    assert few.importance[0] > few.importance[1] > 0
    main(["export", str(tmp_path / "b.json"), str(tmp_path / "c.json"), "--detail", "0", "--quiet"])
    assert torch.equal(ds.load(tmp_path / "c.json").points, lines[[1]])


def test_world_widths_scale_with_the_sketch(tmp_path):
    sketch = ds.Sketch(SKETCH.points, width=0.25, width_space="world")
    ds.save(tmp_path / "a.json", sketch)
    main(["export", str(tmp_path / "a.json"), str(tmp_path / "b.json"), "--scale", "4", "--quiet"])
    assert ds.load(tmp_path / "b.json").width.item() == pytest.approx(1.0)


@pytest.mark.usefixtures("read_here")
@needs("OCP")
@pytest.mark.parametrize(("unit", "millimetres"), [("mm", 1), ("cm", 10), ("m", 1000), ("in", 25.4), ("ft", 304.8)])
def test_occt_reads_the_unit_of_a_step_file(unit, millimetres, source, tmp_path):
    main(["export", str(source), str(tmp_path / "a.step"), "--unit", unit, "--quiet"])
    end = ds.load(tmp_path / "a.step").points[0, -1]
    torch.testing.assert_close(end, SKETCH.points[0, -1] * millimetres, rtol=1e-12, atol=0)


def test_lines_of_a_glb_file_in_its_unit(source, tmp_path):
    import trimesh

    main(["export", str(source), str(tmp_path / "a.glb"), "--lines", "--unit", "cm", "--quiet"])
    (line,) = trimesh.load_scene(tmp_path / "a.glb").geometry.values()
    assert line.length == pytest.approx(14**0.5 / 100)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a.glb", "--up", "y"], "GLB files have y up by themselves: leave --up out"),
        (["a.json", "--dxf-polylines"], "a.json: --dxf-polylines is for .dxf files"),
        (["a.json", "--lines"], "a.json: --lines is for .glb files"),
        (["a.xyz"], "cannot save as '.xyz', only as .json"),
        (["a.png"], 'a.png: a picture is drawn by "diff3ds render'),
        (["a.json", "--unit", "m"], "a .json file says no unit of length: scale the sketch instead"),
        (["a.json", "--scale", "0"], "--scale must be positive, got 0"),
        (["a.json", "--scale", "nan"], "--scale must be finite"),
    ],
)
def test_faults_are_sentences_and_leave_nothing(arguments, message, source, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert message in fails(["export", source, *arguments], capsys)
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_a_folder_without_a_sketch_and_one_without_strokes(tmp_path, capsys):
    assert f"{tmp_path} has no sketch.json" in fails(["export", tmp_path, tmp_path / "a.json"], capsys)
    ds.save(tmp_path / "none.json", ds.Sketch(torch.zeros(0, 4, 3)))
    assert "the sketch has no strokes" in fails(["export", tmp_path / "none.json", tmp_path / "a.json"], capsys)
    assert json.loads((tmp_path / "none.json").read_text())["points"] == []
