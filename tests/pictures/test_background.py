"""Backgrounds: named, told by alpha, or found along the borders of pictures."""

from dataclasses import replace

import pytest
import torch

import diff3ds as ds
from diff3ds.pictures.content.background import WINDOW, parse_background, with_alpha
from diff3ds.pictures.dataset import PosedPictures
from diff3ds.pictures.store import Store, store_of


def pictures(pixels):
    cameras = ds.orbit([90.0 * i for i in range(len(pixels))], size=pixels.shape[1])
    return PosedPictures(cameras, "color", store_of(pixels), tuple("abcd"[: len(pixels)]))


def opaque(color):
    """Two pictures of a red square in the middle, on a background."""
    pixels = torch.ones(2, 20, 20, 4)
    pixels[..., :3] = torch.tensor(color)
    pixels[:, 6:14, 6:14, :3] = torch.tensor([1.0, 0.0, 0.0])
    return pixels


@pytest.mark.parametrize(
    ("text", "color"),
    [("white", [1, 1, 1]), ("black", [0, 0, 0]), ("0.5,0,1", [0.5, 0, 1]), ("1, 0.25, 0", [1, 0.25, 0])],
)
def test_colors_by_name_and_number(text, color):
    assert parse_background(text).tolist() == color


@pytest.mark.parametrize("text", ["pink", "", "1,2,3", "0.5", "0,0,0,0", "nan,0,0", "0,,1"])
def test_what_names_no_color_is_refused(text):
    with pytest.raises(ValueError, match="background must be white, black or R,G,B with numbers from 0 to 1, got"):
        parse_background(text)


@pytest.mark.parametrize("given", [False, True])
@pytest.mark.parametrize("color", [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.2, 0.6, 0.4)])
def test_a_plain_background_becomes_transparent(color, given):
    before = pictures(opaque(color))
    after, background = with_alpha(before, torch.tensor(color) if given else None)
    torch.testing.assert_close(background, torch.tensor(color), rtol=0, atol=1e-6)
    expected = torch.zeros(2, 20, 20, 4)
    expected[:, 6:14, 6:14] = torch.tensor([1.0, 0.0, 0.0, 1.0])
    assert torch.equal(after.batch([0, 1]).pixels, expected)
    # What was given is left as it was.
    assert before.batch([0, 1]).alpha.min() == 1


def test_pictures_with_alpha_stay_as_they_are():
    pixels = opaque((0.0, 0.0, 0.0))
    pixels[:, 0, 0] = 0
    before = pictures(pixels)
    after, background = with_alpha(before, None)
    assert after is before
    assert background is None
    wanted = torch.tensor([0.1, 0.2, 0.3])
    assert with_alpha(before, wanted)[1] is wanted


def test_opaque_ones_among_cut_out_ones_lose_their_background():
    """Of two pictures one is cut out already: the other becomes like it, by the colour found or given."""
    pixels = opaque((1.0, 1.0, 1.0))
    expected = torch.zeros(20, 20, 4)
    expected[6:14, 6:14] = torch.tensor([1.0, 0.0, 0.0, 1.0])
    pixels[0] = expected
    # What has alpha keeps parts of the background's colour.
    pixels[0, 8:12, 8:12] = 1
    for given in (None, torch.ones(3)):
        after, background = with_alpha(pictures(pixels), given)
        assert background.tolist() == [1, 1, 1]
        assert torch.equal(after.batch([0, 1]).pixels, torch.stack([pixels[0], expected]))


def test_opaque_ones_of_unknown_background_are_counted(generator):
    pixels = torch.cat([opaque((1.0, 1.0, 1.0)), torch.rand(2, 20, 20, 4, generator=generator)])
    pixels[2:, ..., 3] = 1
    pixels[0, :5] = 0
    with pytest.raises(ValueError, match=r"3 of 4 pictures have no transparent areas, .*: b, c, d\. .*--background"):
        with_alpha(pictures(pixels), None)


def test_where_masks_hide_the_borders_the_rim_tells():
    """Known is a disc in the middle; the border of the picture is not."""
    pixels = torch.ones(2, 60, 60, 4)
    pixels[..., :3] = torch.tensor([0.2, 0.6, 0.4])
    pixels[:, 26:34, 26:34, :3] = torch.tensor([1.0, 0.0, 0.0])
    before = pictures(pixels)
    rows, columns = torch.meshgrid(torch.arange(60) - 29.5, torch.arange(60) - 29.5, indexing="ij")
    known = (rows.hypot(columns) < 20).expand(2, -1, -1).contiguous()
    hidden = before.store.pixels * known[..., None]
    after, background = with_alpha(replace(before, store=Store(hidden, known)), None)
    torch.testing.assert_close(background, torch.tensor([0.2, 0.6, 0.4]), rtol=0, atol=1e-6)
    assert after.batch([0, 1]).alpha.sum() == 2 * 64


def test_photographs_stay_opaque(generator):
    pixels = torch.rand(2, 20, 20, 4, generator=generator)
    pixels[..., 3] = 1
    after, background = with_alpha(pictures(pixels), None)
    assert background is None
    assert after.batch([0, 1]).alpha.min() == 1


@pytest.mark.parametrize("color", [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.3, 0.5, 0.4)])
def test_noise_on_a_plain_background_is_no_content(color, generator):
    """A tenth of the range, clipped as in pictures; hardly any of the background stays, and all of the square."""
    pixels = opaque(color).repeat_interleave(4, 1).repeat_interleave(4, 2)
    square = (pixels[..., :3] == torch.tensor([1.0, 0.0, 0.0])).all(-1)
    pixels[..., :3] = (pixels[..., :3] + 0.1 * torch.randn(pixels[..., :3].shape, generator=generator)).clamp(0, 1)
    after, background = with_alpha(pictures(pixels), None)
    # What clips noise moves its mean by .04.
    torch.testing.assert_close(background, torch.tensor(color), rtol=0, atol=0.05)
    alpha = after.batch([0, 1]).alpha
    assert alpha[square].mean() > 0.999
    # Half a window around the square lies within its reach.
    near = torch.nn.functional.max_pool2d(square[:, None].float(), WINDOW, 1, WINDOW // 2)[:, 0] > 0
    assert alpha[~near].mean() < 0.01
