"""Drawings on paper, as a camera sees them: shadows and grain are no ink, photographs are no drawings."""

import numpy as np
import pytest
import torch

from diff3ds.formats import save_png
from diff3ds.pictures.content.ink import ink_on_paper
from diff3ds.pictures.reference_picture import read_reference
from diff3ds.tasks.recognition.lines import lines_of

SIZE = 400


def distance() -> torch.Tensor:
    centres = torch.arange(SIZE) + 0.5 - SIZE / 2
    return torch.hypot(centres[None], centres[:, None])


def sheet(grain: float = 0.03) -> torch.Tensor:
    """Yellowish paper, half as bright in one corner as in the other."""
    slope = torch.linspace(0, 1, SIZE)
    light = (0.45 + 0.25 * slope[None] + 0.2 * slope[:, None])[..., None] * torch.tensor([1.0, 0.95, 0.85])
    return light + grain * torch.randn(SIZE, SIZE, 3, generator=torch.Generator().manual_seed(0))


def circle(width: float) -> torch.Tensor:
    return ((width / 2 - (distance() - 130).abs()) + 0.5).clamp(0, 1)[..., None]


@pytest.mark.parametrize("width", [3.0, 8.0])
def test_a_photographed_drawing(tmp_path, width):
    """A pencil takes away two thirds of the light; the circle of 130 pixels is found, in the middle of its box."""
    save_png(tmp_path / "a.png", (sheet() * (1 - 0.67 * circle(width))).clamp(0, 1))
    lines = lines_of(read_reference(tmp_path / "a.png"))
    assert lines.kind == "drawing"
    assert np.abs(np.linalg.norm(lines.points, axis=1) - 0.5).max() < 0.015


def test_ink_is_where_the_pencil_was():
    ink = ink_on_paper((sheet() * (1 - 0.67 * circle(6.0))).clamp(0, 1).numpy())
    drawn = circle(6.0)[..., 0].numpy()
    assert ink[drawn == 1].min() > 0.3
    assert ink[np.abs(distance().numpy() - 130) > 8].max() == 0


def test_bare_paper_is_no_drawing():
    assert ink_on_paper(sheet().clamp(0, 1).numpy()) is None


@pytest.mark.parametrize("inside", [0.2, 0.5])
def test_a_thing_on_a_table_is_no_drawing(inside):
    """A disc: an area, however dark."""
    thing = (distance() < 100).float()[..., None]
    assert ink_on_paper((sheet() * (1 - thing) + inside * thing).clamp(0, 1).numpy()) is None


def test_what_goes_on_beyond_the_picture_is_no_drawing():
    """Bars of a fence."""
    bars = (torch.arange(SIZE) % 40 < 6).float()[None, :, None]
    assert ink_on_paper((sheet() * (1 - 0.67 * bars)).clamp(0, 1).numpy()) is None


def test_texture_is_no_drawing():
    chance = torch.rand(SIZE, SIZE, 3, generator=torch.Generator().manual_seed(1))
    assert ink_on_paper(chance.numpy()) is None
