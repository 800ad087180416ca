"""Bad input: an error that names the argument, the stroke, the value, and what was expected."""

import re
from dataclasses import replace

import numpy as np
import pytest
import torch
from scenes import strokes_at
from sweep import sweep

from diff3ds import MonteCarlo, Sketch, orbit, project, render
from diff3ds.render import rasterize, set_num_threads

pytestmark = pytest.mark.usefixtures("unchecked")
NAN, INF = float("nan"), float("inf")


@pytest.fixture
def strokes():
    return strokes_at(torch.tensor([[[3.0, 4.0], [12.0, 9.0]]]).expand(5, 2, 2), half_width=1.0, opacity=0.5)


def spoiled(strokes, name: str, index: tuple[int, ...], value: float):
    tensor = getattr(strokes, name).clone()
    tensor[index] = value
    return replace(strokes, **{name: tensor})


@sweep(
    ("name", "index", "value", "message"),
    [
        ("cubics", (0, 2, 1, 0), NAN, "cubics of stroke 2 (view 0) must be finite, below 1e+100, got nan"),
        ("cubics", (0, 4, 3, 2), INF, "cubics of stroke 4 (view 0) must be finite, below 1e+100, got inf"),
        ("cubics", (0, 1, 0, 1), -1e200, "cubics of stroke 1 (view 0) must be finite, below 1e+100, got -1e+200"),
        ("cubics", (0, 3, 2, 3), -0.5, "cubics (the weights W) of stroke 3 (view 0) must be positive, got -0.5"),
        ("half_width", (0, 3), -1.0, "half_width of stroke 3 (view 0) must be finite and not negative, got -1.0"),
        ("half_width", (0, 0), NAN, "half_width of stroke 0 (view 0) must be finite and not negative, got nan"),
        ("color", (2, 1), INF, "color of stroke 2 (view 0) must be finite, got inf"),
        ("opacity", (4,), 1.5, "opacity of stroke 4 (view 0) must be in [0, 1], got 1.5"),
        ("opacity", (1,), NAN, "opacity of stroke 1 (view 0) must be in [0, 1], got nan"),
    ],
)
def test_values(backend, antialiasing, strokes, name, index, value, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        rasterize(spoiled(strokes, name, index, value), 16, backend=backend, antialiasing=antialiasing)


@sweep(
    ("change", "error", "message"),
    [
        ({"cubics": torch.zeros(5, 4, 4).double()}, ValueError, "cubics must be float64 of shape (V, N, 4, 4), got"),
        ({"cubics": torch.ones(1, 5, 4, 4)}, ValueError, "got torch.float32 of (1, 5, 4, 4)"),
        (
            {"half_width": torch.ones(3, 5).double()},
            ValueError,
            "half_width must have shape (1, 5) or (1, 5) or (1, 5, 4) or (1, 5, 4) for 5 strokes",
        ),
        ({"color": torch.ones(4, 3).double()}, ValueError, "color must have shape (5, 3) for 5 strokes, got (4, 3)"),
        ({"opacity": torch.ones(5)}, TypeError, "opacity must have the floating point dtype of color, torch.float64"),
        ({"color": torch.ones(5, 3).long()}, TypeError, "floating point dtype"),
        (
            {"opacity": torch.ones(5, device="meta").double()},
            ValueError,
            "opacity must be on the device of cubics, cpu, got meta",
        ),
        ({"width_space": "metres"}, ValueError, 'width_space must be "image" or "world", got \'metres\''),
        ({"orthographic": 1}, TypeError, "orthographic must be True or False, got int"),
        (
            {"orthographic": True, "width_space": "world"},
            ValueError,
            "orthographic strokes have half widths in pixels (width_space=\"image\"), got 'world'",
        ),
        ({"near": 0.0}, ValueError, "near must be a positive number, got 0.0"),
        ({"near": NAN}, ValueError, "near must be a positive number, got nan"),
    ],
)
def test_fields(backend, strokes, change, error, message):
    with pytest.raises(error, match=re.escape(message)):
        rasterize(replace(strokes, **change), 16, backend=backend)


@sweep(
    ("options", "error", "message"),
    [
        ({"size": 0}, ValueError, "size must be a positive int or (height, width)"),
        ({"size": (16, -1)}, ValueError, "got (16, -1)"),
        ({"size": (16, 16, 3)}, ValueError, "got (16, 16, 3)"),
        ({"size": (2**17, 16)}, ValueError, "up to 65536"),
        ({"antialiasing": "msaa"}, ValueError, '"analytic" or "montecarlo", got \'msaa\''),
        ({"antialiasing": MonteCarlo}, ValueError, "antialiasing must be ds.Analytic(...), ds.MonteCarlo(...), "),
        ({"antialiasing": None}, ValueError, '"analytic" or "montecarlo", got None'),
        ({"background": torch.ones(5).double()}, ValueError, "background must broadcast to (1, 16, 16, 3), got shape"),
        ({"background": torch.ones(3)}, TypeError, "background must be torch.float64 on cpu as the colours are"),
        ({"background": torch.ones(1, 1, 1, 1, 3).double()}, ValueError, "background must broadcast"),
        ({"background": NAN}, ValueError, "background must be finite, got nan"),
        ({"background": (0.0, float("inf"), 0.0)}, ValueError, "background must be finite, got (0.0, inf, 0.0)"),
        ({"background": torch.full((3,), NAN).double()}, ValueError, "must be finite, got NaN or infinite values"),
        ({"background": np.full((16, 16, 3), NAN)}, ValueError, "must be finite, got NaN or infinite values"),
        ({"background": None}, TypeError, "background must be a number, three numbers or a tensor, got NoneType"),
        ({"background": "white"}, TypeError, "background must be a number, three numbers or a tensor, got str"),
        ({"backend": "gpu"}, ValueError, 'backend must be "reference", "cpu", "cuda" or None, got \'gpu\''),
    ],
)
def test_options(backend, strokes, options, error, message):
    options = {"size": 16, "backend": backend, **options}
    with pytest.raises(error, match=re.escape(message)):
        rasterize(strokes, options.pop("size"), **options)


def test_a_generator_on_a_device():
    """Its number would have to be waited for."""

    class Elsewhere(torch.Generator):
        device = torch.device("cuda", 1)

    message = "generator must be on the CPU, wherever the strokes are, got one on cuda:1: use torch.Generator()"
    with pytest.raises(ValueError, match=re.escape(message)):
        MonteCarlo(generator=Elsewhere())


def test_arguments_of_render(backend):
    sketch, cameras = Sketch(torch.rand(3, 4, 3)), orbit(0.0, size=16)
    with pytest.raises(TypeError, match="render takes a Sketch and Cameras, got Cameras and Sketch"):
        render(cameras, sketch, backend=backend)
    with pytest.raises(TypeError, match="strokes must be Strokes2D, got Sketch"):
        rasterize(sketch, 16, backend=backend)
    with pytest.raises(ValueError, match="sketch and cameras must be on one device, got cpu and meta"):
        render(sketch, _on_meta(cameras), backend=backend)
    # A value spoiled after the sketch was checked, as an optimiser does: named as the sketch's own.
    sketch.points[1, 2, 0] = NAN
    with pytest.raises(ValueError, match="points of stroke 1 must be finite, got nan"):
        render(sketch, cameras, backend=backend)


def _on_meta(cameras):
    """Cameras on a device without values, past the checks of values."""
    away = object.__new__(type(cameras))
    for name in ("world_to_camera", "intrinsics", "size", "near", "orthographic"):
        value = getattr(cameras, name)
        object.__setattr__(away, name, value.to("meta") if isinstance(value, torch.Tensor) else value)
    return away


def test_unsupported_tensors_of_the_kernels(strokes):
    tiny = torch.float8_e5m2
    odd = replace(strokes, **{name: getattr(strokes, name).to(tiny) for name in ("half_width", "color", "opacity")})
    if "cpu" in available():
        with pytest.raises(ValueError, match=r'backend "cpu" draws float32, float64, .* got torch.float8_e5m2'):
            rasterize(odd, 16, backend="cpu")


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
def test_kernels_draw_half_precision_in_float32(kernels, dtype):
    generator = torch.Generator().manual_seed(0)
    points = torch.rand(5, 4, 3, generator=generator).to(dtype).requires_grad_()
    cameras = orbit(30, 20, 3, size=24)

    def drawn(points: torch.Tensor):
        return render(Sketch(points, width=0.1, opacity=0.7), cameras, background=0.5, backend=kernels)

    image, known = drawn(points), drawn(points.detach().float().requires_grad_())
    assert image.color.dtype == image.alpha.dtype == image.depth.dtype == dtype
    # The same numbers but for the width and the opacity, which are halves too.
    assert (image.alpha.float() - known.alpha).abs().max() < 0.02
    assert torch.autograd.grad(image.alpha.sum(), points)[0].dtype == dtype
    flat = project(Sketch(points.detach(), width=0.1, opacity=0.7), cameras)
    assert (rasterize(flat, 24, background=0.5, backend=kernels).alpha - image.alpha).abs().max() < 0.05


def available() -> list[str]:
    from diff3ds.render import available_backends

    return available_backends()


@pytest.mark.parametrize(("count", "got"), [(0, "0"), ("x", "'x'"), (2.5, "2.5")])
def test_number_of_threads(count, got):
    with pytest.raises(ValueError, match=f"the number of threads must be a positive integer or None, got {got}"):
        set_num_threads(count)


@pytest.mark.skipif("cpu" not in available(), reason="installed without compiled kernels")
def test_background_changed_before_the_backward(strokes):
    """The kernels look at it again: as everywhere in torch an error, not a wrong gradient."""
    background = torch.full((3,), 0.5, dtype=torch.float64)
    strokes.color.requires_grad_()
    image = rasterize(strokes, 16, background=background, backend="cpu")
    background.zero_()
    with pytest.raises(RuntimeError, match="modified by an inplace operation"):
        image.color.sum().backward()


def test_sketch_changed_before_the_backward():
    sketch = Sketch(torch.rand(3, 4, 3).requires_grad_())
    image = render(sketch, orbit(0.0, size=16), backend="cpu")
    with torch.no_grad():
        sketch.points.mul_(2)
    with pytest.raises(RuntimeError, match="modified by an inplace operation"):
        image.color.sum().backward()


@pytest.mark.skipif("cpu" not in available(), reason="installed without compiled kernels")
def test_numbers_kept_with_the_opposite_sign(strokes):
    """Torch may leave a tensor as it was, marked as negated: the kernels read it as it is meant."""
    color = torch.complex(torch.zeros_like(strokes.color), -strokes.color).conj().imag
    assert color.is_neg()
    assert torch.equal(color, strokes.color)
    found = rasterize(replace(strokes, color=color), 16, backend="cpu").color
    assert torch.equal(found, rasterize(strokes, 16, backend="cpu").color)
