"""Widths in world units where pixels are oblong: fx and fy differ, or the intrinsics have a skew."""

import functools
import math

import pytest
import torch
from scenes import seeded
from test_agreement import assert_close_gradients
from torch.nn.functional import avg_pool2d

from diff3ds import Analytic, Cameras, Chains, MonteCarlo, Sketch, orbit, project, rasterize, render, render_batch

KINDS = {"oblong": (60.0, 20.0, 0.0), "tall": (20.0, 60.0, 0.0), "skewed": (40.0, 30.0, 25.0)}
FRONT = torch.eye(4, dtype=torch.float64)[None]


def cameras(fx: float, fy: float, skew: float = 0.0, size=(40, 60), pose=FRONT, **more) -> Cameras:
    """That look along z from the origin."""
    lens = torch.tensor([[fx, skew, size[1] / 2], [0, fy, size[0] / 2], [0, 0, 1]], dtype=torch.float64)
    return Cameras(pose, lens.expand(len(pose), 3, 3), size, **more)


def tubes(kind: str = "even", dtype: torch.dtype = torch.float64) -> Sketch:
    """A bend, a sharp corner of two segments and a slant in depth, one behind the other; of even widths or not."""
    bend = [[-0.9, 0.4, 1.9], [-0.5, -1.2, 2.0], [0.4, 1.3, 2.1], [0.8, -0.5, 2.0]]
    leg = [[-0.8, 0.5, 3.1], [-0.3, 0.2, 3.0], [0.1, -0.1, 3.0], [0.4, -0.6, 3.0]]
    back = [[0.4, -0.6, 3.0], [0.45, 0.0, 3.0], [0.5, 0.3, 3.1], [0.6, 0.7, 3.0]]
    slant = [[-0.4, -0.7, 1.2], [0.0, -0.3, 2.0], [0.5, 0.1, 3.0], [1.1, 0.6, 4.5]]
    points = torch.tensor([bend, leg, back, slant], dtype=dtype)
    weights = torch.tensor([[1.0, 1.5, 0.7, 1], [1, 1, 1, 1], [1, 2, 1, 1], [1, 1, 1, 1.2]], dtype=dtype)
    width = torch.tensor([0.3, 0.4, 0.25], dtype=dtype)
    if kind == "along":
        width = torch.tensor([[0.3, 0.1, 0.2, 0.4], [0.3, 0.3, 0.2, 0.2], [0.2, 0.2, 0.4, 0.3], [0.1, 0.3, 0.2, 0.3]])
    color = torch.tensor([[0.8, 0.1, 0.2], [0.1, 0.7, 0.3], [0.2, 0.3, 0.9]], dtype=dtype)
    opacity = torch.tensor([0.7, 0.9, 0.6], dtype=dtype)
    chains = Chains.of([1, 2, 1])
    return Sketch(points, weights, width.to(dtype), color, opacity, width_space="world", chains=chains)


@pytest.mark.parametrize("kind", KINDS)
def test_a_tube_is_as_thick_as_its_shadow(backend, kind):
    """Of a tube that runs straight by, in some directions, the pixels across it; and of a dot those that it covers."""
    fx, fy, skew = KINDS[kind]
    for turn in (0.0, 0.4, math.pi / 2, 2.2):
        x, y = math.cos(turn), math.sin(turn)
        line = torch.tensor([[[-9 * x, -9 * y, 2.0], [9 * x, 9 * y, 2.0]]], dtype=torch.float64)
        view = cameras(fx, fy, skew)
        # A coloured end of the image has no part in it: the tube fills a band from side to side.
        image = render(Sketch(line, width=0.2, width_space="world"), view, backend=backend, antialiasing=Analytic(0.6))
        along = torch.tensor([fx * x + skew * y, fy * y])
        normal = torch.tensor([-along[1], along[0]]) / along.norm()
        # The ellipse K (cos, sin) r of the disc reaches r |K' n| along n.
        half = 0.1 / 2 * (torch.tensor([[fx, 0.0], [skew, fy]]) @ normal).norm()
        steep = abs(normal[0]) < abs(normal[1])
        across = image.alpha[0, :, 29:31].sum(0) if steep else image.alpha[0, 19:21].sum(1)
        wanted = 2 * half / normal.abs().max()
        torch.testing.assert_close(across.mean(), wanted.double(), rtol=2e-3, atol=0)


@pytest.mark.parametrize("orthographic", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_a_dot_is_an_ellipse(backend, kind, orthographic):
    fx, fy, skew = KINDS[kind]
    depth = 1.0 if orthographic else 2.0
    center = torch.tensor([0.03, -0.02], dtype=torch.float64)
    dot = torch.cat([center * depth, torch.tensor([depth])]).expand(1, 2, 3)
    view = cameras(fx, fy, skew, orthographic=orthographic)
    alpha = render(Sketch(dot, width=0.5 * depth, width_space="world"), view, backend=backend).alpha[0]
    assert alpha.sum().item() == pytest.approx(math.pi * fx * fy / 16, rel=0.01)
    y, x = torch.meshgrid(torch.arange(40) + 0.5, torch.arange(60) + 0.5, indexing="ij")
    lens = torch.tensor([[fx, skew], [0, fy]], dtype=torch.float64)
    place = torch.stack([x - 30, y - 20], -1).double()
    away = (torch.linalg.solve(lens, place[..., None])[..., 0] - center).norm(dim=-1)
    # Half a pixel in the direction in which the ellipse is thinnest.
    edge = 0.51 / torch.linalg.svdvals(lens)[-1]
    assert (alpha[away < 0.25 - edge] > 1 - 1e-6).all()
    assert (alpha[away > 0.25 + edge] == 0).all()


@pytest.mark.parametrize("kind", KINDS)
def test_the_edge_of_a_dot_is_across_its_ellipse(backend, kind):
    """Whatever direction rounding gives the tangent of a dot, and of one that is smaller than a pixel too."""
    fx, fy, skew = KINDS[kind]
    generator = torch.Generator().manual_seed(0)
    lens = torch.tensor([[fx, skew], [0, fy]], dtype=torch.float64)
    y, x = torch.meshgrid(torch.arange(40) + 0.5, torch.arange(60) + 0.5, indexing="ij")
    place = torch.stack([x - 30, y - 20], -1).double()
    # Two radii and three numbers of control points.
    for number in range(6):
        depth = 1.5 + torch.rand(1, generator=generator, dtype=torch.float64)
        center, radius = 0.3 * torch.rand(2, generator=generator, dtype=torch.float64) - 0.15, (0.15, 0.005)[number % 2]
        dot = torch.cat([center * depth, depth]).expand(1, 2 + number % 3, 3)
        tiny = Sketch(dot, width=2 * radius * depth, width_space="world")
        alpha = render(tiny, cameras(fx, fy, skew), backend=backend).alpha[0]
        away = torch.linalg.solve(lens, place[..., None])[..., 0] - center
        distance = away.norm(dim=-1)
        # How fast the distance grows with pixels, across its level.
        slope = torch.linalg.vector_norm(away / distance[..., None] @ torch.linalg.inv(lens), dim=-1)
        inside, beyond = ((side * radius - distance) / slope for side in (1, -1))
        exact = (inside + 0.5).clamp(0, 1) - (beyond + 0.5).clamp(0, 1)
        torch.testing.assert_close(alpha, exact, rtol=0, atol=1e-9)


@pytest.mark.parametrize("kind", [pytest.param("even", marks=pytest.mark.slow), "along"])
def test_it_is_the_picture_of_square_pixels_stretched(backend, kind):
    """Many square pixels in place of each oblong one, whose mean is what it shows, but for corners and thin edges."""
    sketch = tubes(kind)
    image = render(sketch, cameras(20.0, 60.0, size=(60, 40)), backend=backend)
    # 12 pixels across and 4 down for each.
    fine = render(sketch, cameras(240.0, 240.0, size=(240, 480)), backend=backend)
    for got, true in ((image.alpha, fine.alpha), (image.color[..., 0], fine.color[..., 0])):
        mean = avg_pool2d(true[:, None], (4, 12))[:, 0]
        off = (got - mean).abs()
        # The box filter by distance: up to .086 at one edge, more where edges meet.
        assert off.mean() < 4e-3
        assert off.max() < 0.25


def leaves(sketch: Sketch, view: Cameras) -> dict[str, torch.Tensor]:
    values = {**sketch.tensors(), "pose": view.world_to_camera, "lens": view.intrinsics}
    return {name: value.detach().clone().requires_grad_() for name, value in values.items()}


def loss_of(values: dict[str, torch.Tensor], view: Cameras, sketch: Sketch, **how) -> torch.Tensor:
    """Of all three images, by a fixed pattern."""
    given = {name: values[name] for name in sketch.tensors()}
    if sketch.chains is not None:
        # Which of two segments is nearer to what lies at a joint is a matter of rounding.
        given["points"] = sketch.chains.joined(given["points"])
        if given["width"].ndim == 2:
            given["width"] = sketch.chains.joined(given["width"])
    drawn = Sketch(**given, width_space="world", chains=sketch.chains)
    seen = Cameras(values["pose"], values["lens"], view.size, view.near, view.orthographic)
    image = render(drawn, seen, background=0.3, **how)
    generator = torch.Generator().manual_seed(5)
    parts = (image.color, image.alpha, image.depth * (image.alpha.detach() > 0.05))
    return sum((x * torch.rand(x.shape, generator=generator, dtype=torch.float64)).sum() for x in parts)


def gradients(backend: str, shape: str, blur: float, kind: str, orthographic: bool) -> dict[str, torch.Tensor]:
    """The loss and its gradients."""
    sketch = tubes(kind)
    view = cameras(*KINDS[shape], size=(20, 30), pose=FRONT.repeat(2, 1, 1), orthographic=orthographic)
    values = leaves(sketch, view)
    loss = loss_of(values, view, sketch, backend=backend, antialiasing=Analytic(blur))
    found = torch.autograd.grad(loss, list(values.values()))
    return {"loss": loss.detach(), **dict(zip(values, found, strict=True))}


# Once for all kernels: it is slow.
by_reference = functools.cache(functools.partial(gradients, "reference"))


@pytest.mark.parametrize("orthographic", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", ["even", "along"])
@pytest.mark.parametrize("blur", [0.0, 1.2])
def test_kernels_draw_and_differentiate_as_the_reference(kernels, blur, kind, orthographic):
    for shape in ("oblong", "skewed"):
        got = gradients(kernels, shape, blur, kind, orthographic)
        for name, expected in by_reference(shape, blur, kind, orthographic).items():
            assert_close_gradients(got[name], expected, f"{shape} {name}")


@pytest.mark.parametrize("kind", [*KINDS, "square"])
def test_gradients_to_lenses_and_widths_are_differences(kernels, kind):
    """Of fx, fy, the skew and every width by itself; where pixels are square, too, fx and fy are two numbers."""
    lens = KINDS.get(kind, (40.0, 40.0, 0.0))
    sketch, view = tubes("along"), cameras(*lens, size=(20, 30))
    values, how = leaves(sketch, view), {"backend": kernels, "antialiasing": Analytic(1.5)}
    found = torch.autograd.grad(loss_of(values, view, sketch, **how), [values["lens"], values["width"]])
    places = [("lens", (0, 0, 0)), ("lens", (0, 1, 1)), ("lens", (0, 0, 1)), *(("width", (k, 1)) for k in range(4))]
    for name, place in places:
        # So small that no closest point jumps from one part of a stroke to another.
        step = 1e-5 if name == "lens" else 1e-7
        with torch.no_grad():
            both = []
            for sign in (1, -1):
                moved = values[name].clone()
                moved[place] += sign * step
                both.append(loss_of({**values, name: moved}, view, sketch, **how).item())
        slope = (both[0] - both[1]) / (2 * step)
        assert found[name == "width"][place].item() == pytest.approx(slope, rel=2e-3, abs=2e-3), (name, place)


@pytest.mark.parametrize("name", ["oblong", "skewed"])
def test_samples_have_the_gradient_of_an_ellipse(kernels, name):
    """Its area is pi det(K) (width / 2 z)^2: without bias, and with some noise."""
    fx, fy, skew = KINDS[name]
    lens = cameras(fx, fy, skew).intrinsics.clone().requires_grad_()
    width = torch.tensor([1.0], dtype=torch.float64, requires_grad=True)
    dot = torch.tensor([[[0.0, 0, 2.0]] * 2], dtype=torch.float64)
    sketch = Sketch(dot, width=width, width_space="world")
    how = seeded("montecarlo", 64)
    image = render(sketch, Cameras(FRONT, lens, (40, 60)), antialiasing=how, backend=kernels)
    area = math.pi * fx * fy / 16
    assert image.alpha.sum().item() == pytest.approx(area, rel=0.01)
    of_lens, of_width = torch.autograd.grad(image.alpha.sum(), [lens, width])
    assert of_width.item() == pytest.approx(2 * area, rel=0.01)
    assert of_lens[0, 0, 0].item() == pytest.approx(area / fx, rel=0.02)
    assert of_lens[0, 1, 1].item() == pytest.approx(area / fy, rel=0.02)
    assert of_lens[0, 0, 1].item() == pytest.approx(0, abs=0.02 * area / fx)


def test_samples_lead_to_the_same_gradients_as_distances(kernels):
    """Of a bend that tapers, in the mean of many samples: of ink by all that moves it."""
    sketch = tubes("along")[0].replace(opacity=1.0)
    view = cameras(*KINDS["skewed"])

    def gradient(how: Analytic | MonteCarlo) -> torch.Tensor:
        values = leaves(sketch, view)
        seen = Cameras(values["pose"], values["lens"], view.size)
        tube = Sketch(values["points"], values["weights"], values["width"], width_space="world")
        image = render(tube, seen, antialiasing=how, backend=kernels)
        ramp = torch.linspace(0, 1, 60, dtype=torch.float64) + torch.linspace(0, 2, 40, dtype=torch.float64)[:, None]
        found = torch.autograd.grad((image.alpha * ramp).sum(), [values[n] for n in ("points", "width", "lens")])
        return torch.cat([g.flatten() for g in found])

    expected = gradient(Analytic(1.0))
    got = gradient(seeded("montecarlo", 64, seed=1))
    assert (got - expected).norm() < 0.03 * expected.norm()


def test_float32_projected_and_batched_drawings_agree(kernels):
    sketch, view = tubes("along", torch.float32), cameras(*KINDS["oblong"], pose=FRONT.repeat(2, 1, 1))
    square = cameras(30.0, 30.0, pose=FRONT)
    image = render(sketch, view, backend=kernels)
    expected = render(sketch.to(torch.float64), view, backend=kernels)
    torch.testing.assert_close(image.color.double(), expected.color, rtol=0, atol=2e-3)
    projected = rasterize(project(sketch, view), view.size, backend=kernels)
    assert torch.equal(projected.color, image.color)
    both = render_batch([sketch, sketch], [view, square], backend=kernels)
    assert torch.equal(both[0].color, image.color)
    assert torch.equal(both[1].color, render(sketch, square, backend=kernels).color)


def test_widths_of_the_image_know_nothing_of_it(kernels):
    strokes = project(tubes().replace(width_space="image", width=0.02), cameras(60.0, 20.0))
    assert strokes.square is None
    assert project(tubes(), cameras(60.0, 60.0)).square is None


def test_a_resized_view_shows_the_same_tube(backend):
    """Half as many pixels in one direction only: the same picture, less fine."""
    view = orbit(20, 30, 2.0, size=(48, 48)).to(torch.float64)
    ring = tubes()[0].replace(width=0.3)
    narrow = render(ring, view.resize((48, 24)), backend=backend).alpha
    mean = avg_pool2d(render(ring, view, backend=backend).alpha[:, None], (1, 2))[:, 0]
    assert (narrow - mean).abs().max() < 0.25
    assert (narrow - mean).abs().mean() < 4e-3


@pytest.mark.usefixtures("unchecked")
def test_what_shows_no_widths_is_refused(kernels):
    lens = torch.tensor([[[30.0, 20, 15], [45, 30, 10], [0, 0, 1]]], dtype=torch.float64)
    flat = Cameras(FRONT, lens, (20, 30))
    with pytest.raises(ValueError, match="intrinsics of view 0 show a plane as a line"):
        render(tubes(), flat, backend=kernels)
    strokes = project(tubes(), cameras(60.0, 20.0))
    object.__setattr__(strokes, "square", strokes.square[:, :1])
    with pytest.raises(ValueError, match=r"square must be float64 of shape \(1, 2, 2\)"):
        rasterize(strokes, 20, backend=kernels)
