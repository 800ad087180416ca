"""The reference's analytic gradients against finite differences, in float64."""

import pytest
import torch
from scenes import TENSORS, strokes_at
from test_agreement import leaves, scene

from diff3ds import Analytic, Cameras, Sketch, render
from diff3ds.render import rasterize
from diff3ds.render.reference import coverage

STEP = 1e-7
SIZE = (24, 32)


@pytest.mark.parametrize(
    ("seed", "width_space", "blur", "output"),
    [
        pytest.param(0, "image", 0.0, "color", marks=pytest.mark.slow),
        (1, "world", 0.0, "depth"),
        pytest.param(2, "world", 1.0, "alpha", marks=pytest.mark.slow),
        pytest.param(0, "image", 0.0, "alpha", marks=pytest.mark.slow),
        pytest.param(0, "image", 0.0, "depth", marks=pytest.mark.slow),
        pytest.param(1, "world", 0.0, "color", marks=pytest.mark.slow),
        pytest.param(1, "world", 0.0, "alpha", marks=pytest.mark.slow),
        pytest.param(2, "world", 1.0, "color", marks=pytest.mark.slow),
        pytest.param(2, "world", 1.0, "depth", marks=pytest.mark.slow),
    ],
)
def test_every_input(seed, width_space, blur, output):
    """Along a random direction of each input in turn.

    Away from kinks by the smallness of the step: within 1e-7 of an input no pixel of these scenes passes a corner of
    the box, changes its closest point or the order of its hits; each would show as an error far above the tolerance.
    Pixels with hardly any ink are left out of the depth, a quotient by it.
    """
    sketch, cameras = scene(seed, 4, width_space, size=SIZE)
    background = torch.full((3,), 0.4, dtype=torch.float64, requires_grad=True)
    g = torch.Generator().manual_seed(seed)
    names = leaves(sketch, cameras, background)
    upstream = torch.randn(2, *SIZE, *([3] if output == "color" else []), generator=g, dtype=torch.float64)

    def loss(values: dict[str, torch.Tensor]) -> torch.Tensor:
        stroke = Sketch(*(values[n] for n in sketch.tensors()), width_space=width_space)
        views = Cameras(values["world_to_camera"], values["intrinsics"], SIZE)
        image = render(stroke, views, background=values["background"], antialiasing=Analytic(blur), backend="reference")
        inked = image.alpha.detach() > 0.05
        return (getattr(image, output) * upstream * (inked[..., None] if output == "color" else inked)).sum()

    gradients = torch.autograd.grad(loss(names), list(names.values()), allow_unused=True)
    for (name, value), gradient in zip(names.items(), gradients, strict=True):
        direction = torch.randn(value.shape, generator=g, dtype=torch.float64)
        if name == "world_to_camera":
            direction[:, 3] = 0
        if name == "intrinsics":
            direction[:, 2] = 0
        with torch.no_grad():
            more, less = (loss({**names, name: value + s * STEP * direction}).item() for s in (1, -1))
        slope = (more - less) / (2 * STEP)
        got = 0.0 if gradient is None else (gradient * direction).sum().item()
        # Differences of sums of about 100 have 1e-14 / 1e-7 of rounding.
        assert got == pytest.approx(slope, rel=1e-5, abs=1e-5), name


@pytest.mark.parametrize("width_space", ["image", pytest.param("world", marks=pytest.mark.slow)])
def test_gradcheck(width_space):
    """With a blur the picture is smooth; a slanted stroke, and a bend in front of it, around 8 pixels."""
    lines = [[[0.0, 1.5], [1.0, 1.9], [2.5, 1.0], [4.2, 1.1]], [[0.5, -1.0], [1.5, 3.0], [2.5, 3.0], [3.7, -0.6]]]
    strokes = strokes_at(
        lines, depth=[[1.0, 1.1, 1.2, 1.4], [2.0, 2.2, 2.3, 2.1]], half_width=[0.9, 0.6], color=0.3, opacity=0.7
    )
    tensors = [getattr(strokes, name).requires_grad_() for name in TENSORS]
    background = torch.tensor([0.2, 0.5, 0.9], dtype=torch.float64, requires_grad=True)

    def images(*values: torch.Tensor) -> tuple[torch.Tensor, ...]:
        image = rasterize(
            type(strokes)(*values[:4], width_space),
            (2, 4),
            background=values[4],
            antialiasing=Analytic(1.0),
            backend="reference",
        )
        return image.color, image.alpha, image.depth

    assert torch.autograd.gradcheck(images, (*tensors, background), eps=1e-7, atol=1e-5, rtol=1e-5, fast_mode=True)


def test_coverage_formula():
    """Gradient of the filters away from the corners of the box."""
    distance = torch.tensor([0.1, 0.9, 1.4, 2.3, 0.35], dtype=torch.float64, requires_grad=True)
    half_width = torch.tensor([1.2, 1.2, 1.2, 1.2, 0.2], dtype=torch.float64, requires_grad=True)
    for blur in (0.0, 0.4, 2.0):
        assert torch.autograd.gradcheck(lambda d, r, b=blur: coverage(d, r, b), (distance, half_width))


def test_blur_is_continuous_where_it_is_cut():
    """At 3.5 sigma beyond the edge nothing is left, and far inside a thick stroke nothing lacks."""
    from diff3ds.render.reference import reach

    for blur in (0.3, 2.0):
        edge = torch.tensor([5.0 + reach(blur) - 1e-9, 5.0 + reach(blur) + 1e-9, 0.0], dtype=torch.float64)
        values = coverage(edge, torch.full_like(edge, 5.0 if blur < 1 else 9.0) - (0.0 if blur < 1 else 4.0), blur)
        assert values[:2].max() < 1e-10
    assert coverage(torch.zeros(1).double(), torch.full((1,), 50.0).double(), 2.0).item() == 1
