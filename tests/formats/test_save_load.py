"""`save` and `load` pick the format by the suffix, and write whole files or none."""

import pytest
import torch
from needs import needs

import diff3ds as ds


@pytest.fixture
def sketch():
    return ds.Sketch.random(3, generator=torch.Generator().manual_seed(0))


def test_unknown_suffixes_name_the_known_ones(tmp_path, sketch):
    with pytest.raises(
        ValueError,
        match=r"cannot save as '.xyz', only as .json, .step, .stp, .dxf, .3dm, .glb, .ply, .obj, .usd, .usda, .usdc, "
        r".py, .html, .svg, .pdf, .png",
    ):
        ds.save(tmp_path / "a.xyz", sketch)
    with pytest.raises(ValueError, match=r"cannot load '.svg', only .json, .step, .stp"):
        ds.load(tmp_path / "a.svg")
    with pytest.raises(ValueError, match=r"cannot save as ''"):
        ds.save(tmp_path / "json", sketch)
    assert list(tmp_path.iterdir()) == []


def test_pictures_need_cameras(tmp_path, sketch):
    for name in ("a.svg", "a.png"):
        with pytest.raises(ValueError, match="needs cameras=Cameras, got NoneType"):
            ds.save(tmp_path / name, sketch)
    assert list(tmp_path.iterdir()) == []


def test_only_sketches_are_saved(tmp_path):
    save = getattr(ds.save, "__wrapped__", ds.save)
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
