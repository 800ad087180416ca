"""Picture files that are read several times in a run: how often they are decoded, and that they stay as they are."""

import numpy as np
import pytest
import torch
from PIL import Image

from diff3ds.formats.png import load_reduced
from diff3ds.pictures.reading import decoded_once as module
from diff3ds.pictures.reading.decoded_once import at_a_time, decoded_once, load_once


@pytest.fixture
def decodes(monkeypatch):
    """The files that are decoded, in order."""
    done = []

    def counted(path, least):
        done.append(path.name)
        return load_reduced(path, least)

    monkeypatch.setattr(module, "load_reduced", counted)
    return done


def smooth(height=240, width=320):
    y, x = np.mgrid[:height, :width]
    return np.stack([x * 255 // width, y * 255 // height, (x + y) % 256 // 2], -1).astype(np.uint8)


def test_files_are_decoded_once_and_come_with_the_same_bits(tmp_path, decodes):
    Image.fromarray(smooth()).save(tmp_path / "a.jpg")
    Image.fromarray(smooth()).save(tmp_path / "b.png")
    Image.fromarray(smooth()[..., 0].astype(np.uint16) * 257 + 3).save(tmp_path / "deep.png")
    (tmp_path / "deeper").mkdir()
    for name, least, times in (("a.jpg", (120, 160), 2), ("b.png", None, 1), ("deep.png", (60, 80), 1)):
        expected, full, _ = load_reduced(tmp_path / name, least)
        with decoded_once(160):
            for path in (tmp_path / name, tmp_path / "deeper" / ".." / name):
                image, size, got = load_once(path, least)
                assert (size, got) == (full, times)
                assert torch.equal(image, expected)
    assert decodes == ["a.jpg", "b.png", "deep.png"]
    load_once(tmp_path / "b.png", None)
    load_once(tmp_path / "b.png", None)
    assert decodes[3:] == ["b.png", "b.png"]


def test_a_larger_picture_that_was_read_first_does_for_a_smaller_one(tmp_path, decodes):
    """Of a JPEG file, by means over blocks: those of the decoder are other numbers, but by little."""
    Image.fromarray(smooth(237, 320)).save(tmp_path / "a.jpg", quality=95)
    with decoded_once(80):
        assert load_once(tmp_path / "a.jpg", (237, 320))[2] == 1
        image, full, times = load_once(tmp_path / "a.jpg", (59, 80))
        assert (full, times) == ((237, 320), 4)
        assert decodes == ["a.jpg"]
        expected = load_reduced(tmp_path / "a.jpg", (59, 80))[0]
        assert image.shape == expected.shape == (60, 80, 3)
        assert (image - expected)[:-1].abs().max() < 0.04
        # In full, as masks want it, it is decoded again.
        assert load_once(tmp_path / "a.jpg", None)[2] == 1
    assert decodes == ["a.jpg", "a.jpg"]


def test_what_does_not_fit_is_decoded_again(tmp_path, decodes, monkeypatch):
    monkeypatch.setattr(module, "MEMORY", smooth().nbytes)
    for name in ("a.png", "b.png"):
        Image.fromarray(smooth()).save(tmp_path / name)
    with decoded_once(320):
        for name in ("a.png", "b.png", "a.png", "b.png"):
            load_once(tmp_path / name, None)
    assert decodes == ["a.png", "b.png", "b.png"]


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
@pytest.mark.parametrize("least", [None, (240, 320), (121, 100), (60, 80), (30, 41)])
def test_as_many_are_read_at_a_time_as_fit_in_memory(tmp_path, suffix, least):
    """Each takes 40 bytes a pixel that is decoded, of 512 MiB: how many pixels that are the decoder says."""
    path = tmp_path / f"picture{suffix}"
    Image.fromarray(smooth()).save(path)
    height, width = load_reduced(path, least)[0].shape[:2]
    small = (path, (240, 320), least)
    assert at_a_time([small]) == 2**29 // (40 * height * width)


def test_the_largest_picture_says_how_many_are_read_at_a_time(tmp_path):
    """12 megapixels in full are one, at half their size four; a turned file is read in full."""
    small, large = tmp_path / "small.jpg", tmp_path / "large.jpg"
    Image.fromarray(smooth()).save(small)
    Image.new("L", (4032, 3024)).save(large)
    first = (small, (240, 320), (60, 80))
    assert at_a_time([first, (large, (3024, 4032), None)]) == 1
    assert at_a_time([first, (large, (3024, 4032), (768, 1024))]) == 4
    assert at_a_time([first, (large, (4032, 3024), (1024, 768))]) == 1
    # Who keeps pictures for what will be asked for later decodes more of them.
    with decoded_once(4032):
        assert at_a_time([first, (large, (3024, 4032), (768, 1024))]) == 1


def test_what_is_asked_for_first_does_for_what_is_larger(tmp_path, decodes):
    Image.fromarray(smooth()).save(tmp_path / "a.jpg")
    with decoded_once(160):
        assert load_once(tmp_path / "a.jpg", (30, 40))[2] == 2
        assert load_once(tmp_path / "a.jpg", (120, 160))[2] == 2
    assert decodes == ["a.jpg"]
