"""`diff3ds views` on scenes with known answers, through the command line."""

import json
from dataclasses import replace

import pytest
import torch
from PIL import Image
from views_runs import EDGE_FILES, FILES, assert_resumed_ends_as_unbroken, distances

import diff3ds as ds
from diff3ds.bezier import closest_point
from diff3ds.cli import FAULT, STOPPED, main
from diff3ds.formats import load_image, save_png
from diff3ds.library.demo import FOOT, FOOT_RADIUS, RING, SEAT_BOTTOM, SEAT_RADIUS, demo_cameras, demo_sketch
from diff3ds.optimize.density import Observation, footprints
from diff3ds.tasks.views.read_scene import sized
from diff3ds.tasks.views.run_views import run_views
from diff3ds.tasks.views.views_options import ViewsOptions


@pytest.fixture(scope="session")
def demo(tmp_path_factory):
    """The folder of one run of the embedded scene."""
    out = tmp_path_factory.mktemp("demo") / "run"
    main(["views", "--demo", "-o", str(out), "--quiet"])
    return out


def test_the_demo_finds_the_stool(demo):
    assert sorted(p.name for p in demo.iterdir()) == EDGE_FILES
    found, truth = ds.load(demo / "sketch.json"), demo_sketch()
    # Eight lines, and three circles of two segments each; the stool is two high.
    assert found.chains.counts.sort().values.tolist() == [1] * 8 + [2] * 3
    assert torch.equal(found.chains.closed, found.chains.counts == 2)
    assert distances(truth, found).max() < 0.01
    assert distances(found, truth).max() < 0.01
    straight = (found.weights == 1).all(1)
    assert straight.sum() == 8
    thirds = found.points[straight][:, 0, None].lerp(
        found.points[straight][:, 3, None], torch.linspace(0, 1, 4)[:, None]
    )
    torch.testing.assert_close(found.points[straight], thirds, rtol=0, atol=1e-5)


def test_circles_of_the_demo_are_circles(demo):
    found = ds.load(demo / "sketch.json")
    arcs = found[found.chains.closed]
    on = ds.bezier.evaluate(arcs.points, arcs.weights, torch.linspace(0, 1, 21))
    # Both halves end at both ends of one diameter.
    centers = (on[:, 0] + on[:, -1]) / 2
    radii = (on - centers[:, None]).norm(dim=2)
    assert ((radii.amax(1) - radii.amin(1)) / radii.mean(1)).max() < 1e-4
    truth = sorted([SEAT_RADIUS, SEAT_RADIUS, ring_radius()] * 2)
    torch.testing.assert_close(radii.mean(1).sort().values, torch.tensor(truth), rtol=0.005, atol=0)


def ring_radius():
    """Of the ring that joins the legs."""
    share = (SEAT_BOTTOM - RING) / (SEAT_BOTTOM - FOOT)
    return 0.8 * SEAT_RADIUS + share * (FOOT_RADIUS - 0.8 * SEAT_RADIUS)


def test_what_the_demo_writes(demo):
    run = json.loads((demo / "run.json").read_text())
    found = ds.load(demo / "sketch.json")
    assert run["target"] == "edges"
    assert run["curves"] == {"line": 8, "arc": 0, "free": 0, "elliptic_arc": 0, "circle": 3, "ellipse": 0}
    assert run["strokes_left"] == len(found) == 11
    # Circles have no ends.
    assert run["vertices"] == 8 * 2
    assert run["steps_done"] == len(run["loss"]["values"]) * run["loss"]["every"]
    assert run["loss"]["values"][-1] < run["loss"]["values"][0]
    assert all(abs(value) < 0.1 for value in run["bias_pixels"].values())
    assert not run["stopped_early"]
    picture = load_image(demo / "preview.png")
    assert picture.shape == (4 * 256, 4 * 256, 3)
    # Left of each pair the target, right the sketch: nearly the same ink.
    target, drawn = picture[:256, :256], picture[:256, 256:512]
    assert (1 - drawn).sum() == pytest.approx(float((1 - target).sum()), rel=0.3)


@pytest.mark.usefixtures("read_here")
def test_step_holds_the_same_strokes(demo):
    pytest.importorskip("OCP", reason="reading STEP needs the extra cad")
    found, back = ds.load(demo / "sketch.json"), ds.load(demo / "sketch.step")
    assert torch.equal(back.chains.closed, found.chains.closed)
    # A circle is two halves in one and its quarters in the other: the curves are the same.
    for stroke in range(len(found)):
        one, other = found[stroke].to(torch.float64), back[stroke].to(torch.float64)
        for here, there in ((one, other), (other, one)):
            on = ds.bezier.evaluate(here.points, here.weights, torch.linspace(0, 1, 33, dtype=torch.float64))
            queries = on.reshape(1, -1, 3).expand(len(there.points), -1, 3)
            away = closest_point(there.points, there.weights, queries).distance.amin(0)
            assert float(away.max()) < 1e-6


@pytest.fixture
def colored(tmp_path):
    """Few coloured strokes seen from all around, as pictures on disk, with two held-out views."""
    points = torch.tensor(
        [[[-0.7, 0, -0.5], [0, 0.9, 0], [0.7, 0, -0.5]], [[0, -0.7, 0.5], [0.9, 0, 0.5], [0, 0.7, 0.5]]]
    ).float()
    sketch = ds.Sketch(points, width=0.1, color=torch.tensor([[0.9, 0.2, 0.1], [0.1, 0.3, 0.8]]))
    for name, azimuth in (("train", list(range(0, 360, 30))), ("test", [15, 195])):
        cameras = ds.orbit(azimuth, 25, 2.6, size=64)
        pictures = [f"{name}-{i}.png" for i in range(len(azimuth))]
        for picture, image in zip(pictures, ds.render(sketch, cameras).color, strict=True):
            save_png(tmp_path / picture, image)
        ds.save_transforms(tmp_path / f"transforms_{name}.json", cameras, pictures)
    return tmp_path


@pytest.mark.slow
def test_colored_pictures(colored):
    out = colored / "out"
    main(["views", str(colored), "-o", str(out), "--strokes", "60", "--steps", "500", "--quiet"])
    run = json.loads((out / "run.json").read_text())
    assert run["target"] == "color"
    # An empty sheet has 15 dB.
    assert run["scores"]["psnr_test"] > 25
    assert run["scores"]["psnr"] > 25
    # Every stroke shows: half of the share of the mean one under which strokes go after the last step.
    cameras, _ = ds.load_transforms(colored / "transforms_train.json")
    everything = torch.ones(len(cameras), 64, 64)
    observed = Observation(cameras, everything[..., None].expand(-1, -1, -1, 4), everything.bool())
    shown, _ = footprints(ds.load(out / "sketch.json"), observed)
    assert shown.min() > 0.01 * shown.mean()


@pytest.mark.slow
def test_one_seed_gives_one_file(colored):
    files = []
    for name in ("a", "b"):
        main(["views", str(colored), "-o", str(colored / name), "--strokes", "20", "--steps", "10", "--quiet"])
        files.append((colored / name / "sketch.json").read_bytes())
    assert files[0] == files[1]


@pytest.mark.slow
def test_ctrl_c_leaves_a_result_and_resume_ends_where_an_unbroken_run_does(colored):
    assert_resumed_ends_as_unbroken(colored, [str(colored), "--strokes", "20", "--steps", "800", "--quiet"], FILES)


@pytest.mark.slow
def test_ctrl_c_while_pictures_are_judged_leaves_the_sketch(colored, monkeypatch, capsys):
    def stopped(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("diff3ds.tasks.views.descents.color_scores", stopped)
    out = colored / "out"
    with pytest.raises(SystemExit) as end:
        main(["views", str(colored), "-o", str(out), "--strokes", "5", "--steps", "4", "--quiet"])
    assert end.value.code == STOPPED
    assert "what was reached is written, --resume goes on" in capsys.readouterr().err
    assert sorted(p.name for p in out.iterdir()) == FILES
    monkeypatch.undo()
    main(["views", str(colored), "-o", str(out), "--strokes", "5", "--steps", "4", "--quiet", "--resume"])
    assert json.loads((out / "run.json").read_text())["scores"]


def box_pictures(folder, half, turn):
    """Pictures of a cuboid, each face in its own colour on nothing, by its intersection with rays."""
    cameras = ds.orbit(list(range(0, 360, 18)), [(-30.0, 10.0, 45.0)[i % 3] for i in range(20)], 2.6, fov=45, size=96)
    colors = torch.tensor(
        [[0.8, 0.2, 0.2], [0.2, 0.7, 0.3], [0.3, 0.3, 0.9], [0.9, 0.8, 0.2], [0.6, 0.2, 0.7], [0.3, 0.8, 0.8]]
    )
    fine = (torch.arange(3 * 96) + 0.5) / 3
    pixels = torch.stack([*torch.meshgrid(fine, fine, indexing="xy"), torch.ones(288, 288)], -1)
    for i in range(20):
        rotation, center = cameras.world_to_camera[i, :3, :3], cameras.centers[i]
        rays = pixels @ (turn.T @ rotation.T @ cameras.intrinsics[i].inverse()).T
        sides = torch.stack([(s * half - turn.T @ center) / rays for s in (-1, 1)])
        enter, leave = sides.amin(0).max(-1), sides.amax(0).amin(-1)
        positive = rays.gather(-1, enter.indices[..., None])[..., 0] > 0
        hit = (enter.values < leave).float()[..., None]
        rgba = torch.cat([colors[2 * enter.indices + positive] * hit, hit], -1)
        rgba = rgba.reshape(96, 3, 96, 3, 4).mean((1, 3))
        rgba[..., :3] /= rgba[..., 3:].clamp(min=1e-6)
        Image.fromarray((rgba * 255).round().to(torch.uint8).numpy()).save(folder / f"{i}.png")
    ds.save_transforms(folder / "transforms.json", cameras, [f"{i}.png" for i in range(20)])


def test_edges_of_coloured_pictures(tmp_path):
    half = torch.tensor([0.5, 0.35, 0.45])
    turn = torch.linalg.qr(torch.tensor([[1.0, 0.2, 0.1], [-0.3, 1, 0.2], [0.1, 0.4, 1]])).Q
    box_pictures(tmp_path, half, turn)
    main(["views", str(tmp_path), "--target", "color-edges", "-o", str(tmp_path / "out"), "--quiet"])
    run = json.loads((tmp_path / "out" / "run.json").read_text())
    assert run["target"] == "color-edges"
    # Of 20 photographs: 512 22 / 20 = 563.2.
    assert run["options"]["size"] == 563
    corners = torch.tensor([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half @ turn.T
    pairs = [(i, j) for i in range(8) for j in range(i) if (i ^ j) in (1, 2, 4)]
    truth = ds.Sketch(torch.stack([torch.stack([corners[i], corners[j]]) for i, j in pairs]))
    found = ds.load(tmp_path / "out" / "sketch.json")
    # A pixel is 0.02 wide.
    assert (distances(truth, found) < 0.02).float().mean() > 0.97
    assert (distances(found, truth) < 0.02).float().mean() > 0.97
    assert 12 <= len(found) <= 15


@pytest.mark.parametrize("cameras", [True, False])
@pytest.mark.parametrize(("count", "size"), [(3, 1024), (11, 1024), (18, 626), (22, 512), (50, 512)])
def test_few_photographs_are_kept_larger(tmp_path, count, size, cameras):
    names = [f"{i}.png" for i in range(count)]
    for name in names:
        Image.new("RGB", (8, 8), (90, 40, 20)).save(tmp_path / name)
    if cameras:
        found = ds.orbit([360 * i / count for i in range(count)], 20, 2.6, size=8)
        ds.save_transforms(tmp_path / "transforms.json", found, names)
    edges = ViewsOptions(target="color-edges")
    # Of 18: 512 22 / 18 = 625.8.
    assert sized(tmp_path, edges).size == size
    assert sized(tmp_path, replace(edges, size=300)).size == 300
    for target in (None, "edges", "color"):
        assert sized(tmp_path, ViewsOptions(target=target)).size == 512


def test_random_curves_want_drawings(colored, capsys):
    with pytest.raises(SystemExit):
        main(["views", str(colored), "--target", "color-edges", "--init", "random", "-o", str(colored / "out")])
    assert "leave --init out" in capsys.readouterr().err
    assert not (colored / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["views"], FAULT, "give either a transforms.json (or a folder with one) or --demo"),
        (["views", "somewhere", "--demo"], FAULT, "give either"),
        (["views", "somewhere"], FAULT, "somewhere: no such file or folder"),
        (["views", "--demo", "--steps", "0"], FAULT, "--steps must be positive, got 0"),
        (["views", "--demo", "--strokes", "-3"], FAULT, "--strokes must be positive, got -3"),
        (["views", "--demo", "--size", "many"], FAULT, "--size must be a whole number, got 'many'"),
        ([], 2, "views"),
    ],
)
def test_wrong_input_writes_nothing(arguments, code, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    assert stopped.value.code == code
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_demo_views_show_all_of_the_stool():
    alpha = ds.render(demo_sketch(), demo_cameras()).alpha
    assert (alpha.flatten(1).sum(1) > 100).all()
    border = torch.cat([alpha[:, 0], alpha[:, -1], alpha[:, :, 0], alpha[:, :, -1]])
    assert border.max() == 0


@pytest.mark.parametrize(("scene", "f10"), [("00000952", 0.9), ("00004926", 0.85)])
def test_edges_of_real_models(data_folder, tmp_path, scene, f10):
    """F-score at 10 mm of a 1 m object against the ground truth; NEF published .77 on the first."""
    spatial = pytest.importorskip("scipy.spatial")
    folder = data_folder / "abc_nef" / scene
    main(["views", str(folder), "-o", str(tmp_path / "out"), "--quiet"])
    truth = json.loads((folder / "ground_truth.json").read_text())
    curves = truth.get("curves")
    points = torch.tensor(truth["points"]) if curves is None else torch.cat([_sampled(c["points"]) for c in curves])
    found = ds.load(tmp_path / "out" / "sketch.json")
    samples = ds.bezier.evaluate(found.points, found.weights, torch.linspace(0, 1, 60)).reshape(-1, 3)
    precision = (spatial.cKDTree(points.numpy()).query(samples.numpy())[0] < 0.01).mean()
    recall = (spatial.cKDTree(samples.numpy()).query(points.numpy())[0] < 0.01).mean()
    assert 2 * precision * recall / (precision + recall) > f10


def _sampled(polyline):
    points = torch.tensor(polyline)
    t = torch.linspace(0, 1, 60)[:, None, None]
    return ((1 - t) * points[:-1] + t * points[1:]).reshape(-1, 3)


def test_drawings_are_followed_from_an_edited_sketch(tmp_path):
    """Strokes that were moved aside come back, but for the one that is fixed; the rest is as it was given."""
    truth = demo_sketch()
    aside = truth.transform(torch.eye(4) + torch.tensor([[0.0, 0, 0, 0.04], [0] * 4, [0] * 4, [0] * 4]))
    fixed = torch.arange(len(truth)) == len(truth) - 1
    ds.save(tmp_path / "edited.json", ds.Sketch(**aside.tensors(), chains=aside.chains, fixed=fixed))
    given = ds.load(tmp_path / "edited.json")
    found = run_views(None, tmp_path / "out", ViewsOptions(start=tmp_path / "edited.json", steps=100, size=128))
    segments = fixed if truth.chains is None else fixed[truth.chains.stroke]
    assert torch.equal(found.points[segments], given.points[segments])
    assert torch.equal(found.weights, given.weights)
    assert torch.equal(found.width, given.width)
    assert not torch.equal(found.points[~segments], given.points[~segments])
    assert distances(found[~fixed].segments(), truth).mean() < 0.6 * distances(given[~fixed].segments(), truth).mean()
    cameras = demo_cameras(size=96)
    wanted, before, after = (ds.render(sketch[~fixed], cameras).alpha for sketch in (truth, given, found))
    assert (after - wanted).square().mean() < 0.5 * (before - wanted).square().mean()
    assert torch.equal(ds.load(tmp_path / "out/sketch.json").fixed, fixed)


def test_drawings_do_not_mind_how_strokes_look(tmp_path):
    """Only where they run, and that alone changes."""
    plain = demo_sketch()
    count = len(plain)
    looks = {
        "width": torch.linspace(0.003, 0.1, count),
        "opacity": torch.linspace(0, 1, count),
        "color": torch.linspace(0, 1, 3 * count).reshape(-1, 3),
    }
    painted = ds.Sketch(**{**plain.tensors(), **looks}, width_space="world", chains=plain.chains)
    found = {}
    for name, sketch in (("plain", plain), ("painted", painted)):
        ds.save(tmp_path / f"{name}.json", sketch)
        options = ViewsOptions(start=tmp_path / f"{name}.json", steps=3, size=64)
        found[name] = run_views(None, tmp_path / name, options)
    assert torch.equal(found["painted"].points, found["plain"].points)
    assert not torch.equal(found["painted"].points, plain.points)
    for name, given in looks.items():
        assert torch.equal(getattr(found["painted"], name), given), name


def test_what_views_cannot_go_on_from_is_said(tmp_path):
    ds.save(tmp_path / "far.json", ds.Sketch(torch.full((1, 4, 3), 100.0)))
    with pytest.raises(ValueError, match=r"far\.json: its strokes reach .* is it in the world of their cameras"):
        run_views(None, tmp_path / "out", ViewsOptions(start=tmp_path / "far.json", size=96))
    with pytest.raises(ValueError, match="leave --strokes out"):
        ViewsOptions(start=tmp_path / "far.json", strokes=5)
    with pytest.raises(ValueError, match="leave --detail out"):
        ViewsOptions(start=tmp_path / "far.json", detail=0.5)
    with pytest.raises(ValueError, match="leave --init random out"):
        ViewsOptions(start=tmp_path / "far.json", init="random")
    assert not (tmp_path / "out").exists()
