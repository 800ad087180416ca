"""Masks: what they leave out counts nowhere, in losses, edges, hull, backgrounds, scores and preview."""

import json

import numpy as np
import pytest
import torch
from PIL import Image

import diff3ds as ds
from diff3ds.formats import save_png
from diff3ds.pictures.content.line_width import line_width
from diff3ds.pictures.content.visual_hull import visual_hull
from diff3ds.pictures.dataset import load_posed
from diff3ds.tasks.views.beside_targets import UNKNOWN, preview
from diff3ds.tasks.views.color_fit.color_sketch import plan_color, view_scores
from diff3ds.tasks.views.edge_fit.edges_of_pictures import ridges_of
from diff3ds.tasks.views.run_views import run_views
from diff3ds.tasks.views.views_options import ViewsOptions

SIZE = (40, 60)
# What stands in front of the camera: a black block at the lower right, within rows and columns from here on.
BLOCK = (30, 42)


@pytest.fixture
def scene():
    cameras = ds.orbit([0, 90, 180], 20, 3.0, size=SIZE)
    points = torch.tensor([[[-0.6, 0.0, 0.0], [0.0, 0.5, 0.4], [0.6, 0.0, 0.2]]])
    return ds.Sketch(points, width=0.08, color=(0.8, 0.2, 0.1)), cameras


def posed(folder, cameras, images, mask="mask.png"):
    """A transforms.json of pictures behind the block, with a mask that is black there."""
    names = [f"{i}.png" for i in range(len(images))]
    for name, image in zip(names, images, strict=True):
        image = image.clone()
        image[BLOCK[0] :, BLOCK[1] :] = 0
        save_png(folder / name, image)
    ds.save_transforms(folder / "transforms.json", cameras, names)
    if mask:
        white = torch.ones(*SIZE, 1)
        white[BLOCK[0] :, BLOCK[1] :] = 0
        save_png(folder / mask, white)
        content = json.loads((folder / "transforms.json").read_text())
        for frame in content["frames"]:
            frame["mask_path"] = mask
        (folder / "transforms.json").write_text(json.dumps(content))
    return folder / "transforms.json"


def counted():
    """Where the block is not."""
    known = torch.ones(SIZE, dtype=torch.bool)
    known[BLOCK[0] :, BLOCK[1] :] = False
    return known


def test_what_is_left_out_is_not_known_and_the_rest_as_without(scene, tmp_path):
    sketch, cameras = scene
    images = ds.render(sketch, cameras).color
    found = load_posed(posed(tmp_path, cameras, images), "color")
    batch = found.batch([0, 1, 2])
    assert torch.equal(batch.known, counted().expand(3, -1, -1))
    expected = images * counted()[..., None]
    torch.testing.assert_close(batch.pixels[..., :3], expected, rtol=0, atol=0.6 / 255)
    assert found.masked == 3
    # The black block is half of the lower border, and no part of the background.
    plan = plan_color(found, ViewsOptions(steps=4, strokes=4), tmp_path / "checkpoint.safetensors")
    assert plan.background.tolist() == [1, 1, 1]
    assert float(plan.pictures.batch([0, 1, 2]).alpha[:, BLOCK[0] :, BLOCK[1] :].max()) == 0


def test_scores_are_of_what_counts(scene, tmp_path):
    """The sketch itself scores as its pictures' 8 bits allow, block or not."""
    sketch, cameras = scene
    found = load_posed(posed(tmp_path, cameras, ds.render(sketch, cameras).color), "color")
    assert view_scores(sketch, found, torch.ones(3))["psnr"] > 50
    (tmp_path / "bare").mkdir()
    bare = load_posed(posed(tmp_path / "bare", cameras, ds.render(sketch, cameras).color, mask=None), "color")
    assert view_scores(sketch, bare, torch.ones(3))["psnr"] < 15


def test_the_preview_says_what_is_not_known(scene, tmp_path):
    sketch, cameras = scene
    found = load_posed(posed(tmp_path, cameras, ds.render(sketch, cameras).color), "color")
    assert torch.equal(preview(sketch, found)[: SIZE[0], : SIZE[1]][~counted()], torch.tensor(UNKNOWN).expand(180, 3))


@pytest.mark.parametrize("target", ["edges", "color-edges"])
def test_the_border_of_a_mask_is_no_edge(scene, tmp_path, target):
    sketch, cameras = scene
    seen = ds.render(sketch, cameras)
    images = 1 - seen.alpha[..., None] if target == "edges" else seen.color
    found = load_posed(posed(tmp_path, cameras, images), target)
    margins = [(ridges.points - torch.tensor(BLOCK[::-1]).numpy()) for ridges in ridges_of(found, torch.arange(3))]
    # Some six pixels, the reach of the filters.
    assert sum(len(m) for m in margins) > 20
    assert all((np.minimum(m[:, 0], m[:, 1]) < -5).all() for m in margins)
    (tmp_path / "bare").mkdir()
    bare = load_posed(posed(tmp_path / "bare", cameras, images, mask=None), target)
    beside = [(r.points > torch.tensor(BLOCK[::-1]).numpy() - 2).all(1).any() for r in ridges_of(bare, torch.arange(3))]
    assert any(beside)


def test_lines_are_as_wide_as_without_a_mask(scene, tmp_path):
    """A mask that ends on a line adds no variation: 364 pixels of ink and 174 edges of pixels are counted."""
    _, cameras = scene
    images = torch.ones(3, *SIZE, 1)
    images[:, 20:24] = 0
    images[:, :, 40:44] = 0
    found = load_posed(posed(tmp_path, cameras, images), "edges")
    assert line_width(found.store) * SIZE[0] == pytest.approx(8 / torch.pi * 364 / 174, rel=1e-6)


def test_the_hull_takes_what_is_left_out_for_unknown(tmp_path):
    """Half of one picture of twelve is hidden: the hull of a ball is as with all of it, and not carved by the block."""
    cameras = ds.orbit([30.0 * i for i in range(12)], 20, 3.0, size=(48, 48))
    rows, columns = torch.meshgrid(torch.arange(48) - 23.5, torch.arange(48) - 23.5, indexing="ij")
    disc = (rows.hypot(columns) < 12).float()
    images = torch.stack([disc, torch.zeros(48, 48), torch.zeros(48, 48), disc], -1).expand(12, -1, -1, -1)
    names = [f"{i}.png" for i in range(12)]
    for name, image in zip(names, images, strict=True):
        save_png(tmp_path / name, image)
    ds.save_transforms(tmp_path / "transforms.json", cameras, names)
    whole = load_posed(tmp_path / "transforms.json", "color")
    mask = torch.zeros(48, 48, 1)
    mask[:, :24] = 1
    # instant-ngp's masks are white where the picture is left out.
    for i in (0, 3, 6):
        save_png(tmp_path / f"dynamic_mask_{i}.png", mask)
    half = load_posed(tmp_path / "transforms.json", "color")
    assert half.batch([0]).known[0].sum() == 24 * 48
    expected, found = (visual_hull(x.cameras, x.store, 24) for x in (whole, half))
    assert len(found.points) == pytest.approx(len(expected.points), rel=0.05)
    assert found.colors[:, 0].min() > 0.99


@pytest.mark.parametrize("kind", ["255", "1", "palette", "jpeg", "16 bits", "alpha", "labels"])
def test_masks_in_any_file(scene, tmp_path, kind):
    sketch, cameras = scene
    path = posed(tmp_path, cameras, ds.render(sketch, cameras).color)
    white = np.uint8(counted().numpy())
    white[:, :20] *= 5 if kind == "labels" else 1
    if kind == "palette":
        picture = Image.fromarray(white, "P")
        picture.putpalette([0, 0, 0, 128, 0, 0])
    elif kind == "alpha":
        picture = Image.merge("RGBA", [Image.new("L", SIZE[::-1], 255)] * 3 + [Image.fromarray(255 * white)])
    else:
        picture = Image.fromarray(
            np.uint16(white) * 255 if kind == "16 bits" else white * (1 if kind in ("1", "labels") else 255)
        )
    picture.save(tmp_path / "mask.png", "JPEG" if kind == "jpeg" else "PNG")
    known = load_posed(path, "color").batch([0]).known[0]
    # JPEG's ringing ends within its blocks of 8.
    near = torch.zeros(SIZE, dtype=torch.bool)
    near[BLOCK[0] - 8 : BLOCK[0] + 8] = near[:, BLOCK[1] - 8 : BLOCK[1] + 8] = kind == "jpeg"
    assert torch.equal(known | near, counted() | near)


def test_masks_go_through_lens_distortion_and_reduction(scene, tmp_path):
    sketch, cameras = scene
    path = posed(tmp_path, cameras, ds.render(sketch, cameras).color)
    content = json.loads(path.read_text())
    path.write_text(json.dumps({**content, "k1": -0.05}))
    known = load_posed(path, "color", size=30).batch([0]).known[0]
    assert known.shape == (20, 30)
    assert known[2:13, 2:19].all()
    assert not known[17:, 23:].any()


def test_masks_that_leave_nothing_are_named(scene, tmp_path):
    sketch, cameras = scene
    path = posed(tmp_path, cameras, ds.render(sketch, cameras).color)
    save_png(tmp_path / "mask.png", torch.zeros(*SIZE, 1))
    for target in (None, "color", "edges"):
        with pytest.raises(ValueError, match="masks leave out everything: black pixels do not count"):
            load_posed(path, target)
    with pytest.raises(ValueError, match="all 3 are transparent everywhere, by their masks"):
        load_posed(path, "color", masks="object")


def test_the_option_says_which_is_meant(scene, tmp_path):
    sketch, cameras = scene
    path = posed(tmp_path, cameras, ds.render(sketch, cameras).color)
    few = {"target": "color", "steps": 2, "strokes": 4}
    lines = []
    run_views(path, tmp_path / "out", ViewsOptions(**few), say=lines.append)
    assert lines == [
        "masks: what is black in the masks of the pictures counts nowhere; if white is the object, say --masks object"
    ]
    run_views(path, tmp_path / "cut", ViewsOptions(**few, masks="object"), say=lines.append)
    assert len(lines) == 1
    runs = [json.loads((tmp_path / name / "run.json").read_text()) for name in ("out", "cut")]
    # A mask of the object is its alpha, and what lies behind need not be found.
    assert [run["background"] for run in runs] == [[1, 1, 1], None]
    assert [run["options"]["masks"] for run in runs] == ["ignore", "object"]


def test_inverted_masks_of_the_object_are_suspected(scene, tmp_path):
    sketch, cameras = scene
    path = posed(tmp_path, cameras, ds.render(sketch, cameras).color)
    mask = torch.ones(*SIZE, 1)
    mask[10:30, 20:40] = 0
    save_png(tmp_path / "mask.png", mask)
    lines = []
    options = ViewsOptions(target="color", steps=2, strokes=4, masks="object")
    run_views(path, tmp_path / "out", options, say=lines.append)
    assert len(lines) == 1
    assert "transparent inside: are alpha or masks inverted?" in lines[0]


def test_opaque_pictures_among_cut_out_ones_are_counted(scene, tmp_path):
    sketch, cameras = scene
    path = posed(tmp_path, cameras, ds.render(sketch, cameras).color, mask=None)
    rgba = ds.render(sketch, cameras)
    for i in (0, 1):
        straight = sketch.color[0].expand(*SIZE, 3)
        save_png(tmp_path / f"{i}.png", torch.cat([straight, rgba.alpha[i, ..., None]], -1))
    save_png(tmp_path / "2.png", rgba.color[2])
    lines = []
    run_views(path, tmp_path / "out", ViewsOptions(target="color", steps=2, strokes=4), say=lines.append)
    expected = "1 of 3 pictures have no transparent areas: the colour along their borders is taken for their background"
    assert lines == [expected]


def test_a_dynamic_mask_of_another_size_is_named(scene, tmp_path):
    sketch, cameras = scene
    path = posed(tmp_path, cameras, ds.render(sketch, cameras).color, mask=None)
    save_png(tmp_path / "dynamic_mask_1.png", torch.zeros(20, 30, 1))
    with pytest.raises(ValueError, match=r"dynamic_mask_1\.png: 20 x 30 .*, but its picture has 40 x 60"):
        load_posed(path, "color")
