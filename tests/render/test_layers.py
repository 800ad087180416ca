"""Order in depth, blending and backgrounds."""

import numpy as np
import pytest
import torch
from oracles import curve_points, distances
from scenes import draw, strokes_at, tracked

from diff3ds import render
from diff3ds.library.crossing import crossing_cameras, crossing_strokes
from diff3ds.project import project
from diff3ds.render.checks import canvas_from


def crossings(cubic: np.ndarray, other: np.ndarray) -> list[tuple[np.ndarray, bool]]:
    """Places on the screen where a curve meets another, and whether it passes in front."""
    position, depth = curve_points(cubic)
    gap, other_depth = distances(other, position)
    closest = (gap < 0.1) & (gap <= np.roll(gap, 1)) & (gap <= np.roll(gap, -1))
    found = []
    for i in closest.nonzero()[0]:
        if not found or np.linalg.norm(found[-1][0] - position[i]) > 5:
            found.append((position[i], bool(depth[i] < other_depth[i])))
    return found


def test_crossing_strokes_change_their_order(backend, antialiasing):
    """The paper's figure: each curve passes the line twice, once in front and once behind."""
    sketch, cameras = crossing_strokes(), crossing_cameras((210, 300))
    image = render(sketch, cameras, backend=backend, antialiasing=antialiasing).color[0]
    strokes = project(sketch, cameras)
    cubics = strokes.cubics[0].numpy()
    for curve in range(3):
        places = crossings(cubics[curve], cubics[3])
        assert sorted(front for _, front in places) == [False, True]
        for place, _ in places:
            pixel = np.floor(place) + 0.5
            # Of the strokes that cover the pixel whole (the curves lie close together there), the nearest.
            seen = [distances(c, pixel[None]) for c in cubics]
            over = [n for n, (d, _) in enumerate(seen) if d[0] < strokes.half_width[0, n] - 0.71]
            nearest = min(over, key=lambda n: seen[n][1][0])
            x, y = pixel.astype(int)
            assert (image[y, x] - sketch.color[nearest]).abs().max() < 1e-5


def test_ties_go_to_the_last_stroke_even_if_the_other_begins_nearer(backend):
    """The same curve twice; the wide one covers pixels beyond the near end too, so all in all it is the nearer one."""
    curve = [[5.45, 8.5], [13.0, 8.5]]
    strokes = strokes_at(
        [curve, curve], half_width=[[3.0, 0.1]], depth=[[1.0, 2.0], [1.0, 2.0]], color=[[0, 0, 1.0], [1.0, 0, 0]]
    )
    row = draw(strokes, 16, backend).color[0, 8]
    # Coverage of a line .2 px wide through pixel centres, over the opaque one.
    expected = torch.tensor([0.2, 0, 0.8], dtype=torch.float64).expand(7, 3)
    torch.testing.assert_close(row[5:12], expected, rtol=0, atol=1e-6)
    torch.testing.assert_close(row[3], torch.tensor([0, 0, 1.0], dtype=torch.float64))


def test_order_changes_along_a_crossing_in_depth(backend, antialiasing):
    """Two lines on the same place, that pass each other in depth in the middle."""
    line = [[4.0, 16.0], [28.0, 16.0]]
    strokes = strokes_at([line, line], depth=[[1.0, 3.0], [3.0, 1.0]], half_width=2.0, color=[[1.0, 0, 0], [0, 1.0, 0]])
    row = draw(strokes, 32, backend, antialiasing, background=0.0).color[0, 15, 5:27]
    expected = torch.zeros(22, 3).double()
    expected[:11, 0] = expected[11:, 1] = 1
    torch.testing.assert_close(row, expected, rtol=0, atol=1e-6)


def test_ties_go_to_the_higher_index(backend, antialiasing):
    line = torch.tensor([[3.0, 5.0], [28.0, 23.0]]).expand(3, 2, 2)
    colors = torch.eye(3).double()
    order = torch.tensor([2, 0, 1])
    strokes = strokes_at(line, half_width=2.0, color=colors[order])
    image = draw(strokes, 32, backend, antialiasing, background=0.0)
    inked = image.alpha[0] == 1
    assert inked.sum() > 50
    assert (image.color[0][inked] == colors[1]).all()


@pytest.mark.parametrize("count", [40, 600])
def test_ties_of_many_go_to_the_higher_index(backend, count):
    """In lists of which each kernel has its own way to sort them."""
    line = torch.tensor([[-3.0, 0.4], [4.0, 0.6]]).expand(count, 2, 2)
    color = torch.rand(count, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    strokes = strokes_at(line, half_width=50.0, color=color, opacity=0.05)
    image = draw(strokes, 1, backend, background=0.3)
    front = 0.05 * 0.95 ** torch.arange(count - 1, -1, -1, dtype=torch.float64)
    expected = front @ color + 0.3 * 0.95**count
    torch.testing.assert_close(image.color[0, 0, 0], expected, rtol=1e-12, atol=0)


def test_the_outline_of_what_lies_below_at_the_same_depth_is_no_outline(kernels):
    """Two dots at one place, the later one larger: samples say that only that one grows the ink."""
    strokes = strokes_at([[[16.0, 16.0]] * 2] * 2, half_width=[[4.0, 9.0]], color=[[1.0, 0, 0], [0, 0, 1.0]])
    (widths,) = tracked(strokes, "half_width")
    image = draw(strokes, 32, kernels, "montecarlo", samples=16, background=0.0)
    gradient = torch.autograd.grad(image.color.sum(), widths)[0][0]
    assert gradient[0] == 0
    assert gradient[1].item() == pytest.approx(2 * torch.pi * 9, rel=0.02)


def test_many_strokes_over_one_pixel(backend, antialiasing):
    """alpha = 1 - prod(1 - a), d alpha / d a_i = the product of the others: 300 of them, no list is cut short."""
    generator = torch.Generator().manual_seed(0)
    opacity = 0.02 * torch.rand(300, generator=generator, dtype=torch.float64)
    depth = 1 + torch.rand(300, generator=generator, dtype=torch.float64)
    color = torch.rand(300, 3, generator=generator, dtype=torch.float64)
    line = torch.tensor([[-3.0, 0.4], [4.0, 0.6]]).expand(300, 2, 2)
    strokes = strokes_at(line, half_width=5.0, depth=depth[:, None], color=color, opacity=opacity)
    tensors = tracked(strokes, "color", "opacity")
    image = draw(strokes, 1, backend, antialiasing, background=0.3, samples=4)
    order = depth.argsort()
    clear = (1 - opacity[order]).cumprod(0)
    front = torch.cat([torch.ones(1).double(), clear[:-1]]) * opacity[order]
    assert image.alpha.item() == pytest.approx(1 - clear[-1].item(), rel=1e-12)
    expected = front @ color[order] + 0.3 * clear[-1]
    torch.testing.assert_close(image.color[0, 0, 0].detach(), expected, rtol=1e-12, atol=0)
    assert image.depth.item() == pytest.approx((front @ depth[order] / front.sum()).item(), rel=1e-9)
    gradient = torch.autograd.grad(image.alpha.sum(), tensors[1], retain_graph=True)[0]
    torch.testing.assert_close(gradient, clear[-1] / (1 - opacity), rtol=1e-10, atol=0)
    gradient = torch.autograd.grad(image.color.sum(), tensors[0])[0]
    torch.testing.assert_close(gradient[order], front[:, None].expand(-1, 3), rtol=1e-10, atol=0)


def test_backgrounds(backend, antialiasing):
    """Number, RGB, image and one a view: color = ink + (1 - alpha) background, and its gradient is what shows."""
    bend = strokes_at([[[4.0, 20.0], [10.0, 2.0], [20.0, 8.0]]], half_width=2.0, opacity=0.6, color=0.2)
    strokes = type(bend)(bend.cubics.expand(2, -1, -1, -1), bend.half_width, bend.color, bend.opacity)
    size = (20, 24)
    # Any number does: all pictures have the same samples.
    generator = torch.Generator().manual_seed(0)
    black = draw(strokes, size, backend, antialiasing, background=0.0, samples=4)
    upstream = torch.rand(2, *size, 3, generator=generator, dtype=torch.float64)
    shared = [(), (3,), (1, 1, 3), (20, 1, 3), (1, 24, 3), (*size, 3), (*size, 1)]
    for shape in [*shared, (2, 1, 1, 3), (2, 20, 1, 3), (2, 1, 24, 3), (2, *size, 3)]:
        background = torch.rand(shape, generator=generator, dtype=torch.float64).requires_grad_()
        image = draw(strokes, size, backend, antialiasing, background=background, samples=4)
        clear = (1 - black.alpha)[..., None]
        torch.testing.assert_close(image.color, black.color + clear * background, rtol=0, atol=1e-12)
        (image.color * upstream).sum().backward()
        expected = (clear * upstream).sum_to_size(shape) if shape else (clear * upstream).sum()
        torch.testing.assert_close(background.grad, expected, rtol=1e-10, atol=1e-12)
    white, gray = (draw(strokes, size, backend, antialiasing, background=b, samples=4) for b in ([1, 1, 1], 0.5))
    torch.testing.assert_close(white.color - black.color, 2 * (gray.color - black.color), rtol=0, atol=1e-12)


def test_gray_background_first_used_in_inference_mode(backend):
    """What is kept of it still serves drawings with gradients."""
    strokes = strokes_at([[[4.0, 20.0], [10.0, 2.0], [20.0, 8.0]]], half_width=2.0)
    with torch.inference_mode():
        seen = draw(strokes, 24, backend, background=0.8125)
    opacity = tracked(strokes, "opacity")[0]
    image = draw(strokes, 24, backend, background=0.8125)
    assert torch.equal(image.color.detach(), seen.color)
    image.color.sum().backward()
    assert opacity.grad.abs().sum() > 0


@pytest.mark.parametrize("numbers", [[0.2, 1, 0.9], (0.1,), [0.3, 0.3, 1e30]])
def test_backgrounds_of_numbers(numbers, monkeypatch):
    """They are the tensor of these, written where the strokes are: nothing is copied there, which would wait."""
    like = torch.zeros(1)
    expected = canvas_from(torch.tensor(numbers), like, (2, 3, 3, 3))
    monkeypatch.setattr(torch, "as_tensor", None)
    got = canvas_from(numbers, like, (2, 3, 3, 3))
    assert got.dtype == torch.float32
    assert torch.equal(got, expected)


def test_translucent_pair(backend, antialiasing):
    """Front times opacity, and what is behind through the rest, at pixels inside both."""
    lines = [[[2.0, 8.0], [30.0, 8.0]], [[8.0, 2.0], [8.0, 30.0]]]
    strokes = strokes_at(lines, half_width=3.0, depth=[[2.0], [1.0]], opacity=[0.5, 0.25], color=[[1.0] * 3, [0.0] * 3])
    image = draw(strokes, 32, backend, antialiasing, background=0.0)
    assert image.color[0, 7, 7, 0].item() == pytest.approx(0.75 * 0.5, abs=1e-6)
    assert image.alpha[0, 7, 7].item() == pytest.approx(1 - 0.75 * 0.5, abs=1e-6)
    assert image.depth[0, 7, 7].item() == pytest.approx((0.25 * 1 + 0.375 * 2) / 0.625, abs=1e-6)
