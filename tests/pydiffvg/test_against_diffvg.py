"""Pictures and gradients next to DiffVG's own, of 16 x 16 samples a pixel, drawn by benchmarks/diffvg_truth.py."""

from pathlib import Path

import numpy as np
import pytest
import torch
from diffvg_scenes import SCENES, draw, scene
from scene_gradients import DIFFERENCE_SCENES, GRADIENT_SCENES, gradients

from diff3ds import pydiffvg

FOLDER = Path(__file__).parent
# Differences in the mean over all pixels and channels; in pixels that no edge crosses; in any pixel.
MEAN, INSIDE, ANYWHERE = 0.004, 0.02, 0.03
# DiffVG draws no strokes of ellipses.
MISSED_BY_DIFFVG = {"ellipse's stroke"}
# Where edges of several layers cross in one pixel, their coverages count as independent.
CROSSED = 0.25
CROSSING_EDGES = {
    "canvas of other proportions",
    "gradients on a wide picture",
    "mirrored shapes",
    "order of groups",
    "random strokes",
    "shared edge",
    "strokes of gradients",
    "translucent background",
    "translucent strokes",
}
# Gradients of colours count as they are in the middle of a pixel: off where all of one lies within a few pixels.
STEEP = 0.03
STEEP_COLORS = {"radial, three stops", "radial and shear"}


@pytest.fixture(scope="module")
def pictures() -> dict[str, np.ndarray]:
    return dict(np.load(FOLDER / "diffvg_pictures.npz"))


@pytest.fixture(scope="module")
def diffvg_gradients() -> dict[str, np.ndarray]:
    return dict(np.load(FOLDER / "diffvg_gradients.npz"))


@pytest.mark.parametrize("name", sorted(SCENES.keys() - MISSED_BY_DIFFVG))
def test_pictures_are_those_of_diffvg(name: str, pictures: dict[str, np.ndarray]) -> None:
    drawn = draw(pydiffvg, scene(pydiffvg, name)).detach()
    truth = torch.from_numpy(pictures[f"{name}: picture"]).float()
    assert drawn.shape == truth.shape
    inside = np.unpackbits(pictures[f"{name}: inside"], count=truth[..., 0].numel()).astype(bool)
    off = (drawn - truth).abs()
    assert off.mean() < MEAN
    assert off.view(-1, 4)[torch.from_numpy(inside)].max() < (STEEP if name in STEEP_COLORS else INSIDE)
    assert off.max() < (CROSSED if name in CROSSING_EDGES else ANYWHERE)


def test_what_diffvg_misses_is_drawn() -> None:
    drawn = draw(pydiffvg, scene(pydiffvg, "ellipse's stroke"))
    # By Ramanujan's perimeter of an ellipse, whose curvature nowhere exceeds the half width's inverse.
    a, b, half_width = 19.0, 9.5, 2.0
    h = ((a - b) / (a + b)) ** 2
    perimeter = torch.pi * (a + b) * (1 + 3 * h / (10 + (4 - 3 * h) ** 0.5))
    assert drawn[..., 3].sum().item() == pytest.approx(2 * half_width * perimeter, rel=1e-3)


# What is wrong in DiffVG's gradients: to the last stop of radial gradients of colours it adds those of all others; of
# a background it keeps one sample's.
WRONG_IN_DIFFVG = {"group 0 fill_color stop_colors", "background"}
WRONG_SCENES = {"radial, three stops", "opaque background"}
# Of the length of a leaf's gradient, beside four standard errors of the mean over DiffVG's seeds.
GRADIENT = 0.02


@pytest.mark.parametrize("name", GRADIENT_SCENES)
def test_gradients_are_those_of_diffvg(name: str, diffvg_gradients: dict[str, np.ndarray]) -> None:
    """Of fills: those that DiffVG has of strokes are not the derivatives of its own pictures."""
    compared = 0
    for leaf, gradient in gradients(pydiffvg, name).items():
        if leaf in WRONG_IN_DIFFVG and name in WRONG_SCENES:
            continue
        mean, error = (torch.from_numpy(diffvg_gradients[f"{name}: {leaf}: {what}"]) for what in ("mean", "error"))
        if leaf.endswith("shape_to_canvas"):
            # The last row stays 0, 0, 1.
            gradient, mean, error = gradient[:2], mean[:2], error[:2]
        assert (gradient - mean).norm() < GRADIENT * mean.norm() + 4 * error.norm() + 1e-6, leaf
        compared += 1
    assert compared >= 3


# Of the length of a leaf's gradient: the noise of samples and the bend of the picture within the step.
DIFFERENCE = 0.08


@pytest.mark.parametrize("name", DIFFERENCE_SCENES)
def test_gradients_are_the_differences_of_pictures_by_diffvg(
    name: str, diffvg_gradients: dict[str, np.ndarray]
) -> None:
    ours = gradients(pydiffvg, name)
    ending = ": difference"
    leaves = [
        key[len(name) + 2 : -len(ending)]
        for key in diffvg_gradients
        if key.startswith(f"{name}: ") and key.endswith(ending)
    ]
    assert leaves
    for leaf in leaves:
        truth = torch.from_numpy(diffvg_gradients[f"{name}: {leaf}{ending}"])
        gradient = ours.get(leaf, torch.zeros_like(truth))
        assert (gradient - truth).norm() <= DIFFERENCE * truth.norm(), leaf
