"""One view: mask, reduced JPEG files, lens distortion together with reduction."""

import math

import pytest
import torch
from PIL import Image

from diff3ds.distortion import NO_DISTORTION, Distortion
from diff3ds.formats import save_png
from diff3ds.formats.png import load_image, load_reduced
from diff3ds.pictures.reading.read_view import read_view
from diff3ds.transforms import View


def view(picture, size, mask=None, lens=NO_DISTORTION, focal=1.0, center=(0.0, 0.0)):
    intrinsics = torch.tensor([[focal, 0, center[0]], [0, focal, center[1]], [0, 0, 1]], dtype=torch.float64)
    return View(picture, mask, size, torch.eye(4, dtype=torch.float64), intrinsics, lens)


def grid(size):
    rows, columns = (torch.arange(n, dtype=torch.float64) + 0.5 for n in size)
    return columns.expand(size), rows[:, None].expand(size)


def test_colour_is_averaged_by_its_alpha(tmp_path):
    """Transparent pixels hold any colour: here green beside opaque red."""
    picture = torch.zeros(6, 12, 4)
    picture[:, :3] = picture[:, 6:9] = torch.tensor([1.0, 0, 0, 1])
    picture[:, 3:6] = picture[:, 9:] = torch.tensor([0.0, 1, 0, 0])
    save_png(tmp_path / "a.png", picture)
    pixels, known = read_view(view(tmp_path / "a.png", (6, 12)), (1, 2))
    torch.testing.assert_close(pixels, torch.tensor([0.5, 0, 0, 0.5]).expand(1, 2, 4))
    assert known.all()


def test_a_mask_of_the_object_is_part_of_alpha(tmp_path):
    picture = torch.full((6, 2, 4), 0.8)
    picture[2:, :, 3] = 0
    save_png(tmp_path / "a.png", picture)
    mask = torch.ones(6, 2, 1)
    mask[:2, :, 0] = torch.tensor([[1.0, 0.0], [0.6, 1.0]])
    save_png(tmp_path / "m.png", mask)
    seen = view(tmp_path / "a.png", (6, 2), tmp_path / "m.png")
    pixels, known = read_view(seen, (6, 2), "object")
    assert known.all()
    expected = torch.tensor([[0.8, 0.0], [0.48, 0.8]])
    torch.testing.assert_close(pixels[:2, :, 3], expected)
    torch.testing.assert_close(pixels[:2, :, 0], 0.8 * expected)
    # A mask of white that is cut out says the same.
    save_png(tmp_path / "m.png", torch.cat([torch.ones(6, 2, 3), mask], -1))
    torch.testing.assert_close(read_view(seen, (6, 2), "object")[0], pixels)
    save_png(tmp_path / "m.png", torch.ones(2, 3, 1))
    with pytest.raises(ValueError, match=r"m\.png: 2 x 3 .* its picture has 6 x 2"):
        read_view(seen, (6, 2), "object")


def test_jpeg_files_are_decoded_smaller(tmp_path):
    Image.new("RGB", (1203, 901), (200, 100, 50)).save(tmp_path / "a.jpg")
    image, size, times = load_reduced(tmp_path / "a.jpg", (224, 300))
    assert (image.shape, size, times) == ((226, 301, 3), (901, 1203), 4)
    assert load_reduced(tmp_path / "a.jpg", None)[0].shape == load_image(tmp_path / "a.jpg").shape == (901, 1203, 3)
    assert load_reduced(tmp_path / "a.jpg", (800, 800))[2] == 1
    Image.new("RGB", (64, 64)).save(tmp_path / "a.png")
    assert load_reduced(tmp_path / "a.png", (8, 8))[1:] == ((64, 64), 1)


@pytest.mark.parametrize("suffix", ["png", "jpg"])
def test_reduced_pictures_lie_where_they_were(tmp_path, suffix):
    """A bright bar across, soft at its edges, in a picture whose size no factor divides."""
    size, small = (901, 1203), (112, 150)
    x, y = grid(size)
    for a in (0.1, math.pi / 2 - 0.1):
        off = math.cos(a) * (x - 600) + math.sin(a) * (y - 450)
        bar = torch.exp(-0.5 * (off / 20) ** 2)
        Image.fromarray((255 * bar).round().byte().numpy()).save(tmp_path / f"a.{suffix}", quality=95)
        pixels, _ = read_view(view(tmp_path / f"a.{suffix}", size), small)
        x2, y2 = grid(small)
        off = math.cos(a) * (x2 * 1203 / 150 - 600) + math.sin(a) * (y2 * 901 / 112 - 450)
        near = off.abs() < 80
        assert float((off * pixels[..., 0])[near].sum() / pixels[..., 0][near].sum()) == pytest.approx(0, abs=0.25)


@pytest.mark.parametrize("suffix", ["png", "jpg"])
def test_lens_distortion_goes_before_the_reduction(tmp_path, suffix):
    """A circle around the principal point that the lens draws smaller comes out with its radius."""
    size, small, focal, k1, radius = (600, 802), (150, 200), 400.0, -0.2, 200.0
    x, y = grid(size)
    seen = torch.hypot(x - 390, y - 310)
    straight = seen
    for _ in range(100):
        straight = seen / (1 + k1 * (straight / focal) ** 2)
    ring = torch.exp(-0.5 * ((straight - radius) / 8) ** 2)
    Image.fromarray((255 * ring).round().byte().numpy()).save(tmp_path / f"a.{suffix}", quality=95)
    lens = Distortion((k1,))
    pixels, known = read_view(view(tmp_path / f"a.{suffix}", size, None, lens, focal, (390.0, 310.0)), small)
    assert known.all()
    x, y = grid(small)
    found = torch.hypot(x * 802 / 200 - 390, y * 4 - 310)
    # The mean over the ring's area counts what lies farther out more.
    share = pixels[..., 0] / found * ((found - radius).abs() < 40)
    assert float((found * share).sum() / share.sum()) == pytest.approx(radius, abs=0.1)
    # As photographed it is ten pixels smaller.
    assert radius * (1 + k1 * (radius / focal) ** 2) == pytest.approx(190)


def test_unknown_pixels_are_empty(tmp_path):
    save_png(tmp_path / "a.png", torch.ones(60, 80, 3))
    lens = Distortion((0.5,))
    pixels, known = read_view(view(tmp_path / "a.png", (60, 80), None, lens, 60.0, (40.0, 30.0)), (30, 40))
    assert not known[[0, 0, -1, -1], [0, -1, 0, -1]].any()
    assert known[15, 20]
    assert (pixels[~known] == 0).all()
    torch.testing.assert_close(pixels[known], torch.ones(int(known.sum()), 4))
