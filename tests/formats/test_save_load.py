"""`save` and `load` pick the format by the suffix, and write whole files or none."""

import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds import formats


@pytest.fixture
def sketch():
    return ds.Sketch.random(3, generator=torch.Generator().manual_seed(0))


def test_unknown_suffixes_name_the_known_ones(tmp_path, sketch):
    with pytest.raises(
        ValueError,
        match=r"cannot save as '.xyz', only as .json, .step, .stp, .dxf, .3dm, .glb, .ply, .obj, .usd, .usda, .usdc, "
        r".usdz, .iges, .igs, .stl, .py, .html, .svg, .pdf, .png",
    ):
        ds.save(tmp_path / "a.xyz", sketch)
    with pytest.raises(ValueError, match=r"cannot load '.pdf', only .json, .step, .stp"):
        ds.load(tmp_path / "a.pdf")
    with pytest.raises(ValueError, match=r"cannot save as ''"):
        ds.save(tmp_path / "json", sketch)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("suffix", "said"),
    [
        (".3mf", ".stl, .ply and .glb files hold the strokes as closed tubes"),
        (".sat", "write .step or .3dm"),
        (".gltf", "write .glb"),
        (".dwg", "write .dxf"),
        (".svgz", "write .svg"),
        (".eps", "write .pdf or .svg"),
        (".ai", "write .pdf or .svg"),
        (".hpgl", "diff3ds render --page A4"),
        (".gcode", "--centerline"),
        (".JPG", "write .png"),
    ],
)
def test_formats_that_are_not_written_name_the_nearest_that_is(tmp_path, sketch, suffix, said):
    with pytest.raises(ValueError, match=rf"cannot save as '{suffix.lower()}', only as \.json.*: .*{said}"):
        ds.save(tmp_path / f"a{suffix}", sketch)
    assert list(tmp_path.iterdir()) == []


def test_formats_that_are_not_read_name_what_to_do(tmp_path):
    for suffix, said in ((".dwg", "save it as .dxf"), (".iges", "save it as .step"), (".stl", "diff3ds mesh")):
        with pytest.raises(ValueError, match=rf"cannot load '{suffix}', only \.json.*: .*{said}"):
            ds.load(tmp_path / f"a{suffix}")


NEED = {".dxf": "ezdxf", ".3dm": "rhino3dm", ".usda": "pxr"}
ARTICLES = {
    ".step": "a STEP",
    ".stl": "an STL",
    ".dxf": "a DXF",
    ".3dm": "a 3DM",
    ".glb": "a GLB",
    ".ply": "a PLY",
    ".obj": "an OBJ",
}


@pytest.mark.parametrize(
    ("suffix", "kind"),
    [
        pytest.param(suffix, kind, marks=[needs(NEED[suffix])] if suffix in NEED else [])
        for suffix, kind in {**ARTICLES, ".usda": "a USD"}.items()
    ],
)
def test_files_of_no_strokes_are_refused_by_one_sentence(tmp_path, suffix, kind):
    for none in (ds.Sketch(torch.zeros(0, 4, 3)), ds.Sketch(torch.zeros(0, 2, 3).double())):
        with pytest.raises(ValueError, match=rf"a\{suffix}: {kind} file needs at least one stroke, got none$"):
            ds.save(tmp_path / f"a{suffix}", none)
    assert list(tmp_path.iterdir()) == []


def test_pictures_need_cameras(tmp_path, sketch):
    for name in ("a.svg", "a.png"):
        with pytest.raises(ValueError, match="needs cameras=Cameras, got NoneType"):
            ds.save(tmp_path / name, sketch)
    assert list(tmp_path.iterdir()) == []


def test_only_sketches_are_saved(tmp_path):
    save = getattr(formats.save, "__wrapped__", formats.save)
    with pytest.raises(TypeError, match="save writes a Sketch, got dict"):
        save(tmp_path / "a.json", {})


OTHERS = [pytest.param("a.dxf", marks=needs("ezdxf")), pytest.param("a.3dm", marks=needs("rhino3dm"))]


@pytest.mark.parametrize("name", ["a.json", "a.step", "a.svg", "a.png", "a.glb", "a.ply", *OTHERS])
def test_values_gone_bad_leave_the_old_file(tmp_path, sketch, name):
    cameras = ds.orbit(0.0, size=16)
    ds.save(tmp_path / name, sketch, cameras)
    before = (tmp_path / name).read_bytes()
    sketch.points[1, 2, 0] = torch.nan
    with pytest.raises(ValueError, match="points of stroke 1 must be finite, got nan"):
        ds.save(tmp_path / name, sketch, cameras)
    assert (tmp_path / name).read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("name", ["a.json", "a.step", "a.svg", "a.png", "a.glb", "a.ply"])
def test_the_same_sketch_gives_the_same_file(tmp_path, sketch, name):
    cameras = ds.orbit(0.0, size=16)
    contents = []
    for folder in ("one", "two"):
        ds.save(tmp_path / folder / name, sketch, cameras)
        contents.append((tmp_path / folder / name).read_bytes())
    assert contents[0] == contents[1]


def test_suffixes_in_capitals(tmp_path, sketch):
    ds.save(str(tmp_path / "A.JSON"), sketch)
    assert torch.equal(ds.load(str(tmp_path / "A.JSON")).points, sketch.points)


def test_the_folder_of_a_run_is_read_by_its_sketch(tmp_path):
    sketch = ds.Sketch(torch.rand(2, 4, 3, generator=torch.Generator().manual_seed(0)))
    with pytest.raises(ValueError, match=r"has no sketch\.json: give the folder of a run"):
        ds.load(tmp_path)
    ds.save(tmp_path / "sketch.json", sketch)
    assert torch.equal(ds.load(tmp_path).points, sketch.points)
