"""What drawings must show before their edges are looked for, and what is measured of them."""

import pytest
import torch

import diff3ds as ds
from diff3ds.cli import FAULT, main
from diff3ds.formats import save_png
from diff3ds.tasks.edges import most_views
from diff3ds.tasks.linewidth import line_width
from diff3ds.tasks.store import store_of


@pytest.mark.parametrize("init", ["carve", "random"])
def test_drawings_without_lines_are_refused(tmp_path, capsys, init):
    """Wide gray clouds: they show something, and no line."""
    cameras = ds.orbit([0.0, 90.0, 180.0], 20.0, 2.6, size=64)
    y, x = torch.meshgrid(torch.arange(64.0), torch.arange(64.0), indexing="ij")
    cloud = 1 - 0.9 * torch.exp(-((x - 32) ** 2 + (y - 32) ** 2) / 400)
    for k in range(3):
        save_png(tmp_path / f"{k}.png", cloud[..., None])
    ds.save_transforms(tmp_path / "transforms.json", cameras, [f"{k}.png" for k in range(3)])
    command = ["views", str(tmp_path), "-o", str(tmp_path / "out"), "--target", "edges", "--quiet", "--init", init]
    with pytest.raises(SystemExit) as end:
        main([*command, *(["--steps", "3", "--strokes", "4"] if init == "random" else [])])
    assert end.value.code == FAULT
    assert "the views show no edges that agree" in capsys.readouterr().err


def test_the_width_of_lines_does_not_depend_on_threads():
    store = store_of(torch.rand(3, 200, 300, 1, generator=torch.Generator().manual_seed(0)))
    before = torch.get_num_threads()
    widths = []
    for count in (1, 2, 3):
        torch.set_num_threads(count)
        widths.append(line_width(store))
    torch.set_num_threads(before)
    assert len(set(widths)) == 1


def test_fewer_views_are_kept_of_large_pictures():
    assert most_views((512, 512)) == 200
    assert most_views((2160, 3840)) == 48
    assert most_views((65536, 65536)) == 3
