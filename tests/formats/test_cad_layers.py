"""Layers that are named by the caller in STEP and DXF files."""

import re

import pytest
import torch

import diff3ds as ds
from diff3ds.formats.cad.step import save_step

LAYERS = ["crease", "crease, hidden", "crease"]


def three() -> ds.Sketch:
    points = torch.tensor([[[0.0, i, 0], [1, i, 0]] for i in range(3)])
    return ds.Sketch(points, color=torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 0, 1]]))


def test_step_files_have_the_strokes_of_each_layer(tmp_path):
    save_step(tmp_path / "a.step", three(), layers=LAYERS)
    found = re.findall(r"PRESENTATION_LAYER_ASSIGNMENT\('(.*?)','',\((.*?)\)\)", (tmp_path / "a.step").read_text())
    # DXF takes no commas, and programs turn one into the other.
    assert {name: len(some.split(",")) for name, some in found} == {"crease": 2, "crease hidden": 1}
    save_step(tmp_path / "b.step", three())
    assert "'COLOR_FF0000'" in (tmp_path / "b.step").read_text()


@pytest.mark.slow
def test_dxf_files_have_them_too_and_keep_colours(tmp_path):
    ezdxf = pytest.importorskip("ezdxf", reason="takes the extra cad")
    ds.formats.save_dxf(tmp_path / "a.dxf", three(), layers=LAYERS)
    lines = list(ezdxf.readfile(tmp_path / "a.dxf").modelspace())
    assert [line.dxf.layer for line in lines] == ["crease", "crease hidden", "crease"]
    assert torch.equal(ds.load(tmp_path / "a.dxf").color.double(), three().color.double())


def test_names_of_strokes_are_those_of_curves(tmp_path):
    ezdxf = pytest.importorskip("ezdxf", reason="takes the extra cad")
    rhino3dm = pytest.importorskip("rhino3dm", reason="takes the extra cad")
    sketch = three().replace(names=["bolt/edge 1", "", "x" * 300])
    ds.save(tmp_path / "a.step", sketch)
    text = (tmp_path / "a.step").read_text()
    assert "TRIMMED_CURVE('bolt/edge 1'" in text
    assert "TRIMMED_CURVE('stroke 1'" in text
    ds.save(tmp_path / "a.dxf", sketch)
    lines = list(ezdxf.readfile(tmp_path / "a.dxf").modelspace())
    told = [[tag.value for tag in line.get_xdata("DIFF3DS")] for line in lines]
    assert told == [["stroke", 0, "bolt/edge 1"], ["stroke", 1], ["stroke", 2, "x" * 255]]
    assert len(ds.load(tmp_path / "a.dxf")) == 3
    ds.save(tmp_path / "a.3dm", sketch)
    objects = rhino3dm.File3dm.Read(str(tmp_path / "a.3dm")).Objects
    assert [objects[i].Attributes.Name for i in range(2)] == ["bolt/edge 1", "stroke 1"]


def test_names_of_strokes_are_labels_of_paths(tmp_path):
    from xml.etree import ElementTree

    sketch = three().replace(names=["bolt/edge 1", "", 'a "<b>" & ø'])
    ds.save(tmp_path / "a.svg", sketch, ds.orbit(30, 30, 8))
    label = "{http://www.inkscape.org/namespaces/inkscape}label"
    paths = {
        path.get("id"): path.get(label)
        for path in ElementTree.parse(tmp_path / "a.svg").iter("{http://www.w3.org/2000/svg}path")
    }
    assert paths == {"stroke-0": "bolt/edge 1", "stroke-1": None, "stroke-2": 'a "<b>" & ø'}


@pytest.mark.parametrize("layers", [["a"], ["a", "b", "?"]])
def test_layers_that_are_not_one_a_stroke_or_have_no_name_are_refused(tmp_path, layers):
    with pytest.raises(ValueError, match="layer"):
        save_step(tmp_path / "a.step", three(), layers=layers)
    assert not (tmp_path / "a.step").exists()
