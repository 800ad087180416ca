"""Numbers in picture files: read where black and white are told, else the error names what was found."""

import numpy as np
import pytest
import torch
from PIL import Image

from diff3ds.formats import load_image


def ramp(kind, high):
    return np.linspace(0, high, 12).reshape(3, 4).astype(kind)


@pytest.mark.parametrize("order", ["<", ">"])
def test_floating_point_from_0_to_1(tmp_path, order):
    values = ramp(np.float32, 1)
    header = {"<": b"II*\0", ">": b"MM\0*"}[order]
    # Eight tags of a TIFF file with one strip, written by hand: pillow writes little-endian files only.
    tags = [(256, 4), (257, 3), (258, 32), (259, 1), (262, 1), (273, 122), (277, 1), (278, 3), (279, 48), (339, 3)]
    number = {"<": "little", ">": "big"}[order]
    directory = len(tags).to_bytes(2, number)
    for tag, value in tags:
        directory += tag.to_bytes(2, number) + (4).to_bytes(2, number) + (1).to_bytes(4, number)
        directory += value.to_bytes(4, number)
    content = header + (8).to_bytes(4, number) + directory + bytes(4)
    tags_end = len(content)
    content = content.replace((122).to_bytes(4, number), tags_end.to_bytes(4, number), 1)
    (tmp_path / "a.tif").write_bytes(content + values.astype(f"{order}f4").tobytes())
    torch.testing.assert_close(load_image(tmp_path / "a.tif")[..., 0], torch.from_numpy(values))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (ramp(np.float32, 255), r"floating point numbers from 0 to 255, but 0 is black and 1 is white"),
        (ramp(np.float32, 3.5), "floating point numbers from 0 to 3.5, but"),
        (ramp(np.float32, 1) - 0.5, "floating point numbers from -0.5 to 0.5, but"),
        (np.where(ramp(np.float32, 1) == 1, np.nan, 0).astype(np.float32), "1 of its 12 numbers are NaN or infinite"),
        (ramp(np.int32, 255), "signed whole numbers of 32 bits, from 0 to 255, and it is not told which"),
    ],
)
def test_numbers_whose_white_is_not_told(tmp_path, values, message):
    Image.fromarray(values).save(tmp_path / "a.tif")
    with pytest.raises(ValueError, match=rf"a\.tif: cannot be read as a picture \({message}"):
        load_image(tmp_path / "a.tif")


def test_overshoot_of_filters_is_clamped(tmp_path):
    Image.fromarray(np.float32([[-0.005, 0.5, 1.005]])).save(tmp_path / "a.tif")
    assert load_image(tmp_path / "a.tif")[0, :, 0].tolist() == [0, 0.5, 1]


def test_16_bits(tmp_path):
    values = ramp(np.uint16, 65535)
    for name in ("a.png", "a.tif"):
        Image.fromarray(values).save(tmp_path / name)
        torch.testing.assert_close(load_image(tmp_path / name)[..., 0], torch.from_numpy(values / 65535).float())
    Image.fromarray(values).save(tmp_path / "a.png", transparency=65535)
    image = load_image(tmp_path / "a.png")
    assert image.shape == (3, 4, 4)
    assert image[..., 3].flatten().tolist() == [1.0] * 11 + [0.0]


@pytest.mark.parametrize("suffix", ["gif", "png", "webp"])
def test_animations_are_refused(tmp_path, suffix):
    frames = [Image.new("RGB", (8, 8), (80 * i, 0, 0)) for i in range(3)]
    frames[0].save(tmp_path / f"a.{suffix}", save_all=True, append_images=frames[1:])
    with pytest.raises(ValueError, match="it holds 3 frames of an animation: save the one that is meant"):
        load_image(tmp_path / f"a.{suffix}")


def test_pages_of_one_size_are_refused_and_thumbnails_are_not(tmp_path):
    pages = [Image.new("L", (8, 8), 80 * i) for i in (1, 2)]
    pages[0].save(tmp_path / "a.tif", save_all=True, append_images=pages[1:])
    with pytest.raises(ValueError, match="it holds 2 pages: save the one that is meant"):
        load_image(tmp_path / "a.tif")
    pages[0].save(tmp_path / "a.tif", save_all=True, append_images=[pages[1].resize((4, 4))])
    assert load_image(tmp_path / "a.tif").unique().tolist() == [np.float32(80 / 255)]
    # Phones put a second picture behind the first.
    pages[0].convert("RGB").save(tmp_path / "a.mpo", save_all=True, append_images=[pages[1].convert("RGB")])
    assert load_image(tmp_path / "a.mpo").shape == (8, 8, 3)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b"a text file\n", r"it begins with b'a text file\\n', as no kind of picture that pillow reads"),
        (b"\0\0\0\x20ftypisom\0\0", r"it is a film: take a frame of it, such as ffmpeg -i clip\.mp4"),
        (b"\0\0\0\x14ftypqt  \0\0", "it is a film"),
        (b"\0\0\0\x18ftypheic\0\0\0\0", r"it is a HEIC picture: name it \.heic, and pip install 'diff3ds\[heic\]'"),
        (b"%PDF-1.7\n", "it is a PDF document: save the page that is meant as PNG or SVG"),
        (
            b"\xef\xbb\xbf<?xml version='1.0'?>\n<svg/>",
            r"it is a vector drawing: an SVG file is read by its name, mug\.svg",
        ),
        (b"<svg xmlns='http://www.w3.org/2000/svg'/>", "it is a vector drawing"),
        (b"gimp xcf v011\0", "it is a GIMP file: export it as PNG"),
        (b"PK\x03\x04", "it is a ZIP archive"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\n", "it is a pointer of Git LFS: .* git lfs pull"),
    ],
)
def test_what_is_no_picture_is_described(tmp_path, content, message):
    (tmp_path / "a.png").write_bytes(content)
    with pytest.raises(ValueError, match=rf"a\.png: cannot be read as a picture \({message}"):
        load_image(tmp_path / "a.png")


def test_tiff_that_pillow_does_not_read_is_described(tmp_path):
    """Three channels of floating point: a file of one, with another count in its tags."""
    Image.fromarray(ramp(np.float32, 1)).save(tmp_path / "a.tif", tiffinfo={277: 3})
    content = bytearray((tmp_path / "a.tif").read_bytes())
    place = content.index((277).to_bytes(2, "little"))
    content[place + 8 : place + 10] = (3).to_bytes(2, "little")
    (tmp_path / "a.tif").write_bytes(content)
    with pytest.raises(ValueError, match="3 channels of floating point numbers of 32 bits in a TIFF file are not read"):
        load_image(tmp_path / "a.tif")
