"""Lines of pictures: circles of known radius, drawn in all ways; edges of photographs; framing; errors."""

import numpy as np
import pytest
import torch

from diff3ds.formats import save_png
from diff3ds.pictures.reference_picture import read_reference
from diff3ds.recognition.picture_lines import Lines, lines_of

SIZE = 400
RADIUS, WIDTH = 130.0, 6.0


def distance_to(x: float, y: float) -> torch.Tensor:
    centres = torch.arange(SIZE) + 0.5
    return torch.hypot(centres[None] - x, centres[:, None] - y)


def circle(x=200.0, y=200.0, radius=RADIUS, width=WIDTH) -> torch.Tensor:
    """Ink of a circle."""
    return ((width / 2 - (distance_to(x, y) - radius).abs()) + 0.5).clamp(0, 1)


def on_white(ink: torch.Tensor) -> torch.Tensor:
    return (1 - ink)[..., None].repeat(1, 1, 3)


def read(tmp_path, pixels) -> Lines:
    save_png(tmp_path / "a.png", pixels)
    return lines_of(read_reference(tmp_path / "a.png"))


def is_circle(lines: Lines, outer: float) -> None:
    """The box is that of the centre line, so that its radius is half of it, to a pixel of the reference."""
    radius = np.linalg.norm(lines.points, axis=1)
    pixel = 1 / (200 * RADIUS / outer)
    assert np.abs(radius - 0.5).max() < pixel
    assert np.abs(np.median(radius) - 0.5) < pixel / 3
    # All around, and along the circle.
    turn = np.sort(np.arctan2(lines.points[:, 1], lines.points[:, 0]))
    assert np.diff(turn).max() < 0.1
    along = lines.tangents / np.linalg.norm(lines.tangents, axis=1, keepdims=True)
    assert np.abs((along * lines.points).sum(1) / radius).max() < 0.25
    # The pieces make up the whole, but for pixels of which a line crosses only a corner.
    assert np.linalg.norm(lines.tangents, axis=1).sum() == pytest.approx(np.pi, rel=0.2)


@pytest.mark.parametrize("width", [2.0, 6.0, 14.0, 24.0])
def test_dark_lines_on_white(tmp_path, width):
    lines = read(tmp_path, on_white(circle(width=width)))
    assert lines.kind == "drawing"
    is_circle(lines, RADIUS + width / 2)


def test_light_lines_on_black(tmp_path):
    is_circle(read(tmp_path, 1 - on_white(circle())), RADIUS + WIDTH / 2)


def test_colored_lines_on_colored_paper(tmp_path):
    ink = circle()[..., None]
    is_circle(read(tmp_path, ink * torch.tensor([0.7, 0.1, 0.2]) + (1 - ink) * 0.9), RADIUS + WIDTH / 2)


def test_lines_on_nothing(tmp_path):
    ink = circle()[..., None]
    is_circle(read(tmp_path, torch.cat([torch.zeros(SIZE, SIZE, 3), ink], -1)), RADIUS + WIDTH / 2)


def test_lines_on_paper_that_was_cut_out(tmp_path):
    """The lines are the circle, not the border of the square sheet."""
    pixels = torch.zeros(SIZE, SIZE, 4)
    pixels[30:370, 30:370] = torch.cat([on_white(circle()), torch.ones(SIZE, SIZE, 1)], -1)[30:370, 30:370]
    lines = read(tmp_path, pixels)
    assert lines.kind == "drawing"
    is_circle(lines, 170)


def test_noise_is_no_line(tmp_path):
    generator = torch.Generator().manual_seed(0)
    noisy = on_white(circle()) + 0.08 * torch.randn(SIZE, SIZE, 3, generator=generator)
    radius = np.linalg.norm(read(tmp_path, noisy.clamp(0, 1)).points, axis=1)
    assert np.abs(radius - 0.5).max() < 0.03


def test_specks_are_no_lines(tmp_path):
    lines = read(tmp_path, on_white(torch.maximum(circle(), (distance_to(20.0, 200.0) < 3).float())))
    assert np.abs(np.linalg.norm(lines.points, axis=1) - 0.5).max() < 0.01


def test_edges_of_a_photograph(tmp_path):
    """A shaded ball with a dark dot in its middle: both outlines."""
    distance = distance_to(200.0, 200.0)
    shade = 0.4 + 0.3 * torch.linspace(0, 1, SIZE)[None].expand(SIZE, SIZE)
    shade = torch.where(distance < 40, 0.1, torch.where(distance < RADIUS, shade, 1.0))
    lines = read(tmp_path, shade[..., None].repeat(1, 1, 3))
    assert lines.kind == "photograph"
    radius = np.linalg.norm(lines.points, axis=1)
    outer = radius > 0.3
    np.testing.assert_allclose(radius[outer], 0.5, atol=0.015)
    np.testing.assert_allclose(radius[~outer], 0.5 * 40 / RADIUS, atol=0.015)
    assert 0.2 < (~outer).sum() / outer.sum() < 0.4


def test_place_and_size_do_not_matter(tmp_path):
    one = read(tmp_path, on_white(circle()))
    other = read(tmp_path, on_white(circle(120.0, 290.0, 65.0, 3.0)))
    difference = one.ink(64, 0.05, 0.8) - other.ink(64, 0.05, 0.8)
    assert np.abs(difference).mean() < 0.01


def test_lines_are_drawn_where_they_are_asked_for():
    """A vertical line of 1 at (0.25, 0.5), 4 pixels wide and half as high as the picture: its columns are full."""
    points = np.stack([np.zeros(200), np.linspace(-0.5, 0.5, 200)], 1)
    ink = Lines(points, points).ink(64, 4 / 64, 0.5, (0.25, 0.5))
    assert (ink[20:44, 14:18] > 0.99).all()
    assert ink[20:44].sum(1) == pytest.approx(4.0, abs=0.05)
    assert ink[:13].sum() == ink[51:].sum() == 0


def test_dots_are_no_lines(tmp_path):
    dots = sum((distance_to(50.0 + 100 * i, 60.0 + 90 * i) < 3).float() for i in range(4))
    with pytest.raises(ValueError, match="no lines: give a drawing in lines"):
        read(tmp_path, on_white(dots))
