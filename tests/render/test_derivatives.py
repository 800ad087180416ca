"""Derivatives beyond a first backward pass: right or refused; and transforms of torch that leave nothing behind."""

from dataclasses import replace

import pytest
import torch
from scenes import seeded, strokes_at
from torch.autograd import forward_ad
from torch.autograd.functional import hvp, jacobian
from torch.func import functionalize, grad, hessian, jacfwd, jacrev, jvp, vjp, vmap
from torch.fx.experimental.proxy_tensor import make_fx

from diff3ds import Analytic, Cameras, Sketch, orbit, render
from diff3ds.render import available_backends, rasterize

# What torch says of itself where it decomposes operations for forward mode, and traces.
pytestmark = pytest.mark.filterwarnings("ignore:`torch.jit:DeprecationWarning")
REFERENCE = 'backend="reference"'
POINTS = torch.tensor([[[-0.5, 0.0, 0.0], [0.5, 0.0, 0.3]]], dtype=torch.float64)
SIZE = 12


def options(antialiasing: str) -> dict:
    return {"antialiasing": seeded(antialiasing, 1)}


def picture(backend: str, antialiasing: str = "analytic"):
    """A function from control points to the picture's colours."""
    cameras = orbit([30, 90], 20, size=SIZE)
    return lambda points: render(Sketch(points, width=0.1), cameras, backend=backend, **options(antialiasing)).color


def leaves() -> dict[str, torch.Tensor]:
    """All that a drawing is differentiable by."""
    cameras = orbit(30, 20, size=SIZE)
    g = torch.Generator().manual_seed(3)
    values = {
        "points": 0.4 * torch.randn(2, 4, 3, generator=g),
        "weights": 0.5 + torch.rand(2, 4, generator=g),
        "width": torch.tensor([0.1, 0.06]),
        "color": torch.rand(2, 3, generator=g),
        "opacity": 0.3 + 0.6 * torch.rand(2, generator=g),
        "world_to_camera": cameras.world_to_camera,
        "intrinsics": cameras.intrinsics,
        "background": torch.rand(3, generator=g),
    }
    return {name: value.double().requires_grad_() for name, value in values.items()}


def drawn(values: dict[str, torch.Tensor], space: str = "image", **how):
    sketch = Sketch(*(values[name] for name in ("points", "weights", "width", "color", "opacity")), width_space=space)
    cameras = Cameras(values["world_to_camera"], values["intrinsics"], (SIZE, SIZE))
    return render(sketch, cameras, background=values["background"], **how)


@pytest.mark.parametrize("image", ["color", "alpha", "depth"])
def test_gradients_by_kernels_refuse_a_second_derivative(kernels, antialiasing, image):
    """Of any input by any, also where the loss is linear in the picture and its own gradient a constant."""
    values = leaves()
    used = [t for name, t in values.items() if image == "color" or name not in ("color", "background")]
    loss = getattr(drawn(values, backend=kernels, **options(antialiasing)), image).sum()
    plain = torch.autograd.grad(loss, used, retain_graph=True)
    found = torch.autograd.grad(loss, used, create_graph=True)
    for expected, got in zip(plain, found, strict=True):
        assert torch.equal(got, expected)
        for by in used:
            with pytest.raises(RuntimeError, match=REFERENCE):
                torch.autograd.grad(got.sum(), by, retain_graph=True, allow_unused=True)


def test_gradients_of_strokes_refuse_a_second_derivative(kernels, antialiasing):
    strokes = strokes_at([[[4.0, 20.0], [10.0, 2.0], [20.0, 8.0]]], half_width=2.0)
    names = ("cubics", "half_width", "color", "opacity")
    tensors = {name: getattr(strokes, name).clone().requires_grad_() for name in names}
    image = rasterize(replace(strokes, **tensors), 24, backend=kernels, **options(antialiasing))
    for got in torch.autograd.grad(image.color.sum(), list(tensors.values()), create_graph=True):
        with pytest.raises(RuntimeError, match=REFERENCE):
            got.sum().backward(retain_graph=True)


def test_second_derivatives_by_kernels_in_all_their_forms(kernels, antialiasing):
    loss = lambda points: picture(kernels, antialiasing)(points).square().mean()  # noqa: E731
    forms = [
        lambda: torch.autograd.functional.hessian(loss, POINTS),
        lambda: hvp(loss, POINTS, POINTS),
        lambda: grad(lambda points: grad(loss)(points).square().sum())(POINTS),
        lambda: jacrev(jacrev(loss))(POINTS),
    ]
    for form in forms:
        with pytest.raises(RuntimeError, match=REFERENCE):
            form()


def test_monte_carlo_of_the_reference_refuses_a_second_derivative():
    values = leaves()
    loss = drawn(values, backend="reference", **options("montecarlo")).color.sum()
    for got in torch.autograd.grad(loss, [values["points"], values["width"], values["opacity"]], create_graph=True):
        with pytest.raises(RuntimeError, match='antialiasing="analytic"'):
            torch.autograd.grad(got.sum(), values["points"], retain_graph=True, allow_unused=True)


@pytest.mark.parametrize(("space", "blur"), [("image", 0.0), pytest.param("world", 1.5, marks=pytest.mark.slow)])
def test_derivatives_of_the_reference(space, blur):
    """Second ones against central differences of the first, in a direction of all inputs; forward against reverse."""
    values = leaves()
    g = torch.Generator().manual_seed(5)
    direction = {name: torch.randn(value.shape, generator=g, dtype=value.dtype) for name, value in values.items()}
    for name, row in (("world_to_camera", 3), ("intrinsics", 2)):
        direction[name][:, row] = 0
    way = {"antialiasing": Analytic(blur), "backend": "reference"}
    seen = drawn(values, space, **way)
    upstream = {name: torch.rand(image.shape, generator=g, dtype=image.dtype) for name, image in vars(seen).items()}
    # The depth of pixels with little ink hangs on rounding.
    upstream["depth"] = upstream["depth"] * (seen.alpha.detach() > 0.05)

    def loss(*tensors: torch.Tensor) -> torch.Tensor:
        found = vars(drawn(dict(zip(values, tensors, strict=True)), space, **way))
        return sum(((found[name] + found[name].square()) * upstream[name]).sum() for name in found)

    def slopes(step: float, **graph: bool) -> tuple[list[torch.Tensor], tuple[torch.Tensor, ...]]:
        moved = [(value + step * direction[name]).detach().requires_grad_() for name, value in values.items()]
        return moved, torch.autograd.grad(loss(*moved), moved, **graph)

    along = tuple(direction.values())
    at, first = slopes(0.0, create_graph=True)
    rate_of_loss = sum((a * s).sum() for a, s in zip(along, first, strict=True))
    second = torch.autograd.grad(rate_of_loss, at)
    step = 1e-6
    differences = [(b - a) / (2 * step) for a, b in zip(slopes(-step)[1], slopes(step)[1], strict=True)]
    got, expected = (torch.cat([t.flatten() for t in x]) for x in (second, differences))
    assert (got - expected).norm() < 1e-6 * expected.norm()
    forward = jvp(loss, tuple(v.detach() for v in values.values()), along)[1]
    torch.testing.assert_close(forward, rate_of_loss.detach(), rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("blur", [0.0, 0.5])
def test_second_derivatives_in_the_middle_of_a_stroke(blur):
    """Pixel centres on the curve itself, where the distance has none but the coverage has."""
    strokes = strokes_at([[[2.0, 8.5], [6.0, 8.5], [14.0, 8.5]]], half_width=0.3)
    sideways = torch.zeros_like(strokes.cubics)
    sideways[..., 1] = strokes.cubics[..., 3]

    def slope(move: float, **graph: bool) -> tuple[torch.Tensor, torch.Tensor]:
        at = torch.tensor(move, dtype=torch.float64, requires_grad=True)
        image = rasterize(
            replace(strokes, cubics=strokes.cubics + at * sideways),
            16,
            antialiasing=Analytic(blur),
            backend="reference",
        )
        return at, torch.autograd.grad(image.alpha[:, :, 4:12].square().sum(), at, **graph)[0]

    at, first = slope(0.0, create_graph=True)
    (second,) = torch.autograd.grad(first, at)
    step = 1e-5
    expected = (slope(step)[1] - slope(-step)[1]) / (2 * step)
    torch.testing.assert_close(second, expected, rtol=1e-6, atol=1e-6)


def test_transforms_in_reverse_mode(backend, antialiasing):
    """The derivatives of torch.func are those of autograd, to the last bit."""
    image = picture(backend, antialiasing)
    rows = lambda points: image(points).mean((1, 2))  # noqa: E731
    points = POINTS.clone().requires_grad_()
    (expected,) = torch.autograd.grad(image(points).mean(), points)
    assert expected.abs().sum() > 0.01
    assert torch.equal(grad(lambda p: image(p).mean())(POINTS), expected)
    assert torch.equal(vjp(lambda p: image(p).mean(), POINTS)[1](torch.ones((), dtype=torch.float64))[0], expected)
    torch.testing.assert_close(jacrev(rows)(POINTS), jacobian(rows, POINTS), rtol=0, atol=1e-15)


def test_forward_mode(backend, antialiasing):
    image = picture(backend, antialiasing)
    (expected,) = torch.autograd.grad(image(points := POINTS.clone().requires_grad_()).mean(), points)

    def tangent() -> torch.Tensor:
        with forward_ad.dual_level():
            return forward_ad.unpack_dual(image(forward_ad.make_dual(POINTS, POINTS)).mean()).tangent

    if backend == "reference" and antialiasing == "analytic":
        torch.testing.assert_close(tangent(), (expected * POINTS).sum(), rtol=1e-12, atol=1e-12)
        rows = lambda points: image(points).mean((1, 2))  # noqa: E731
        torch.testing.assert_close(jacfwd(rows)(POINTS), jacobian(rows, POINTS), rtol=0, atol=1e-12)
        forward = jacobian(rows, POINTS, vectorize=True, strategy="forward-mode")
        torch.testing.assert_close(forward, jacobian(rows, POINTS), rtol=0, atol=1e-12)
        return
    for form in (tangent, lambda: jvp(image, (POINTS,), (POINTS,))):
        with pytest.raises(RuntimeError, match=r"forward mode .* reverse mode"):
            form()


def test_what_cannot_be_mapped(backend):
    image = picture(backend)
    many = POINTS.repeat(2, 1, 1, 1)
    strokes = strokes_at([[[4.0, 12.0], [10.0, 2.0], [12.0, 8.0]]])
    forms = {
        "points": [lambda: vmap(image)(many), lambda: vmap(grad(lambda p: image(p).mean()))(many)],
        "points must .* functionalize": [lambda: functionalize(image)(POINTS)],
        "cubics": [lambda: vmap(lambda c: rasterize(replace(strokes, cubics=c), 16).alpha)(strokes.cubics[None])],
        "background": [
            lambda: vmap(lambda b: render(Sketch(POINTS), orbit(0, size=8), background=b).color)(
                torch.rand(2, 3, dtype=torch.float64)
            )
        ],
        "world_to_camera": [
            lambda: vmap(lambda w: render(Sketch(POINTS), Cameras(w, torch.eye(3)[None], (8, 8))).color)(
                torch.eye(4).repeat(2, 1, 1, 1)
            )
        ],
    }
    for name, calls in forms.items():
        for call in calls:
            with pytest.raises(RuntimeError, match=name):
                call()


def test_batched_gradients(kernels):
    with pytest.raises(RuntimeError, match=r"torch\.func\.jacrev"):
        jacobian(lambda points: picture(kernels)(points).mean((1, 2)), POINTS, vectorize=True)


def test_recorded_graphs_hold_no_picture(backend):
    """They would draw the same for all inputs."""
    strokes = strokes_at([[[4.0, 12.0], [10.0, 2.0], [12.0, 8.0]]])
    alpha = lambda cubics: rasterize(replace(strokes, cubics=cubics), 16, backend=backend).alpha  # noqa: E731
    with pytest.raises(RuntimeError, match="recorded"):
        make_fx(alpha)(strokes.cubics)
    with pytest.raises(RuntimeError, match="recorded"), pytest.warns():
        torch.jit.trace(alpha, strokes.cubics, check_trace=False)


TRANSFORMS = {
    "grad": lambda f: grad(f)(POINTS),
    "vjp": lambda f: vjp(f, POINTS)[1](torch.ones((), dtype=torch.float64)),
    "jacrev": lambda f: jacrev(f)(POINTS),
    "hessian": lambda f: hessian(f)(POINTS),
    "jvp": lambda f: jvp(f, (POINTS,), (POINTS,)),
    "vmap": lambda f: vmap(f)(POINTS[None]),
    "vmap of nothing": lambda f: vmap(lambda _: f(POINTS))(torch.zeros(2)),
    "functionalize": lambda f: functionalize(f)(POINTS),
    "functionalize of nothing": lambda f: functionalize(lambda _: f(POINTS))(POINTS),
    "fake": lambda f: _in(torch._subclasses.FakeTensorMode(allow_non_fake_inputs=True), f),
    "record": lambda f: make_fx(f)(POINTS),
    "inference": lambda f: _in(torch.inference_mode(), f),
    "dual": lambda f: _in(forward_ad.dual_level(), f),
    "default device": lambda f: _in(torch.device("meta"), f),
}


def _in(mode, call) -> None:
    with mode:
        call(POINTS)


@pytest.mark.parametrize("transform", TRANSFORMS)
def test_nothing_outlives_a_transform(backend, transform, request):
    """Whether it works or is refused: pictures and gradients afterwards are those of a process that never saw it."""
    # Caches by these have no entry yet.
    background = 0.1 + 0.001 * list(TRANSFORMS).index(transform) + 0.1 * len(request.node.name) / 256
    cameras, fresh = (orbit([30, 90], 20, size=SIZE) for _ in range(2))

    def value(points: torch.Tensor) -> torch.Tensor:
        return render(Sketch(points, width=0.1), cameras, background=background, backend=backend).color.mean()

    try:
        TRANSFORMS[transform](value)
    # ValueError: what stands in for a GPU here is none in a graph.
    except (RuntimeError, NotImplementedError, ValueError, torch._subclasses.fake_tensor.DataDependentOutputException):
        assert transform not in ("grad", "vjp", "jacrev", "inference")
    points = POINTS.clone().requires_grad_()
    wanted = render(
        Sketch(points, width=0.1),
        fresh,
        background=torch.tensor([background] * 3, dtype=torch.float64),
        backend=backend,
    ).color.mean()
    (expected,) = torch.autograd.grad(wanted, points)
    assert torch.equal(value(POINTS), wanted.detach())
    assert torch.equal(torch.autograd.grad(value(points), points)[0], expected)
    assert "_kept_projection" not in vars(cameras) or not cameras.projection.is_inference()


@pytest.mark.skipif("cpu" not in available_backends(), reason="no compiled kernels")
def test_an_exported_program_draws_as_what_it_was_made_from() -> None:
    """One graph from control points to the picture, with a drawing in it; `test_compiled.py` has all cases."""
    cameras, points = orbit([30, 90], 20, size=SIZE), POINTS.float()

    class Picture(torch.nn.Module):
        def forward(self, points: torch.Tensor) -> torch.Tensor:
            return render(Sketch(points, width=0.1), cameras).color

    drawn = torch.export.export(Picture(), (points,)).module()
    assert torch.equal(drawn(points + 0.1), Picture()(points + 0.1))
    assert not torch.equal(drawn(points + 0.1), drawn(points))
