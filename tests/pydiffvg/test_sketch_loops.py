"""Loops of optimisation in the forms that programs written for DiffVG have: each comes nearer to its picture."""

import math

import pytest
import torch
from torch import Tensor

from diff3ds import pydiffvg

SIZE = 64
STEPS = 20


def render(shapes: list, groups: list, seed: int = 0) -> Tensor:
    """A picture over white, (1, 3, SIZE, SIZE), as those programs make it of what is drawn."""
    arguments = pydiffvg.RenderFunction.serialize_scene(SIZE, SIZE, shapes, groups)
    drawn = pydiffvg.RenderFunction.apply(SIZE, SIZE, 2, 2, seed, None, *arguments)
    opacity = drawn[:, :, 3:4]
    white = torch.ones(SIZE, SIZE, 3, device=pydiffvg.get_device())
    return (opacity * drawn[:, :, :3] + white * (1 - opacity)).unsqueeze(0).permute(0, 3, 1, 2)


def target() -> Tensor:
    """A ring."""
    y, x = torch.meshgrid(torch.arange(SIZE) + 0.5, torch.arange(SIZE) + 0.5, indexing="ij")
    return ((x - 32).hypot(y - 32) - 18).abs().sub(2).clamp(0, 1).expand(1, 3, SIZE, SIZE)


def loss(picture: Tensor) -> Tensor:
    """Of pixels, and of blocks, which strokes feel from afar."""
    blocks = torch.nn.functional.avg_pool2d
    return (picture - target()).square().mean() + (blocks(picture, 8) - blocks(target(), 8)).square().mean()


def cubic(generator: torch.Generator, segments: int = 1) -> Tensor:
    """Control points that wander from somewhere near the ring."""
    angle = 2 * math.pi * torch.rand((), generator=generator)
    start = 32 + 18 * torch.stack([angle.cos(), angle.sin()])
    steps = 6 * (torch.rand(3 * segments, 2, generator=generator) - 0.5)
    return torch.cat([start[None], start + steps.cumsum(0)])


def descend(parameters: list[Tensor], rate: float, picture) -> tuple[float, float]:
    """The loss before and after steps of Adam."""
    optimizer = torch.optim.Adam(parameters, lr=rate)
    losses = []
    for _ in range(STEPS):
        optimizer.zero_grad()
        value = loss(picture())
        value.backward()
        optimizer.step()
        losses.append(value.item())
    return losses[0], losses[-1]


@pytest.fixture
def generator() -> torch.Generator:
    pydiffvg.set_use_gpu(False)
    return torch.Generator().manual_seed(0)


def test_points_that_ask_for_gradients_later(generator):
    """Leaves of points, moved by `.data` too; black; then other strokes join those of a file."""
    shapes, groups = [], []
    for i in range(8):
        inner = torch.zeros(1, dtype=torch.int32) + 2
        shapes.append(
            pydiffvg.Path(
                num_control_points=inner, points=cubic(generator), stroke_width=torch.tensor(1.5), is_closed=False
            )
        )
        groups.append(
            pydiffvg.ShapeGroup(
                shape_ids=torch.tensor([i]), fill_color=None, stroke_color=torch.tensor([0.0, 0.0, 0.0, 1.0])
            )
        )
    for path in shapes:
        path.points.requires_grad = True

    def picture() -> Tensor:
        for path in shapes:
            path.points.data.add_(0.05 * torch.randn(path.points.shape, generator=generator))
        return render(shapes, groups)

    before, after = descend([path.points for path in shapes], 1.0, picture)
    assert after < 0.9 * before


def test_opacities_of_strokes_from_a_file(generator, tmp_path):
    """Strokes of an SVG file whose colours are leaves, clamped in place, are pruned by their opacity."""
    width, file = SIZE, str(tmp_path / "strokes.svg")
    shapes = [pydiffvg.Path(torch.tensor([2]), cubic(generator), False, torch.tensor(1.5)) for _ in range(8)]
    black = torch.tensor([0.0, 0.0, 0.0, 1.0])
    groups = [pydiffvg.ShapeGroup(torch.tensor([i]), None, stroke_color=black.clone()) for i in range(8)]
    pydiffvg.save_svg(file, width, width, shapes, groups)
    width, height, shapes, groups = pydiffvg.svg_to_scene(file)
    assert (width, height, len(shapes)) == (SIZE, SIZE, 8)
    for path, group in zip(shapes, groups, strict=True):
        path.points.requires_grad = True
        group.stroke_color.requires_grad = True

    def picture() -> Tensor:
        for group in groups:
            group.stroke_color.data[:3].clamp_(0.0, 0.0)
            group.stroke_color.data[-1].clamp_(0.0, 1.0)
        return render(shapes, groups)

    before, after = descend(
        [t for p, g in zip(shapes, groups, strict=True) for t in (p.points, g.stroke_color)], 0.2, picture
    )
    assert after < before
    assert all(group.stroke_color[:3].detach().abs().max() < 0.3 for group in groups)
    for group in groups:
        group.stroke_color.data[-1] = (group.stroke_color.data[-1] >= 0.5).float()
    render(shapes, groups)


def test_points_and_widths_from_networks(generator):
    """All shapes anew in each step, of tensors with a history; widths (1,) and (); colours of whole numbers."""
    start = torch.stack([cubic(generator) for _ in range(8)]) / SIZE
    torch.manual_seed(0)
    net, widths = torch.nn.Linear(8, 8), torch.nn.Linear(8, 8)

    def picture() -> Tensor:
        points = SIZE * (start + 0.2 * net(start.view(8, 8)).view(8, 4, 2).tanh())[None]
        half_widths = 2 * widths(torch.ones(8)).sigmoid()
        shapes, groups = [], []
        for i in range(8):
            half_width = half_widths[i] if i % 2 else half_widths[i : i + 1]
            shapes.append(pydiffvg.Path(torch.tensor([2]), points[:, i].reshape(-1, 2), False, half_width))
            groups.append(pydiffvg.ShapeGroup(torch.tensor([i]), None, stroke_color=torch.tensor([0, 0, 0, 1])))
        return render(shapes, groups)

    before, after = descend([*net.parameters(), *widths.parameters()], 0.02, picture)
    assert after < before


def test_projections_of_points_in_space(generator):
    """Points of a path are replaced by a projection in each step; numbers of shapes are floats; colours are clamped."""
    space = [torch.cat([cubic(generator) / SIZE - 0.5, torch.zeros(4, 1)], 1).requires_grad_() for _ in range(8)]
    paths = [
        pydiffvg.Path(torch.tensor([2], dtype=torch.int32), torch.zeros(4, 2), False, torch.tensor(1.5)) for _ in space
    ]
    groups = [
        pydiffvg.ShapeGroup(torch.Tensor([i]), None, stroke_color=torch.Tensor([0.2, 0.0, 0.0, 1.0])) for i in range(8)
    ]
    for group in groups:
        group.stroke_color.requires_grad = True

    def picture() -> Tensor:
        for points, path, group in zip(space, paths, groups, strict=True):
            path.points = (SIZE * (points[:, :2] / (1 + points[:, 2:]) + 0.5)).contiguous()
            group.stroke_color.data[:3].clamp_(0.0, 1.0)
        return render(paths, groups)

    before, after = descend([*space, *(group.stroke_color for group in groups)], 0.01, picture)
    assert after < before


def test_points_widths_and_colours_as_leaves(generator):
    """Long strokes in any colour, widths clamped in place, another seed in each step."""
    shapes = [pydiffvg.Path(torch.tensor([2] * 3), cubic(generator, 3), False, torch.tensor(1.0)) for _ in range(8)]
    colors = [torch.rand(4, generator=generator) for _ in shapes]
    groups = [pydiffvg.ShapeGroup(torch.tensor([i]), None, stroke_color=color) for i, color in enumerate(colors)]
    for path, color in zip(shapes, colors, strict=True):
        path.points.requires_grad = path.stroke_width.requires_grad = color.requires_grad = True
    seeds = iter(range(STEPS))

    def picture() -> Tensor:
        for path, color in zip(shapes, colors, strict=True):
            path.stroke_width.data.clamp_(1.0, 3.0)
            color.data.clamp_(0.0, 1.0)
        return render(shapes, groups, next(seeds))

    leaves = [t for path, color in zip(shapes, colors, strict=True) for t in (path.points, path.stroke_width, color)]
    before, after = descend(leaves, 0.1, picture)
    assert after < before
    assert all(leaf.grad.isfinite().all() for leaf in leaves)


def test_filled_shapes(generator):
    """Closed paths of LongTensors with strokes of no width, over a background that is a leaf."""
    angles = torch.arange(12) * (2 * math.pi / 12)
    circle = torch.stack([angles.cos(), angles.sin()], 1)
    shapes, groups = [], []
    for i in range(6):
        points = 6 * circle + cubic(generator)[:1]
        shapes.append(pydiffvg.Path(torch.LongTensor([2] * 4), points, stroke_width=torch.tensor(0.0), is_closed=True))
        color = torch.FloatTensor([*torch.rand(3, generator=generator).tolist(), 1.0])
        groups.append(pydiffvg.ShapeGroup(shape_ids=torch.tensor([i]), fill_color=color, stroke_color=None))
    for path, group in zip(shapes, groups, strict=True):
        path.points.requires_grad = group.fill_color.requires_grad = True
    paper = torch.ones(3, requires_grad=True)

    def picture() -> Tensor:
        for group in groups:
            group.fill_color.data.clamp_(0.0, 1.0)
        arguments = pydiffvg.RenderFunction.serialize_scene(SIZE, SIZE, shapes, groups)
        drawn = pydiffvg.RenderFunction.apply(SIZE, SIZE, 2, 2, 0, None, *arguments)
        return (drawn[:, :, 3:4] * drawn[:, :, :3] + paper * (1 - drawn[:, :, 3:4])).unsqueeze(0).permute(0, 3, 1, 2)

    leaves = [t for path, group in zip(shapes, groups, strict=True) for t in (path.points, group.fill_color)]
    before, after = descend([*leaves, paper], 0.1, picture)
    assert after < before
