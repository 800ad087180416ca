"""Random shapes and extreme values for the renderer: nothing may crash, hang, or give NaN or values out of range."""

import torch

from diff3ds import Analytic, Cameras, MonteCarlo, Sketch, look_at, render
from diff3ds.render import available_backends


def extreme(shape: tuple[int, ...], largest: float, g: torch.Generator) -> torch.Tensor:
    """Signed numbers from ordinary ones up to 10^±largest, some of them zero, some all alike."""
    size = (2 * torch.rand(shape, generator=g) - 1) * largest * _pick([0.0, 0.03, 0.3, 1.0], g)
    values = torch.randn(shape, generator=g).double() * 10 ** size.double()
    if _chance(0.2, g):
        values[torch.rand(shape, generator=g) < 0.3] = 0
    if _chance(0.1, g) and values.ndim > 1:
        values[:] = values[..., :1, :] if values.ndim > 2 else values[:1]
    return values


def _pick(choices: list, g: torch.Generator):
    return choices[int(torch.randint(len(choices), (), generator=g))]


def _chance(p: float, g: torch.Generator) -> bool:
    return bool(torch.rand((), generator=g) < p)


def random_sketch(dtype: torch.dtype, g: torch.Generator) -> Sketch:
    """Up to 9 strokes of any degree: coordinates to 1e±30, weights to 1e±3, widths from zero to 1e4 images' heights."""
    count, controls = _pick([0, 1, 2, 5, 9], g), _pick([2, 3, 4], g)
    points = extreme((count, controls, 3), 30, g)
    weights = 10 ** (_pick([0.0, 0.5, 3.0], g) * (2 * torch.rand(count, controls, generator=g) - 1))
    width = extreme((count,), _pick([0.0, 2.0, 4.0], g), g).abs() * _pick([0.0, 1e-3, 0.05, 1.0], g)
    appearance = width.clamp(max=1e4), torch.rand(count, 3, generator=g), torch.rand(count, generator=g)
    if _chance(0.2, g):
        appearance = *appearance[:2], appearance[2].round()
    tensors = [t.to(dtype).requires_grad_() for t in (points, weights, *appearance)]
    return Sketch(*tensors, width_space=_pick(["image", "world"], g))


def random_cameras(g: torch.Generator, orthographic: bool) -> Cameras:
    """One to three views of any size from 1 to 70, near, far, or in the middle of the strokes."""
    size = int(torch.randint(1, 71, (), generator=g)), int(torch.randint(1, 71, (), generator=g))
    views = _pick([1, 1, 2, 3], g)
    distance = _pick([0.0, 0.05, 2.0, 100.0], g)
    eye = torch.randn(views, 3, generator=g).double() * distance
    forward = torch.randn(views, 3, generator=g).double()
    fov = _pick([1.0, 60.0, 150.0], g)
    cameras = look_at(eye, eye + forward, fov=fov, size=size)
    pose, intrinsics = (t.requires_grad_() for t in (cameras.world_to_camera, cameras.intrinsics))
    return Cameras(pose, intrinsics, size, _pick([1e-6, 0.01, 1.0], g), orthographic)


def run_case(seed: int, backend: str | None = None) -> str:
    """Draws a random scene and its gradients.

    Returns:
        What is wrong, or nothing. Coordinates that the renderer refuses to draw are no failure.
    """
    g = torch.Generator().manual_seed(seed)
    dtype = _pick([torch.float32, torch.float64], g)
    # Intrinsics are pixels a unit then: the same numbers do.
    sketch, cameras = random_sketch(dtype, g), random_cameras(g, orthographic=seed % 4 == 3)
    sampled = _chance(0.3, g)
    how = MonteCarlo(_pick([1, 4, 9], g), g) if sampled else Analytic(_pick([0.0, 0.0, 0.3, 5.0, 1e3], g))
    # The kernels for tensors on the CPU, where they are.
    backend = backend or ("cpu" if "cpu" in available_backends() else "reference")
    image = render(sketch, cameras, background=0.5, antialiasing=how, backend=backend)
    inputs = [*sketch.tensors().values(), cameras.world_to_camera, cameras.intrinsics]
    loss = sum((_pick([0.0, 1.0, -1.0], g) * x).sum() for x in (image.color, image.alpha, image.depth))
    gradients = torch.autograd.grad(loss, inputs, allow_unused=True)
    wrong = [f"{n} has values from {x.min()} to {x.max()}" for n, x in _bounded(image).items() if _outside(x)]
    if not bool(image.depth.isfinite().all() and (image.depth >= 0).all()):
        wrong.append("depth is not finite or negative")
    names = [*sketch.tensors(), "world_to_camera", "intrinsics"]
    wrong += [
        f"gradient of {n} is NaN" for n, x in zip(names, gradients, strict=True) if x is not None and x.isnan().any()
    ]
    return "; ".join(wrong)


def _bounded(image) -> dict[str, torch.Tensor]:
    return {"color": image.color.detach(), "alpha": image.alpha.detach()}


def _outside(values: torch.Tensor) -> bool:
    """Not within [0, 1] up to rounding."""
    return not bool(((values >= -1e-5) & (values <= 1 + 1e-5)).all())
