"""Pictures as backgrounds: which lies behind which view, and fits over them."""

import json
import math
from collections import deque
from dataclasses import replace
from pathlib import Path

import pytest
import torch

import diff3ds as ds
from diff3ds.cli import FAULT, main
from diff3ds.formats import save_png
from diff3ds.optimize.fit import fit
from diff3ds.photogrammetry.lens_change import LensChange
from diff3ds.pictures.content.background import with_alpha
from diff3ds.pictures.content.clean_plates import CleanPlates, load_clean_plates
from diff3ds.pictures.dataset import PosedPictures, load_posed
from diff3ds.pictures.store import Store, as_bytes, store_of
from diff3ds.tasks.views.color_fit.color_sketch import color_scores, plan_color
from diff3ds.tasks.views.views_options import ViewsOptions

SIZE = 48
CAMERAS = ds.orbit([30.0 * i for i in range(12)], [(-20.0, 10.0, 45.0)[i % 3] for i in range(12)], 3.0, size=SIZE)
# The noise that a background may have; see `posed.SAME`.
SAME = 0.05


def truth():
    """Two crossing bars, one of them half transparent."""
    points = torch.tensor([[[-0.8, 0, -0.3], [0.8, 0, -0.3]], [[0.0, -0.8, 0.2], [0.0, 0.8, 0.4]]])
    color = torch.tensor([[0.9, 0.2, 0.1], [0.1, 0.3, 0.8]])
    return ds.Sketch(points, width=0.3, color=color, opacity=torch.tensor([1.0, 0.5]), width_space="world")


def opaque(color):
    return torch.cat([color, torch.ones_like(color[..., :1])], -1)


@pytest.fixture
def clean_plates(generator):
    """Gray and green patches of four pixels, of eight bits, others in every view."""
    patches = torch.rand(12, 12, 12, 3, generator=generator) * torch.tensor([0.2, 0.5, 0.2]) + torch.tensor(
        [0.2, 0.4, 0.2]
    )
    return as_bytes(patches.repeat_interleave(4, 1).repeat_interleave(4, 2)).float() / 255


def posed(pixels):
    return PosedPictures(CAMERAS, "color", store_of(pixels), tuple(f"{i}.png" for i in range(12)))


def plan_over(clean_plates, pixels, **options):
    return plan_color(
        posed(pixels), ViewsOptions(**options), None, CleanPlates(Path("plates"), store_of(opaque(clean_plates)))
    )


def loss_of(sketch, plan, step):
    """What a fit would see of a sketch in the world at this step."""
    cameras = plan.pyramid.cameras(step, torch.Generator())
    rows = plan.pyramid.views(step)
    world = ds.Cameras(CAMERAS.world_to_camera[rows], cameras.intrinsics, cameras.size)
    drawn = ds.render(sketch, world, background=0.0, antialiasing=plan.pyramid.antialiasing(step))
    return float(plan.objective(drawn, cameras, step))


@pytest.mark.parametrize("alpha", [True, False])
def test_the_truth_over_its_plates_has_no_loss(clean_plates, alpha):
    """Without alpha, what differs from the background by its noise at most is taken for background."""
    drawn = ds.render(truth(), CAMERAS, background=0.0)
    over = ds.render(truth(), CAMERAS, background=clean_plates).color
    pixels = torch.cat([drawn.color, drawn.alpha[..., None]], -1) if alpha else opaque(over)
    plan = plan_over(clean_plates, pixels, strokes=8, steps=8, batch=12)
    faint = (over - clean_plates).abs().amax(-1) <= SAME
    # Three numbers of eight bits: the target's colour and alpha, and the background.
    bound = (1.5 / 255) ** 2 + (0 if alpha else SAME**2 * float((faint & (drawn.alpha > 0)).float().mean()))
    assert loss_of(truth(), plan, 7) < bound < 2e-4
    # Over the background of another view the same is far off wherever the picture shows the background.
    other = plan_over(clean_plates.roll(1, 0), opaque(over), strokes=8, steps=8, batch=12)
    assert loss_of(truth(), other, 7) > 100 * loss_of(truth(), plan, 7)
    assert loss_of(truth()[:1], plan, 7) > 100 * loss_of(truth(), plan, 7)


def test_pictures_are_cut_out_of_their_plates(clean_plates):
    drawn = ds.render(truth(), CAMERAS, background=clean_plates)
    cut, background = with_alpha(
        posed(opaque(drawn.color)), CleanPlates(Path("plates"), store_of(opaque(clean_plates)))
    )
    alpha = cut.batch(range(12)).alpha
    assert (alpha[drawn.alpha == 0] == 0).all()
    # The bar that is half transparent is as green as some patches behind it.
    assert alpha[drawn.alpha > 0.3].mean() > 0.97
    assert torch.equal(background.store.batch([3]).pixels[0, ..., :3], clean_plates[3])


@pytest.mark.slow
def test_strokes_are_found_before_textured_plates(clean_plates):
    drawn = ds.render(truth(), CAMERAS, background=clean_plates)
    plan = plan_over(clean_plates, opaque(drawn.color), strokes=40, steps=250)
    (last,) = deque(fit(plan.start, plan.objective, plan.pyramid.cameras, plan.config), maxlen=1)
    found = plan.frame.to_world(last.sketch)
    scores = color_scores(found, plan, None)
    blank = color_scores(replace(found, opacity=torch.zeros(len(found))), plan, None)
    assert blank["psnr"] < 22
    assert scores["psnr"] > 34
    alpha = ds.render(found, CAMERAS).alpha
    assert alpha[drawn.alpha == 0].mean() < 0.02
    # Plates shine through the bar that is half transparent.
    shares = [alpha[(drawn.alpha - share).abs() < 0.01].median() for share in (0.5, 1.0)]
    assert 0.4 < shares[0] < 0.75
    assert shares[1] > 0.95


def test_plates_of_many_sizes_have_the_levels_of_their_pictures():
    """Plates of one colour make the loss of that colour at every level, bit for bit."""
    color = torch.tensor([51.0, 153.0, 102.0]) / 255
    drawn = ds.render(truth(), CAMERAS, background=color).color
    known = torch.ones(12, SIZE, SIZE, dtype=torch.bool)
    known[::2, :, 36:], known[1::3, 30:] = False, False
    cut = [Store(as_bytes(opaque(x) * known[..., None]), known) for x in (drawn, color.expand_as(drawn))]
    pictures = replace(posed(opaque(drawn)), store=cut[0])
    options = ViewsOptions(strokes=8, steps=8, background="0.2,0.6,0.4")
    plans = [
        plan_color(pictures, options, None, clean_plates)
        for clean_plates in (None, CleanPlates(Path("plates"), cut[1]))
    ]
    losses = [[loss_of(truth()[:1], plan, step) for step in range(8)] for plan in plans]
    assert losses[0] == losses[1]
    assert min(losses[0]) > 1e-4


def write(folder, images, **lens):
    """Views of one to three sizes on disk."""
    folder.mkdir(exist_ok=True)
    ds.save_transforms(folder / "transforms.json", CAMERAS[: len(images)], [f"{i}.png" for i in range(len(images))])
    content = json.loads((folder / "transforms.json").read_text())
    for frame, image in zip(content["frames"], images, strict=True):
        save_png(folder / frame["file_path"], image)
        frame.update(w=image.shape[1], h=image.shape[0], cx=image.shape[1] / 2, cy=image.shape[0] / 2)
    (folder / "transforms.json").write_text(json.dumps({**content, **lens}))
    return folder / "transforms.json"


@pytest.mark.parametrize("lens", [{}, {"k1": 0.2, "k2": -0.05, "p1": 0.01}])
def test_a_plate_of_each_view_is_read_as_its_picture_is(tmp_path, generator, lens):
    """Pictures that are their own backgrounds, of three sizes, reduced, with and without lens distortion."""
    images = [torch.rand(*size, 3, generator=generator) for size in ((40, 60), (60, 40), (20, 30), (40, 60))]
    path = write(tmp_path / "data", images, **lens)
    found, pictures = load_clean_plates(path, tmp_path / "data", 30).store, load_posed(path, "color", 30).store
    assert torch.equal(found.pixels, pictures.pixels)
    assert torch.equal(found.known, pictures.known)
    assert found.pixels.shape == (4, 30, 30, 4)
    assert not found.known.all()


def test_plates_are_read_again_with_the_lens_of_their_pictures(tmp_path, generator):
    images = [torch.rand(40, 60, 3, generator=generator) for _ in range(4)]
    path, change = write(tmp_path / "data", images, k1=0.1), LensChange(1.05, -0.3)
    plates, pictures = load_clean_plates(path, tmp_path / "data", 30), load_posed(path, "color", 30).again(change)
    found = plates.refined(change, [2, 0])
    assert torch.equal(found.store.pixels, pictures.store.pixels[[2, 0]])
    assert not torch.equal(found.store.pixels, plates.chosen([2, 0]).store.pixels)
    assert torch.equal(plates.refined(LensChange(1.05), [2, 0]).store.pixels, plates.chosen([2, 0]).store.pixels)


def test_plates_in_folders_of_the_same_names(tmp_path):
    """Two cameras count their pictures alike."""
    values = {"left": 0.2, "right": 0.8}
    for name, value in values.items():
        for folder in (tmp_path / name, tmp_path / "plates" / name):
            folder.mkdir(parents=True)
            save_png(folder / "0.png", torch.full((8, 8, 3), value))
    ds.save_transforms(tmp_path / "transforms.json", CAMERAS[:2].resize(8), ["left/0.png", "right/0.png"])
    store = load_clean_plates(tmp_path / "transforms.json", tmp_path / "plates").store
    assert store.pixels[:, 0, 0, 0].tolist() == [51, 204]
    # One picture for both may be a mistake.
    save_png(tmp_path / "plates" / "0.png", torch.ones(8, 8, 3))
    with pytest.raises(ValueError, match=r"0\.png: background of both .*left.* and .*plates.right.0\.png"):
        load_clean_plates(tmp_path / "transforms.json", tmp_path / "plates")


def test_one_picture_is_scaled_to_every_view(tmp_path):
    """Half white and half black, side by side, in a picture of another size and shape."""
    path = write(tmp_path / "data", [torch.full(size, 0.5) for size in ((40, 60, 3), (20, 10, 3))])
    picture = torch.zeros(30, 20, 3)
    picture[:, :10] = 1
    save_png(tmp_path / "a.png", picture)
    store = load_clean_plates(path, tmp_path / "a.png").store
    for i, (height, width) in enumerate(((40, 60), (20, 10))):
        expected = torch.zeros(40, 60)
        expected[:height, : width // 2] = 255
        assert torch.equal(store.pixels[i, ..., 0].float(), expected)
        assert torch.equal(store.known[i], store.pixels[i, ..., 3] == 255)
        assert int(store.known[i].sum()) == height * width


def test_one_picture_goes_through_the_lens_of_the_views(tmp_path):
    """A static camera: the picture, three times as large, is what each view has behind it."""
    rows, columns = torch.meshgrid(torch.arange(180) / 180, torch.arange(270) / 270, indexing="ij")
    large = torch.stack([rows, columns, 0.5 + 0.5 * torch.sin(9 * rows * columns)], -1)
    small = large.reshape(60, 3, 90, 3, 3).mean((1, 3))
    path = write(tmp_path / "data", [small, small], k1=-0.1, p1=0.02)
    save_png(tmp_path / "large.png", large)
    found, own = load_clean_plates(path, tmp_path / "large.png").store, load_clean_plates(path, tmp_path / "data").store
    both = found.known & own.known
    # The border of what is known may lie a pixel apart.
    assert float((found.known != own.known).float().mean()) < 0.02
    difference = (found.pixels.float() - own.pixels.float()).abs()[both]
    # The curvature of the pictures between pixels of one grid and of the other, and eight bits.
    assert difference.max() <= 2


@pytest.fixture
def scene(tmp_path):
    """Pictures on disk without alpha, over one colour of eight bits, and two held-out ones."""
    color = torch.tensor([51.0, 153.0, 102.0]) / 255
    for name, cameras in (("train", CAMERAS), ("test", CAMERAS[[1, 4]])):
        names = [f"{name}-{i}.png" for i in range(len(cameras))]
        for file, image in zip(names, ds.render(truth(), cameras, background=color).color, strict=True):
            save_png(tmp_path / file, image)
        ds.save_transforms(tmp_path / f"transforms_{name}.json", cameras, names)
    (tmp_path / "plates").mkdir()
    for file in (tmp_path / "one.png", *(tmp_path / "plates" / f"train-{i}.png" for i in range(12))):
        save_png(file, color.expand(SIZE, SIZE, 3))
    return tmp_path


def sketch_over(scene, background, *more):
    """The results of a short run."""
    options = ["--strokes", "12", "--steps", "24", "--background", background, "--quiet", *more]
    out = scene / "out" / background.replace("/", "-").replace(str(scene).replace("/", "-"), "")
    main(["views", str(scene), "-o", str(out), *options])
    return (out / "sketch.json").read_bytes(), json.loads((out / "run.json").read_text())


@pytest.mark.slow
def test_a_picture_of_one_colour_is_that_colour(scene):
    """Bit for bit; run.json says what was used."""
    sketch, run = sketch_over(scene, "0.2,0.6,0.4")
    assert run["background"] == torch.tensor([0.2, 0.6, 0.4]).tolist()
    for name in ("one.png", "plates"):
        same, about = sketch_over(scene, str(scene / name))
        assert same == sketch
        assert about["options"]["background"] == str(scene / name)
        assert about["background"].startswith("pictures with SHA-256 ")
        assert about["loss"] == run["loss"]
        # Of a folder, nobody knows what is behind the held-out pictures.
        shared = {key: value for key, value in run["scores"].items() if name != "plates" or "_test" not in key}
        assert about["scores"] == pytest.approx(shared, rel=1e-5)
    assert math.isfinite(run["scores"]["psnr_test"])


@pytest.mark.slow
def test_resume_refuses_another_background(scene, capsys):
    sketch, _ = sketch_over(scene, str(scene / "one.png"))
    assert sketch_over(scene, str(scene / "one.png"), "--resume")[0] == sketch
    save_png(scene / "one.png", torch.full((SIZE, SIZE, 3), 0.9))
    with pytest.raises(SystemExit) as stopped:
        sketch_over(scene, str(scene / "one.png"), "--resume")
    assert stopped.value.code == FAULT
    said = capsys.readouterr().err
    assert "the run to resume had --background=pictures with SHA-256 " in said


def lose(folder):
    (folder / "plates" / "train-5.png").unlink()
    return folder / "plates", "1 of 12 views have no background in this folder: train-5.png. Each has the file name"


def spoil(folder):
    (folder / "one.png").write_bytes(b"no picture")
    return folder / "one.png", "one.png: cannot be read as a picture"


def shrink(folder):
    save_png(folder / "plates" / "train-5.png", torch.ones(SIZE, SIZE - 1, 3))
    return folder / "plates", "train-5.png: 48 x 47 (height x width) pixels, but the cameras say 48 x 48"


def clear(folder):
    save_png(folder / "one.png", torch.zeros(SIZE, SIZE, 4))
    return folder / "one.png", "one.png: a background must be opaque, but has transparent pixels"


def mistype(folder):
    return folder / "two.png", "--background must be white, black or R,G,B with numbers from 0 to 1"


@pytest.mark.parametrize("wrong", [lose, spoil, shrink, clear, mistype])
def test_a_wrong_background_writes_nothing(scene, wrong, capsys):
    background, message = wrong(scene)
    with pytest.raises(SystemExit) as stopped:
        main(["views", str(scene), "-o", str(scene / "out"), "--background", str(background), "--quiet"])
    assert stopped.value.code == FAULT
    assert message in capsys.readouterr().err
    assert not (scene / "out").exists()


def test_drawings_have_no_picture_behind_them(scene, capsys):
    with pytest.raises(SystemExit):
        main(["views", "--demo", "-o", str(scene / "out"), "--background", str(scene / "one.png")])
    assert "one.png: a background picture is for --target color, not edges" in capsys.readouterr().err
    assert not (scene / "out").exists()
