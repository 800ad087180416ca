"""Sketches of coloured pictures have their colours (`PictureColors`); others stay black."""

import numpy as np
import pytest
import torch
from PIL import Image, ImageDraw

import diff3ds as ds
from diff3ds.cli import main
from diff3ds.pictures.reference_picture import read_reference
from diff3ds.recognition.picture_colors import LIGHTEST, LUMA, PictureColors
from diff3ds.recognition.picture_lines import Lines, lines_of
from diff3ds.recognition.side_seen import PlacedLines

RED, BLUE = (220, 30, 30), (30, 60, 200)
CAMERA = ds.orbit(0.0, 0.0, 2.0, fov=60.0, size=100)


def pictured(roof, walls, wide=5, size=300) -> torch.Tensor:
    """A house from the front, in lines of two colours."""
    image = Image.new("RGB", (size, size), "white")
    pen = ImageDraw.Draw(image)
    pen.line(((60, 140), (60, 270), (240, 270), (240, 140)), walls, wide)
    pen.line(((45, 140), (150, 40), (255, 140), (45, 140)), roof, wide)
    return torch.from_numpy(np.asarray(image, np.float32) / 255)


def placed(colors) -> PlacedLines:
    """Two level lines, one above the other, of these colours."""
    x = np.linspace(-0.5, 0.5, 50)
    points = np.concatenate([np.stack([x, np.full(50, y)], 1) for y in (-0.2, 0.2)])
    of_points = np.repeat(np.array(colors, float), 50, 0)
    return PlacedLines(Lines(points, np.zeros_like(points), "drawing", of_points), CAMERA, 0.8, (0.5, 0.5))


def level(*heights: float) -> ds.Sketch:
    """Straight strokes from left to right, a little shorter than the lines."""
    ends = torch.tensor([[[0.0, -0.5, z], [0.0, 0.5, z]] for z in heights])
    return ds.Sketch(ends)


def test_strokes_take_the_colour_of_the_line_that_they_lie_on():
    colors = [[0.9, 0.1, 0.1], [0.1, 0.2, 0.8]]
    painted = PictureColors.of(placed(colors))(level(0.3, -0.3, 0.5))
    torch.testing.assert_close(painted.color, torch.tensor([colors[0], colors[1], colors[0]]))


def test_a_stroke_of_several_segments_has_one_colour():
    corners = torch.tensor([[0.0, -0.5, -0.3], [0.0, 0.5, -0.3], [0.0, -0.5, -0.32], [0.0, -0.5, 0.3]])
    chained = ds.Sketch(
        torch.stack([corners[:-1], corners[1:]], 1), color=torch.zeros(1, 3), chains=ds.Chains.of([3], [False])
    )
    painted = PictureColors.of(placed([[0.9, 0.1, 0.1], [0.1, 0.2, 0.8]]))(chained)
    torch.testing.assert_close(painted.color, torch.tensor([[0.1, 0.2, 0.8]]))


def test_what_would_not_be_seen_on_white_is_darker():
    pale = torch.tensor([1.0, 1.0, 0.6])
    painted = PictureColors.of(placed([pale, pale]))(level(0.3)).color[0]
    # The same hue.
    torch.testing.assert_close(painted / painted[0], pale)
    assert painted @ torch.tensor(LUMA) == pytest.approx(LIGHTEST)


def test_gray_lines_are_no_colours():
    assert PictureColors.of(placed([[0, 0, 0], [0.4, 0.4, 0.45]])) is None


def test_lines_of_a_picture_have_its_colours():
    lines = lines_of(read_reference(pictured(RED, BLUE, wide=3)))
    # Away from where they meet.
    for part, color in ((lines.points[:, 1] < -0.1, RED), (lines.points[:, 1] > 0.2, BLUE)):
        assert part.sum() > 50
        np.testing.assert_allclose(
            lines.colors[part], np.broadcast_to(np.array(color) / 255, (part.sum(), 3)), atol=0.03
        )


@pytest.mark.usefixtures("few_members")
def test_the_sketch_of_a_coloured_drawing_has_its_colours(tmp_path):
    path = tmp_path / "house.png"
    common = ["--shows", "a house", "--steps", "2", "--sheet-every", "0", "--quiet", "--overwrite", "-o", str(tmp_path)]
    colors = {}
    for name, picture in (("colored", pictured(RED, BLUE)), ("black", pictured((0, 0, 0), (0, 0, 0)))):
        Image.fromarray((picture * 255).round().byte().numpy()).save(path)
        main(["image", str(path), *common])
        colors[name] = ds.load(tmp_path / "sketch.json").color
    assert torch.equal(colors["black"], torch.zeros_like(colors["black"]))
    wanted = torch.tensor([RED, BLUE]) / 255
    away = (colors["colored"][:, None] - wanted).abs().amax(-1).amin(1)
    assert (away < 0.05).float().mean() > 0.9
    # A colour that is asked for comes first.
    main(["image", str(path), *common[:1], "a green house", *common[2:]])
    green = ds.load(tmp_path / "sketch.json").color
    assert (green[:, 1] > green[:, 0]).all()
