"""`--layers`: what lies in which layer of SVG and PDF files, by thing, kind, visibility and colour."""

import xml.etree.ElementTree as ElementTree
import zlib

import pytest
import torch

import diff3ds as ds
from diff3ds.cli import main
from diff3ds.formats.mesh import save_surface
from diff3ds.tasks.render.stroke_layers import layers_by, thing_of

INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"


@pytest.fixture
def scene(tmp_path):
    """Seen from above: a plate, and lines below and above it."""
    square = torch.tensor([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    save_surface(tmp_path / "plate.glb", square.numpy(), torch.tensor([[0, 1, 2], [0, 2, 3]]).numpy())
    places = [(-0.6, -0.5), (-0.2, 0.5), (0.2, 0.5), (0.6, 0.5)]
    points = torch.tensor([[[-0.5, y, z], [0.5, y, z]] for y, z in places])
    names = ["lamp/stroke 0", "lamp/stroke 1", "engine/rod/edge 7", ""]
    kinds = ["crease", "border", "crease", ""]
    color = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 0, 0]])
    ds.save(tmp_path / "a.json", ds.Sketch(points, color=color, names=names, kinds=kinds))
    return tmp_path


def drawn(folder, out, *more):
    options = ["--elevation", "90", "--surface", str(folder / "plate.glb"), "--hidden", "faint", "--no-contours"]
    main(["render", str(folder / "a.json"), "-o", str(folder / out), *options, *more, "--quiet"])
    return folder / out


def layers_in(path):
    """By id of what is drawn the names of the layers around it."""
    found = {}

    def walk(element, around):
        if element.get(INKSCAPE + "groupmode") == "layer":
            around = (*around, element.get(INKSCAPE + "label"))
        elif element.get("id"):
            found[element.get("id")] = around
        for child in element:
            walk(child, around)

    walk(ElementTree.parse(path).getroot(), ())
    return found


EXPECTED = {
    "stroke-0": ("lamp", "crease", "hidden", "#000000"),
    "stroke-1": ("lamp", "border", "visible", "#ff0000"),
    "stroke-2": ("engine", "rod", "crease", "visible", "#000000"),
    "stroke-3": ("stroke", "visible", "#000000"),
}


def test_layers_lie_in_each_other_by_thing_kind_visibility_and_colour(scene):
    path = drawn(scene, "a.svg", "--layers", "thing", "kind", "visibility", "color")
    assert layers_in(path) == EXPECTED
    # Every id is there once, and each layer is one group.
    ids = [element.get("id") for element in ElementTree.parse(path).iter() if element.get("id")]
    assert len(ids) == len(set(ids)) == 4 + 7 + 5 + 3
    assert layers_in(drawn(scene, "b.svg", "--layers", "visibility"))["stroke-0"] == ("hidden",)
    assert layers_in(drawn(scene, "c.svg", "--layers", "thing"))["stroke-3"] == ()


def test_pdf_files_have_them_too(scene):
    content = drawn(scene, "a.pdf", "--layers", "thing", "kind").read_bytes()
    names = [part.split(b")")[0].decode() for part in content.split(b"/OCG /Name (")[1:]]
    assert sorted(names) == sorted(["lamp", "crease", "border", "engine", "rod", "crease", "stroke"])
    order = content.split(b"/Order ")[1].split(b" /ON")[0].decode()
    # Layers in brackets lie in those before them.
    assert order.count("[") == order.count("]") == 4
    stream = zlib.decompress(content.split(b"stream\n")[1].split(b"\nendstream")[0])
    assert stream.count(b"BDC") == stream.count(b"EMC") == 7


def test_and_drawings_in_a_style(scene):
    pytest.importorskip("pathops", reason="takes the extra styles")
    path = drawn(scene, "a.svg", "--layers", "thing", "kind", "visibility", "color", "--style", "ink")
    assert layers_in(path) == EXPECTED


def test_names_say_things_and_their_parts():
    assert thing_of("chair 2/stroke 0") == ("chair 2",)
    assert thing_of("engine/rod/face 3, engine/rod/face 4") == ("engine", "rod")
    assert thing_of("edge 3, radius 2/3") == thing_of("") == ()
    sketch = ds.Sketch(torch.rand(2, 2, 3))
    assert layers_by(sketch, ()) is None
    assert layers_by(sketch, ("thing", "kind")) == [("stroke",)] * 2
