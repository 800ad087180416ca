"""Edge maps that users bring: matched with their photographs by name and shape, seen by the photographs' cameras."""

import json

import pytest
import torch

import diff3ds as ds
from diff3ds.formats import save_png
from diff3ds.pictures.dataset import load_posed
from diff3ds.tasks.views.run_views import run_views
from diff3ds.tasks.views.views_options import ViewsOptions
from diff3ds.transforms import read_views

SIZE = (40, 60)
NAMES = ["a.png", "b.png", "c.png"]


def named(path, changes):
    """The transforms.json with these keys in each of its frames."""
    content = json.loads(path.read_text())
    for frame in content["frames"]:
        frame |= changes
    path.write_text(json.dumps(content))


@pytest.fixture
def scene(tmp_path, generator):
    """Three photographs, in a folder of their own, and the lines that they show."""
    cameras = ds.orbit([0.0, 90.0, 180.0], 20.0, 3.0, size=SIZE)
    points = torch.tensor([[[-0.6, 0.0, 0.0], [0.0, 0.5, 0.4], [0.6, 0.0, 0.2]]])
    sketch = ds.Sketch(points, width=0.08)
    (tmp_path / "photos" / "images").mkdir(parents=True)
    for name in NAMES:
        save_png(tmp_path / "photos" / "images" / name, torch.rand(*SIZE, 3, generator=generator))
    path = tmp_path / "photos" / "transforms.json"
    ds.save_transforms(path, cameras, [f"images/{name}" for name in NAMES])
    return path, cameras, sketch


def write_maps(folder, ink, names=NAMES):
    folder.mkdir(parents=True, exist_ok=True)
    for name, picture in zip(names, ink, strict=True):
        save_png(folder / name, picture[..., None])
    return folder


@pytest.mark.parametrize("background", [0.0, 1.0])
@pytest.mark.parametrize("names", [NAMES, ["a.tif", "b.tiff", "c.bmp"], ["a.png.png", "b.png.png", "c.png.png"]])
def test_edge_maps_take_the_place_of_photographs(scene, tmp_path, background, names):
    path, cameras, sketch = scene
    ink = ds.render(sketch, cameras).alpha
    maps = write_maps(tmp_path / "maps", (background - ink).abs(), names)
    found = load_posed(path, edges=maps)
    assert found.target == "edges"
    torch.testing.assert_close(found.batch([0, 1, 2]).alpha, ink, rtol=0, atol=0.6 / 255)
    torch.testing.assert_close(found.cameras.intrinsics, cameras.intrinsics.double())


def test_smaller_maps_with_lens_and_masks_of_their_photographs(scene, tmp_path):
    """Maps of half the size see what a camera of half the size sees; masks are as large as the photographs."""
    path, cameras, sketch = scene
    half = cameras.resize((20, 30))
    ink = ds.render(sketch, half).alpha
    maps = write_maps(tmp_path / "maps", ink)
    mask = torch.zeros(*SIZE, 1)
    mask[:, 30:] = 1
    save_png(tmp_path / "photos" / "mask.png", mask)
    # instant-ngp's, white where the photograph does not count, lies beside the photograph.
    moved = torch.zeros(*SIZE, 1)
    moved[20:] = 1
    save_png(tmp_path / "photos" / "images" / "dynamic_mask_b.png", moved)
    named(path, {"mask_path": "mask.png"})
    found = load_posed(path, edges=maps)
    torch.testing.assert_close(found.cameras.intrinsics, half.intrinsics.double())
    seen = found.batch([0, 1, 2])
    right, upper = torch.arange(30) >= 15, (torch.arange(20) < 10)[:, None]
    assert torch.equal(seen.known[0], right.expand(20, 30))
    assert torch.equal(seen.known[1], right & upper)
    torch.testing.assert_close(seen.alpha[0], ink[0] * right, rtol=0, atol=0.6 / 255)
    # Lines of maps are bent as those of their photographs are.
    ds.save_transforms(maps / "transforms.json", half, NAMES)
    bent, own = {"k1": 2.0, "mask_path": None}, maps / "transforms.json"
    (path.parent / "images" / "dynamic_mask_b.png").unlink()
    named(path, bent)
    named(own, bent)
    straight = load_posed(path, edges=maps)
    assert torch.equal(straight.store.pixels, load_posed(own, "edges").store.pixels)
    assert (straight.batch([0, 1, 2]).alpha - ink).abs().max() > 0.1


def test_maps_of_photographs_in_several_folders(scene, tmp_path):
    """Cameras of a rig count alike; a flat folder of maps says of which photograph a map is only where names differ."""
    path, cameras, sketch = scene
    ink = ds.render(sketch, cameras).alpha
    content = json.loads(path.read_text())
    for name, frame in zip(NAMES, content["frames"], strict=True):
        (path.parent / name[0]).mkdir()
        (path.parent / "images" / name).rename(path.parent / name[0] / "1.png")
        frame["file_path"] = f"{name[0]}/1.png"
    path.write_text(json.dumps(content))
    flat = write_maps(tmp_path / "flat", ink[:1], ["1.png"])
    with pytest.raises(ValueError, match=r"1\.png: of several photographs of this name\? .*flat.a.1\.png"):
        load_posed(path, edges=flat)
    for name, picture in zip("abc", ink, strict=True):
        write_maps(tmp_path / "maps" / name, picture[None], ["1.png"])
    found = load_posed(path, edges=tmp_path / "maps")
    torch.testing.assert_close(found.batch([0, 1, 2]).alpha, ink, rtol=0, atol=0.6 / 255)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["a.png", "b.png"], r"1 of 3 photographs have no edge map there: c\.png\. There are 2 pictures: a\.png, b"),
        (["1.png", "2.png", "3.png"], r"3 of 3 photographs have no edge map there: a\.png, .*: 1\.png, 2\.png, 3\.png"),
        ([*NAMES, "d.png"], r"1 edge maps are of no photograph: d\.png\. An edge map has the name"),
        ([*NAMES, "a.bmp"], r"a\.png or a\.bmp for a\.png\? Leave one there"),
        ([], "3 of 3 photographs have no edge map there: .* It has no pictures"),
    ],
)  # fmt: skip
def test_maps_and_photographs_that_do_not_match_are_refused(scene, tmp_path, names, message):
    maps = write_maps(tmp_path / "maps", torch.zeros(len(names), *SIZE), names)
    with pytest.raises((ValueError, FileNotFoundError), match=message):
        load_posed(scene[0], edges=maps)


def test_folders_and_pictures_that_are_no_edge_maps_are_refused(scene, tmp_path, generator):
    path, cameras, sketch = scene
    ink = ds.render(sketch, cameras).alpha
    with pytest.raises(FileNotFoundError, match="no such folder of edge maps"):
        load_posed(path, edges=tmp_path / "none")
    write_maps(tmp_path / "maps" / "fused", ink)
    with pytest.raises(FileNotFoundError, match="There are pictures in its folders fused: name one of these"):
        load_posed(path, edges=tmp_path / "maps")
    # The photographs themselves are no maps, nor are others of their names.
    with pytest.raises(FileNotFoundError, match="3 of 3 photographs have no edge map"):
        load_posed(path, edges=path.parent / "images")
    for name in NAMES:
        save_png(tmp_path / name, torch.rand(*SIZE, 3, generator=generator))
    with pytest.raises(ValueError, match="the pictures are coloured, and edge maps are gray"):
        load_posed(path, edges=tmp_path)
    wide = write_maps(tmp_path / "wide", torch.zeros(3, 40, 64))
    with pytest.raises(ValueError, match=r"a\.png: an edge map of 64 x 40 .* its photograph a\.png, which has 60 x 40"):
        load_posed(path, edges=wide)
    mixed = write_maps(tmp_path / "mixed", torch.cat([ink[:2], 1 - ink[2:]]))
    with pytest.raises(ValueError, match=r"1 of 3 drawings are dark on light, the others light on dark: c\.png\. Inv"):
        load_posed(path, edges=mixed)


def test_photographs_without_a_camera_may_have_maps(scene, tmp_path):
    path, cameras, sketch = scene
    maps = write_maps(tmp_path / "maps", ds.render(sketch, cameras).alpha)
    content = json.loads(path.read_text())
    content["frames"] = content["frames"][:2]
    path.write_text(json.dumps(content))
    assert load_posed(path, edges=maps).names == ("a.png", "b.png")


def test_a_run_on_edge_maps_is_that_of_the_maps_as_pictures(scene, tmp_path):
    """The strokes of a sketch follow them; refined cameras and the like are those of the photographs."""
    path, cameras, sketch = scene
    maps = write_maps(tmp_path / "maps", ds.render(sketch, cameras).alpha)
    ds.save_transforms(maps / "transforms.json", cameras, NAMES)
    start = tmp_path / "start.json"
    ds.save(start, sketch.transform(torch.diag(torch.tensor([1.1, 1.1, 1.1, 1.0]))))
    found = run_views(path.parent, tmp_path / "out", ViewsOptions(edges=maps, start=start, steps=3))
    same = run_views(maps, tmp_path / "same", ViewsOptions(target="edges", start=start, steps=3))
    assert torch.equal(found.points, same.points)
    assert json.loads((tmp_path / "out" / "run.json").read_text())["options"]["edges"] == str(maps)
    assert [view.picture.name for view in read_views(path)] == NAMES
    with pytest.raises(ValueError, match="leave --target color out"):
        ViewsOptions(edges=maps, target="color")
    with pytest.raises(ValueError, match=r"the embedded scene is line drawings .* leave --edges"):
        run_views(None, tmp_path / "demo", ViewsOptions(edges=maps))
    # Said before cameras are looked for, which takes minutes.
    (maps / "c.png").unlink()
    path.unlink()
    with pytest.raises(FileNotFoundError, match=r"no edge map there: c\.png"):
        run_views(path.parent, tmp_path / "other", ViewsOptions(edges=maps))
    assert not (tmp_path / "other").exists()
