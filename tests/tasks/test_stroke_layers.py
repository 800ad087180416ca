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


@pytest.mark.parametrize("suffix", ["3dm", "dxf", "step"])
def test_files_for_cad_have_them_by_thing_and_kind(scene, suffix):
    pytest.importorskip("rhino3dm", reason="takes the extra cad")
    pytest.importorskip("ezdxf", reason="takes the extra cad")
    path = scene / f"a.{suffix}"
    main(["export", str(scene / "a.json"), str(path), "--layers", "thing", "kind", "--quiet"])
    flat = ["lamp - crease", "lamp - border", "engine - rod - crease", "stroke"]
    if suffix == "3dm":
        import rhino3dm

        model = rhino3dm.File3dm.Read(str(path))
        found = [model.Layers[o.Attributes.LayerIndex].FullPath.replace("::", " - ") for o in model.Objects]
        assert [layer.Name for layer in model.Layers].count("lamp") == 1
        assert ds.load(path).color.tolist() == ds.load(scene / "a.json").color.tolist()
    elif suffix == "dxf":
        import ezdxf

        found = [line.dxf.layer for line in ezdxf.readfile(path).modelspace()]
    else:
        text = path.read_text()
        found = [name for name in flat if f"PRESENTATION_LAYER_ASSIGNMENT('{name}'" in text]
    assert found == flat


def test_files_without_layers_say_so(scene, capsys):
    with pytest.raises(SystemExit):
        main(["export", str(scene / "a.json"), str(scene / "a.ply"), "--layers", "kind"])
    assert "--layers is for" in capsys.readouterr().err
    assert not (scene / "a.ply").exists()


def test_drawings_of_meshes_are_for_pens_and_lead_back_to_the_sketch(tmp_path, capsys):
    """The edges of a box, of which a pen draws the nine that are seen."""
    trimesh = pytest.importorskip("trimesh", reason="takes the extra dev")
    trimesh.creation.box((1.0, 2.0, 3.0)).export(tmp_path / "box.obj")
    run, options = tmp_path / "run", ["--turntable", "0", "--azimuth", "30", "--size", "64"]
    main(["mesh", str(tmp_path / "box.obj"), "-o", str(run), *options, "--centerline", "--layers", "kind"])
    assert "drawing-1.svg: the pen is lifted" in capsys.readouterr().err
    found = layers_in(run / "drawing-1.svg")
    # A pen for each.
    assert {group[0] for group in found.values()} == {"1 crease"}
    numbers = {int(number) for ident in found for number in ident.split("-")[1:]}
    sketch = ds.load(run)
    # Those that are not seen end at the corner that is farthest from the camera.
    away = (sketch.points[:, [0, -1]] - ds.orbit(30.0, 20.0).centers[0]).norm(dim=-1).amax(1)
    hidden = {row for row in range(12) if float(away[row]) > float(away.max()) - 1e-6}
    assert numbers == set(range(12)) - hidden
    assert len(numbers) == 9


def test_nodes_of_glb_files_lie_in_those_of_their_layers(scene):
    trimesh = pytest.importorskip("trimesh")
    main(["export", str(scene / "a.json"), str(scene / "a.glb"), "--layers", "thing", "kind", "--quiet"])
    graph = trimesh.load(scene / "a.glb").graph
    above = {(edge[1], edge[0]) for edge in graph.to_edgelist()}
    assert {("stroke 0", "crease"), ("crease", "lamp"), ("lamp", "sketch"), ("stroke 1", "border")} <= above
    assert {("rod", "engine"), ("stroke 3", "stroke"), ("stroke", "sketch")} <= above


@pytest.mark.parametrize("suffix", ["usda", "usdz"])
def test_prims_of_usd_files_lie_in_those_of_their_layers(scene, suffix):
    """Their names are shown whole; as names of prims they are identifiers, another one for each."""
    usd = pytest.importorskip("pxr.Usd", reason="takes the extra usd")
    path = scene / f"a.{suffix}"
    main(["export", str(scene / "a.json"), str(path), "--layers", "color", "thing", "--quiet"])
    stage = usd.Stage.Open(str(path))
    shown = {str(prim.GetPath()): prim.GetDisplayName() for prim in stage.Traverse()}
    top = "/sketch/strokes/_000000"
    assert (shown[top], shown[f"{top}/lamp"]) == ("#000000", "lamp")
    assert {f"{top}/lamp/stroke_0", "/sketch/strokes/_ff0000/lamp/stroke_1", f"{top}/engine/rod/stroke_2"} <= {*shown}
    assert len(ds.load(path)) == 4
    # Viewers that show polylines alone hide those of a layer with it.
    assert f"{top}/engine/rod/polylines" in shown


def test_names_of_layers_that_are_alike_as_identifiers_stay_apart(tmp_path):
    usd = pytest.importorskip("pxr.Usd", reason="takes the extra usd")
    from diff3ds.formats import save_usd

    layers = ["leg 1", "leg_1", ("stroke_3",), (), "polylines", ("leg 1", "polylines")]
    save_usd(tmp_path / "a.usda", ds.Sketch(torch.rand(6, 2, 3)), layers=layers)
    stage = usd.Stage.Open(str(tmp_path / "a.usda"))
    shown = [prim.GetDisplayName() for prim in stage.Traverse()]
    assert sorted(filter(None, shown)) == ["leg 1", "leg_1", "polylines", "polylines", "stroke_3"]
    # Each of the six places has what viewers show in place of its strokes, which has that name too.
    assert [prim.GetTypeName() for prim in stage.Traverse()].count("BasisCurves") == 6
    assert len(ds.load(tmp_path / "a.usda")) == 6
    with pytest.raises(ValueError, match="layers must name one for each of the 5 strokes, got 2"):
        save_usd(tmp_path / "b.usda", ds.Sketch(torch.rand(5, 2, 3)), layers=["a", "b"])
