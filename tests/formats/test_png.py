"""Pictures: exact 8-bit round trips, grids, and refusal of broken and giant files."""

import io
import random

import numpy as np
import pytest
import torch
from PIL import Image

import diff3ds as ds
from diff3ds.formats import load_image, png, save_png, tile_images


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_every_8_bit_value_survives(tmp_path, channels):
    image = (torch.arange(256 * channels).remainder(256).reshape(16, 16, channels) / 255).float()
    save_png(tmp_path / "a.png", image)
    assert torch.equal(load_image(tmp_path / "a.png"), image)


def test_first_row_is_the_top_and_values_are_rounded_and_clamped(tmp_path):
    image = torch.tensor([[[1.5, 0.0, -0.5], [0.4 / 255, 0.6 / 255, 254.6 / 255]], [[0.0, 1.0, 0.0], [0.2, 0.4, 0.6]]])
    save_png(tmp_path / "a.png", image)
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (2, 2)
        assert [picture.getpixel(p) for p in ((0, 0), (1, 0), (0, 1), (1, 1))] == [
            (255, 0, 0),
            (0, 1, 255),
            (0, 255, 0),
            (51, 102, 153),
        ]


@pytest.mark.parametrize(
    ("image", "error", "message"),
    [
        (np.zeros((2, 2, 3)), TypeError, "floating point tensor"),
        (torch.zeros(2, 2, 3, dtype=torch.uint8), TypeError, "uint8"),
        (torch.zeros(1, 2, 2, 3), ValueError, r"\(1, 2, 2, 3\): several views make one picture with tile_images"),
        (torch.zeros(2, 2), ValueError, "shape"),
        (torch.zeros(0, 2, 3), ValueError, "shape"),
        (torch.zeros(2, 2, 2), ValueError, "C = 1, 3 or 4"),
        (torch.tensor([[[0.0], [torch.nan]]]), ValueError, "finite, got nan at row 0, column 1"),
    ],
)
def test_bad_images_write_nothing(tmp_path, image, error, message):
    # Past the shape annotations, which the tests check too, as a user's call would go.
    save = getattr(save_png, "__wrapped__", save_png)
    with pytest.raises(error, match=message):
        save(tmp_path / "a.png", image)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("mode", "channels", "expected"),
    [
        ("1", 1, [1.0]),
        ("L", 1, [200 / 255]),
        ("LA", 4, [200 / 255, 200 / 255, 200 / 255, 100 / 255]),
        ("RGB", 3, [10 / 255, 20 / 255, 30 / 255]),
        ("RGBA", 4, [10 / 255, 20 / 255, 30 / 255, 40 / 255]),
        ("P", 3, [10 / 255, 20 / 255, 30 / 255]),
        ("I;16", 1, [50_000 / 65535]),
    ],
)
def test_colour_models(tmp_path, mode, channels, expected):
    color = {"1": 1, "L": 200, "LA": (200, 100), "RGBA": (10, 20, 30, 40), "I;16": 50_000}.get(mode, (10, 20, 30))
    picture = Image.new("RGB", (3, 2), color).quantize(4) if mode == "P" else Image.new(mode, (3, 2), color)
    picture.save(tmp_path / "a.png")
    image = load_image(tmp_path / "a.png")
    assert image.shape == (2, 3, channels)
    assert image.dtype == torch.float32
    torch.testing.assert_close(image[1, 2], torch.tensor(expected), atol=1e-7, rtol=0)


@pytest.mark.parametrize(("mode", "clear"), [("L", 200), ("RGB", (200, 10, 10))])
def test_a_transparent_colour_has_alpha(tmp_path, mode, clear):
    picture = Image.new(mode, (2, 1), clear)
    picture.putpixel((1, 0), 0 if mode == "L" else (0, 0, 0))
    picture.save(tmp_path / "a.png", transparency=clear)
    image = load_image(tmp_path / "a.png")
    assert image.shape == (1, 2, 4)
    assert image[0, :, 3].tolist() == [0, 1]


def test_palette_with_transparency_has_alpha(tmp_path):
    picture = Image.new("P", (2, 1), 0)
    picture.putpalette([255, 0, 0, 0, 0, 255])
    picture.putpixel((1, 0), 1)
    picture.save(tmp_path / "a.png", transparency=1)
    assert load_image(tmp_path / "a.png").tolist() == [[[1, 0, 0, 1], [0, 0, 1, 0]]]


def test_decompression_bombs_are_refused(tmp_path, monkeypatch):
    Image.new("1", (20_000, 20_000)).save(tmp_path / "bomb.png")
    assert (tmp_path / "bomb.png").stat().st_size < 100_000
    with pytest.raises(ValueError, match=r"bomb.png: cannot be read as a picture \(Image size \(400000000 pixels\)"):
        load_image(tmp_path / "bomb.png")
    # Also where the program has switched pillow's own bound off.
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", None)
    with pytest.raises(ValueError, match="20000 x 20000 are more than the 134217728 that are read"):
        load_image(tmp_path / "bomb.png")


def test_bound_is_on_the_pixels(tmp_path, monkeypatch):
    monkeypatch.setattr(png, "MAX_PIXELS", 6)
    save_png(tmp_path / "a.png", torch.zeros(2, 3, 3))
    assert load_image(tmp_path / "a.png").shape == (2, 3, 3)
    save_png(tmp_path / "a.png", torch.zeros(1, 7, 3))
    with pytest.raises(ValueError, match="7 x 1 are more than the 6"):
        load_image(tmp_path / "a.png")


def test_missing_and_other_files(tmp_path):
    with pytest.raises(FileNotFoundError):
        load_image(tmp_path / "none.png")
    (tmp_path / "text.png").write_text("no picture")
    with pytest.raises(ValueError, match=r"text\.png: cannot be read as a picture"):
        load_image(tmp_path / "text.png")


@pytest.mark.parametrize("suffix", ["PNG", "JPEG", "GIF", "TIFF", "BMP", "WEBP"])
def test_damaged_pictures_give_an_image_or_a_value_error(tmp_path, suffix):
    rng = random.Random(suffix)
    buffer = io.BytesIO()
    noise = np.random.default_rng(0).integers(0, 256, (9, 7, 3), dtype=np.uint8)
    Image.fromarray(noise).save(buffer, suffix)
    for _ in range(60):
        content = bytearray(buffer.getvalue())
        if rng.random() < 0.3:
            content = content[: rng.randrange(len(content))]
        for _ in range(rng.randrange(6)):
            if content:
                content[rng.randrange(len(content))] = rng.randrange(256)
        (tmp_path / "a").write_bytes(content)
        try:
            image = load_image(tmp_path / "a")
        except ValueError:
            continue
        assert image.min() >= 0
        assert image.max() <= 1


def test_tiles_go_row_by_row_over_white():
    images = torch.arange(1, 4).reshape(3, 1, 1, 1).expand(3, 2, 1, 3).float() / 10
    expected = torch.tensor([[0.1, 0.2], [0.1, 0.2], [0.3, 1.0], [0.3, 1.0]])
    assert torch.equal(tile_images(images), expected[..., None].expand(4, 2, 3))
    assert tile_images(images, columns=3).shape == (2, 3, 3)
    assert tile_images(images, columns=1).shape == (6, 1, 3)
    assert torch.equal(tile_images(images[:1], 2), torch.tensor([[0.1, 1.0]] * 2)[..., None].expand(2, 2, 3))


def test_tiles_need_pictures_and_columns():
    with pytest.raises(ValueError, match="at least one view"):
        tile_images(torch.zeros(0, 2, 2, 3))
    with pytest.raises(ValueError, match="columns must be positive, got 0"):
        tile_images(torch.zeros(1, 2, 2, 3), 0)


def test_saved_views_are_the_rendered_ones(tmp_path):
    sketch = ds.Sketch.random(20, generator=torch.Generator().manual_seed(0), width=0.05)
    cameras = ds.orbit([0.0, 120.0, 240.0], 20.0, 3.0, size=(40, 60))
    ds.save(tmp_path / "views.png", sketch, cameras)
    image = load_image(tmp_path / "views.png")
    assert image.shape == (80, 120, 3)
    rendered = ds.render(sketch, cameras).color
    # Half of the last of 255 steps.
    torch.testing.assert_close(image[:40, 60:], rendered[1], atol=0.5 / 255 + 1e-6, rtol=0)
    assert bool((image[40:, 60:] == 1).all())
    assert image.min() < 0.5
