"""Many pictures read side by side: each once, in any number of threads alike; lenses and reduction in one pass."""

import collections
import itertools
import json
import threading

import pytest
import torch

import diff3ds as ds
from diff3ds.distortion import Distortion
from diff3ds.formats import save_png
from diff3ds.pictures.content.clean_plates import load_clean_plates
from diff3ds.pictures.dataset import load_posed
from diff3ds.pictures.reading import decoded_once
from diff3ds.pictures.reading.lens import straightened, undistorted
from diff3ds.pictures.reading.read_view import read_view
from diff3ds.pictures.reading.resample import area_means
from diff3ds.tasks.views.run_views import run_views
from diff3ds.tasks.views.views_options import ViewsOptions
from diff3ds.transforms import read_views

SIZE = (60, 80)
LENS = Distortion((0.3, 0.05), (0.002, -0.001))


def photographs(folder, count, content):
    """Pictures of this content, (count, H, W, 3), from around."""
    names = [f"{i}.png" for i in range(count)]
    for name, picture in zip(names, content, strict=True):
        save_png(folder / name, picture)
    ds.save_transforms(folder / "transforms.json", ds.orbit([20.0 * i for i in range(count)], size=SIZE), names)
    return folder / "transforms.json"


@pytest.fixture
def noise(generator):
    return torch.rand(20, *SIZE, 3, generator=generator)


@pytest.fixture
def decoded(monkeypatch):
    """How often each picture has been decoded, and on how many threads."""
    times, threads, decode = collections.Counter(), set(), decoded_once.load_reduced

    def counted(path, least):
        times[path.name] += 1
        threads.add(threading.get_ident())
        return decode(path, least)

    monkeypatch.setattr(decoded_once, "load_reduced", counted)
    return times, threads


@pytest.mark.parametrize("size", [30, 80])
@pytest.mark.parametrize("drawn", [False, True])
def test_each_picture_is_decoded_once(noise, decoded, tmp_path, size, drawn):
    """Coloured ones, and drawings of lines, whose background has to be found first."""
    if drawn:
        noise = torch.ones_like(noise)
        noise[:, 20:24] = 0
    path = photographs(tmp_path, 20, noise)
    told = []
    pictures = load_posed(path, None, size, told=lambda done, total: told.append((done, total)))
    assert pictures.target == ("edges" if drawn else "color")
    assert decoded[0] == {f"{i}.png": 1 for i in range(20)}
    assert told[-1] == (20, 20)
    assert {total for _, total in told} == {20}
    # As each view is read by itself, with 8 bits.
    for view, picture in zip(read_views(path), pictures.store.pixels, strict=True):
        rgba, _ = read_view(view, pictures.cameras.size)
        expected = 1 - rgba[..., :1] if drawn else rgba
        torch.testing.assert_close(picture / 255, expected, rtol=0, atol=1.01 / 255)


def test_one_picture_behind_all_is_decoded_once(noise, decoded, tmp_path):
    path = photographs(tmp_path, 4, noise[:4])
    save_png(tmp_path / "behind.png", noise[5])
    clean_plates = load_clean_plates(path, tmp_path / "behind.png", 80)
    assert decoded[0] == {"behind.png": 1}
    for view in range(4):
        torch.testing.assert_close(
            clean_plates.store.batch([view]).pixels[0, ..., :3], noise[5], rtol=0, atol=0.51 / 255
        )


def test_threads_change_nothing(noise, decoded, tmp_path, monkeypatch):
    path, digests, used = photographs(tmp_path, 20, noise), set(), []
    before, counted = torch.get_num_threads(), decoded_once.load_reduced
    try:
        for count in (1, 3):
            torch.set_num_threads(count)
            decoded[1].clear()
            begun, all_there = itertools.count(), threading.Barrier(count, timeout=60)

            def together(path, least, begun=begun, all_there=all_there, count=count):
                # On a busy machine one thread may be through with all before the last begins.
                if next(begun) < count:
                    all_there.wait()
                return counted(path, least)

            monkeypatch.setattr(decoded_once, "load_reduced", together)
            digests.add(load_posed(path, "color", 50).digest())
            used.append(len(decoded[1]))
            assert torch.get_num_threads() == count
    finally:
        torch.set_num_threads(before)
    assert len(digests) == 1
    assert used == [1, 3]


def test_the_first_broken_picture_is_named(noise, tmp_path):
    path = photographs(tmp_path, 6, noise[:6])
    for name in ("2.png", "4.png"):
        (tmp_path / name).write_bytes(b"no picture")
    with pytest.raises(ValueError, match=r"2\.png"):
        load_posed(path, "color", 50)


@pytest.mark.parametrize(("size", "extent"), [((20, 27), (60, 80)), ((17, 23), (59.25, 79.5)), ((60, 80), (60, 80))])
def test_one_pass_straightens_and_reduces(generator, monkeypatch, size, extent):
    """As the whole picture straightened first and reduced then, whatever the strips."""
    picture = torch.rand(*SIZE, 4, generator=generator)
    intrinsics = torch.tensor([[50.0, 0, 41], [0, 52, 28], [0, 0, 1]], dtype=torch.float64)
    straight, known = undistorted(picture, intrinsics, LENS, range(60))
    assert 0.5 < known.float().mean() < 0.99
    both = torch.cat([straight * known, known[None].float()]).permute(1, 2, 0)
    expected = area_means(both[None], size, extent)[0]
    for strip in (1, 2000, 1 << 18):
        monkeypatch.setattr("diff3ds.pictures.reading.resample.STRIP", strip)
        means, share = straightened(picture, intrinsics, LENS, size, extent)
        torch.testing.assert_close(means, expected[..., :4], rtol=0, atol=2e-5)
        torch.testing.assert_close(share, expected[..., 4])
        assert torch.equal(area_means(both[None], size, extent)[0], expected)


def test_ctrl_c_while_reading_leaves_nothing(noise, tmp_path):
    """The folder of the results is there from the start, and goes again."""
    path, out, told = photographs(tmp_path, 6, noise[:6]), tmp_path / "new" / "out", []

    def stop(progress):
        told.append((progress.stage, progress.done, out.is_dir()))
        if progress.done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_views(path, out, ViewsOptions(target="color"), stop)
    assert told == [("read", done, True) for done in range(3)]
    assert not (tmp_path / "new").exists()


def test_the_time_of_every_stage_is_written(noise, tmp_path):
    path, stages = photographs(tmp_path, 6, noise[:6]), {}
    run_views(
        path,
        tmp_path / "out",
        ViewsOptions(target="color", strokes=2, steps=2, size=30),
        lambda progress: stages.update({progress.stage: progress.total}),
    )
    assert stages == {"read": 6, "background": None, "pyramid": None, "visual hull": None, "fit": 2, "scores": 6}
    run = json.loads((tmp_path / "out" / "run.json").read_text())
    assert list(run["stages"]) == list(stages)
    assert all(spent["seconds"] >= 0 and spent["processor"] >= 0 for spent in run["stages"].values())
    assert sum(spent["processor"] for spent in run["stages"].values()) > 0
