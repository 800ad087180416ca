"""Reference pictures: cut out by alpha, mask or background; framed as in the demonstration of Zero-1-to-3; errors."""

import importlib.util
import sys
import zlib

import numpy as np
import pytest
import torch
from needs import needs
from PIL import Image, ImageOps
from red_network import red_network

from diff3ds.formats import load_image, save_png
from diff3ds.pictures.picture_options import PictureOptions
from diff3ds.pictures.reference_picture import read_reference
from diff3ds.recognition.picture_lines import lines_of

RED, GREEN = torch.tensor([1.0, 0.0, 0.0]), torch.tensor([0.0, 1.0, 0.0])


def rgba(height=300, width=400, box=(50, 150, 300, 350)):
    """A red box, green underneath its transparent surroundings, where it must not show."""
    pixels = torch.zeros(height, width, 4)
    pixels[..., :3] = GREEN
    top, bottom, left, right = box
    pixels[top:bottom, left:right] = torch.tensor([1.0, 0.0, 0.0, 1.0])
    return pixels


DRAWING = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 40 20" width="{width}">{ground}
<g fill="none" stroke="#000"><circle cx="12" cy="10" r="7"/><path d="M 19 10 L 34 10"/></g></svg>"""


@needs("resvg_py")
@pytest.mark.parametrize("ground", ["", '<rect width="40" height="20" fill="#fff"/>'])
def test_an_svg_drawing_is_read_as_its_picture_is(ground, tmp_path):
    """The same at whatever size it says, as the circle and the line beside it are."""
    for width in ("40", "1mm", "30000"):
        (tmp_path / "a.svg").write_text(DRAWING.format(width=width, ground=ground))
        lines = lines_of(read_reference(tmp_path / "a.svg"))
        assert lines.kind == "drawing"
        # The middles of the lines are 29 units wide, from 5 to 34.
        x, y = (lines.points * 29 + (19.5, 10)).T
        away = np.minimum(np.abs(np.hypot(x - 12, y - 10) - 7), np.abs(y - 10) + (x < 19))
        assert away.max() < 0.3
        assert {x.min() < 6, x.max() > 33} == {True}


def test_svg_that_is_none_and_svg_without_its_reader_are_told(tmp_path, monkeypatch):
    (tmp_path / "a.svg").write_text("<svg")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"a\.svg: .* pip install 'diff3ds\[svg\]', or save the drawing as PNG"):
        read_reference(tmp_path / "a.svg")
    monkeypatch.undo()
    if importlib.util.find_spec("resvg_py"):
        with pytest.raises(ValueError, match=r"a\.svg: cannot be read as an SVG drawing .*: save it as PNG"):
            read_reference(tmp_path / "a.svg")


def saved(path, pixels):
    save_png(path, pixels)
    return path


def framed_box(height=100, width=50):
    """What the box of `rgba` becomes: the longer side 200 of 256, in the middle."""
    image = torch.ones(256, 256, 3)
    rows, columns = (200, round(200 * width / height))
    top, left = (256 - rows) // 2, (256 - columns) // 2
    image[top : top + rows, left : left + columns] = RED
    return image


def test_rgba_is_centred_over_white(tmp_path):
    reference = read_reference(saved(tmp_path / "a.png", rgba()))
    torch.testing.assert_close(reference.image, framed_box(), rtol=0, atol=1e-6)
    assert torch.equal(reference.alpha, (framed_box()[..., 1] == 0).float())


def test_mask_file_says_the_same(tmp_path):
    pixels = rgba()
    opaque = saved(tmp_path / "a.png", pixels[..., :3])
    mask = saved(tmp_path / "m.png", pixels[..., 3:])
    reference = read_reference(opaque, options=PictureOptions(mask=mask))
    torch.testing.assert_close(reference.image, framed_box(), rtol=0, atol=1e-6)


@pytest.mark.parametrize("named", [False, True])
@pytest.mark.parametrize("color", [(1.0, 1.0, 1.0), (0.0, 0.0, 0.0), (0.2, 0.6, 1.0)])
def test_plain_background_is_cut_out(tmp_path, color, named):
    pixels = rgba()
    image = torch.where(pixels[..., 3:] > 0, RED, torch.tensor(color))
    options = PictureOptions(background=",".join(map(str, color)) if named else None)
    reference = read_reference(saved(tmp_path / "a.png", image), options=options)
    torch.testing.assert_close(reference.image, framed_box(), rtol=0, atol=1e-6)


def test_picture_keeps_its_framing(tmp_path):
    """400 x 300 becomes a square of 400, then 200: every pixel is the mean of 2 x 2."""
    reference = read_reference(saved(tmp_path / "a.png", rgba()), 200, PictureOptions(frame="picture"))
    expected = torch.zeros(200, 200)
    expected[25 + 25 : 25 + 75, 150:175] = 1
    torch.testing.assert_close(reference.alpha, expected, rtol=0, atol=1e-6)


def test_reduction_is_by_area_means(tmp_path):
    """Stripes of one pixel in an object of 400 pixels become their mean."""
    pixels = torch.zeros(400, 400, 3)
    pixels[:, ::2] = 1
    mask = saved(tmp_path / "m.png", torch.ones(400, 400, 1))
    options = PictureOptions(mask=mask)
    inside = read_reference(saved(tmp_path / "a.png", pixels), options=options).image[30:220, 30:220]
    torch.testing.assert_close(inside, torch.full_like(inside, 0.5), rtol=0, atol=1e-6)


def test_small_objects_are_enlarged_without_overshoot(tmp_path):
    reference = read_reference(saved(tmp_path / "a.png", rgba(64, 64, (10, 50, 20, 40))))
    torch.testing.assert_close(reference.image, framed_box(40, 20), rtol=0, atol=1e-6)


def test_soft_edges_are_mixed_with_white(tmp_path):
    pixels = rgba()
    pixels[50:150, 300:350, 3] = 0.4
    middle = read_reference(saved(tmp_path / "a.png", pixels)).image[128, 128]
    torch.testing.assert_close(middle, 0.4 * RED + 0.6, rtol=0, atol=1e-6)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_rotations_of_cameras_are_heeded_as_by_pillow(tmp_path, orientation, generator):
    """A colour of its own in every corner of the object; pillow's own turning is the independent reader."""
    pixels = torch.zeros(120, 160, 4)
    pixels[20:100, 30:130] = 1
    pixels[20:60, 30:80, :3] = RED
    pixels[60:100, 30:80, :3] = GREEN
    save_png(tmp_path / "plain.png", pixels)
    with Image.open(tmp_path / "plain.png") as picture:
        exif = picture.getexif()
        exif[0x0112] = orientation
        picture.save(tmp_path / "turned.png", exif=exif)
    with Image.open(tmp_path / "turned.png") as picture:
        ImageOps.exif_transpose(picture).save(tmp_path / "upright.png")
    expected = read_reference(tmp_path / "upright.png").pixels
    assert torch.equal(read_reference(tmp_path / "turned.png").pixels, expected)
    assert (orientation == 1) == torch.equal(expected, read_reference(tmp_path / "plain.png").pixels)


def test_photographs_need_a_mask(tmp_path, generator):
    path = saved(tmp_path / "a.png", torch.rand(64, 64, 3, generator=generator))
    with pytest.raises(ValueError, match=r"cannot tell the object .*--cut-out.* PNG with transparency, or give --mask"):
        read_reference(path)


def faint():
    """A square of alpha .03 in a picture of alpha 0."""
    pixels = torch.zeros(64, 64, 4)
    pixels[16:48, 16:48] = torch.tensor([1.0, 1.0, 1.0, 0.03])
    return pixels


@pytest.mark.parametrize(
    ("pixels", "message"),
    [
        (torch.zeros(64, 64, 4), r"transparent everywhere \(alpha is at most 0\): it shows no object"),
        (faint(), r"transparent everywhere \(alpha is at most 0\.031\): it shows no object"),
        (torch.full((64, 64, 3), 0.5), "nothing differs from the background by more than 5 %: there is no object"),
        (torch.ones(64, 64, 1), "nothing differs from the background by more than 5 %: there is no object"),
    ],
    ids=["transparent", "faint", "one colour", "white"],
)
def test_nothing_to_see(tmp_path, pixels, message):
    with pytest.raises(ValueError, match=rf"a\.png: {message}"):
        read_reference(saved(tmp_path / "a.png", pixels))


@pytest.mark.parametrize("alpha", ["one pixel", "all of 254", "all of 128", "checkerboard", "round corners"])
def test_alpha_without_clear_areas_tells_nothing(tmp_path, alpha):
    """A red box on white is cut out by its background, whatever stray alpha says."""
    pixels = torch.ones(300, 400, 4)
    pixels[50:150, 300:350, 1:3] = 0
    if alpha == "one pixel":
        pixels[0, 0, 3] = 254 / 255
    elif alpha == "checkerboard":
        pixels[::2, ::2, 3] = pixels[1::2, 1::2, 3] = 0
    elif alpha == "round corners":
        pixels[:8, :8, 3] = 0
    else:
        pixels[..., 3] = 254 / 255 if alpha == "all of 254" else 128 / 255
    reference = read_reference(saved(tmp_path / "a.png", pixels))
    torch.testing.assert_close(reference.image, framed_box(), rtol=0, atol=1e-6)


def test_inverted_alpha_is_named(tmp_path):
    pixels = rgba()
    pixels[..., 3] = 1 - pixels[..., 3]
    with pytest.raises(ValueError, match=r"a\.png: opaque all along its borders, and transparent inside, .* inverted"):
        read_reference(saved(tmp_path / "a.png", pixels))


@pytest.mark.parametrize("white", [1, 200])
def test_a_mask_of_two_values_is_black_and_white(tmp_path, white):
    pixels = rgba()
    opaque = saved(tmp_path / "a.png", pixels[..., :3])
    Image.fromarray((pixels[..., 3].byte() * white).numpy()).save(tmp_path / "m.png")
    reference = read_reference(opaque, options=PictureOptions(mask=tmp_path / "m.png"))
    torch.testing.assert_close(reference.image, framed_box(), rtol=0, atol=1e-6)


def test_black_mask(tmp_path):
    path, mask = saved(tmp_path / "a.png", torch.ones(64, 64, 3)), saved(tmp_path / "m.png", torch.zeros(64, 64, 3))
    with pytest.raises(ValueError, match=r"m\.png: all black where .*a\.png is visible"):
        read_reference(path, options=PictureOptions(mask=mask))


def test_mask_of_another_size(tmp_path):
    path, mask = saved(tmp_path / "a.png", torch.ones(64, 64, 3)), saved(tmp_path / "m.png", torch.ones(64, 32, 1))
    with pytest.raises(ValueError, match=r"m\.png: 64 x 32 \(height x width\) pixels, but .*a\.png has 64 x 64"):
        read_reference(path, options=PictureOptions(mask=mask))


def test_too_small_an_object(tmp_path):
    with pytest.raises(ValueError, match=r"the object has 31 x 20 pixels; .* 32 or more"):
        read_reference(saved(tmp_path / "a.png", rgba(64, 64, (10, 30, 20, 51))))


def test_no_picture(tmp_path):
    (tmp_path / "a.png").write_text("no picture")
    with pytest.raises(ValueError, match="cannot be read as a picture"):
        read_reference(tmp_path / "a.png")
    with pytest.raises(FileNotFoundError):
        read_reference(tmp_path / "b.png")


def test_what_is_no_file_is_said_with_what_was_expected(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"^\S*none\.png is not there: give a picture of one object"):
        read_reference(tmp_path / "none.png")
    with pytest.raises(IsADirectoryError, match=r"is a folder: give a picture of one object, a file such as"):
        read_reference(tmp_path)
    picture = saved(tmp_path / "a.png", rgba())
    with pytest.raises(FileNotFoundError, match=r"none\.png is not there: give a mask, a picture that is white"):
        read_reference(picture, options=PictureOptions(mask=tmp_path / "none.png"))


def test_giant_pictures_are_refused_before_they_are_decoded(tmp_path):
    """A header that promises 12,000 x 12,000 pixels, and no pixels."""
    save_png(tmp_path / "a.png", torch.zeros(1, 1, 4))
    content = bytearray((tmp_path / "a.png").read_bytes())
    content[16:24] = (12_000).to_bytes(4, "big") * 2
    content[29:33] = zlib.crc32(content[12:29]).to_bytes(4, "big")
    (tmp_path / "a.png").write_bytes(content)
    with pytest.raises(ValueError, match="12000 x 12000 are more than"):
        read_reference(tmp_path / "a.png")


def test_mask_and_background_exclude_each_other(tmp_path):
    with pytest.raises(ValueError, match="either a mask or a background"):
        PictureOptions(mask=tmp_path / "m.png", background="white")
    with pytest.raises(ValueError, match="background must be white, black or"):
        PictureOptions(background="pink")


def test_palettes_and_gray_with_alpha(tmp_path):
    """Gray with alpha is read as RGBA, as `load_image` says."""
    picture = Image.new("LA", (80, 80), (0, 0))
    picture.paste((100, 255), (20, 20, 60, 60))
    picture.save(tmp_path / "a.png")
    assert load_image(tmp_path / "a.png").shape[2] == 4
    middle = read_reference(tmp_path / "a.png").image[128, 128]
    torch.testing.assert_close(middle, torch.full((3,), 100 / 255), rtol=0, atol=1e-6)


def test_cutting_out_takes_rembg(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rembg", None)
    with pytest.raises(ImportError, match=r"--cut-out takes rembg: pip install .* or give --mask"):
        read_reference(torch.rand(64, 64, 3), options=PictureOptions(cut_out=True))
    with pytest.raises(ValueError, match="each tells where the object is"):
        PictureOptions(cut_out=True, background="white")


def test_an_object_is_cut_out_by_rembg(tmp_path, monkeypatch):
    red_network(tmp_path, monkeypatch)
    picture = torch.rand(200, 300, 3, generator=torch.Generator().manual_seed(0)) * torch.tensor([0.0, 1, 1])
    picture[60:140, 100:180] = torch.tensor([1.0, 0, 0])
    cut = read_reference(picture, 100, PictureOptions(cut_out=True, frame="picture"))
    # Rows of 300 pixels are 100 here, and the picture is in the middle.
    inside = torch.zeros(100, 100)
    inside[37:63, 34:60] = 1
    # At most a pixel beside each border.
    assert ((cut.alpha > 0.5).float() - inside).abs().sum() <= 4 * 27
    assert cut.alpha[45:55, 40:52].min() > 0.95
    assert cut.alpha[:30].max() < 0.05
