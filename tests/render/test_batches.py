"""Many sketches in one call: pictures and gradients to the last bit as a loop's, on all backends."""

from dataclasses import replace

import pytest
import torch

from diff3ds import Cameras, Chains, MonteCarlo, Sketch, orbit, render, render_batch
from diff3ds.render.kernel_inputs import Batch

FIELDS = ("points", "weights", "width", "color", "opacity")


def sketch(count: int, seed: int, controls: int = 4, along: bool = False, **rest) -> Sketch:
    """Strokes with gradients everywhere; every second one closes a chain of two segments if `chains` is true."""
    generator = torch.Generator().manual_seed(seed)

    def numbers(*shape: int, low: float = 0.0, high: float = 1.0) -> torch.Tensor:
        return low + (high - low) * torch.rand(*shape, generator=generator, dtype=torch.float64)

    points, width = numbers(count, controls, 3, low=-0.8, high=0.8), numbers(count, low=0.02, high=0.1)
    given = {
        "points": points,
        "weights": numbers(count, controls, low=0.5, high=2.0),
        "width": width[:, None] * torch.linspace(1, 0, controls, dtype=torch.float64) if along else width,
        "color": numbers(count, 3),
        "opacity": numbers(count, low=0.3, high=0.9),
    }
    return Sketch(**{name: value.requires_grad_() for name, value in given.items()}, **rest)


def chained(seed: int) -> Sketch:
    """Three strokes of one, two and three segments, the last one closed."""
    chains = Chains.of([1, 2, 3], [False, False, True])
    plain = sketch(6, seed)
    points = chains.joined(plain.points.detach()).requires_grad_()
    rows = {name: getattr(plain, name).detach()[:3].requires_grad_() for name in ("width", "color", "opacity")}
    return Sketch(points, plain.weights, chains=chains, **rows)


def cameras(views: int, seed: int = 0, **rest) -> Cameras:
    return orbit([20.0 + 70 * k + 11 * seed for k in range(views)], [15.0] * views, 3.0, **{"size": (40, 37)} | rest)


BATCHES = {
    "sizes": lambda: ([sketch(n, n) for n in (3, 0, 17, 1)], [cameras(v, v) for v in (1, 2, 3, 2)]),
    "one view each": lambda: ([sketch(n, n) for n in (2, 5)], [cameras(1, 1), cameras(1, 2)]),
    "world": lambda: ([sketch(n, n, width_space="world") for n in (4, 2, 3)], [cameras(v, v) for v in (2, 1, 3)]),
    "along": lambda: ([sketch(n, n, along=True) for n in (4, 2)], [cameras(v, v) for v in (1, 3)]),
    "world along": lambda: (
        [sketch(n, n, along=True, width_space="world") for n in (4, 2)],
        [cameras(v, v) for v in (3, 2)],
    ),
    "chains": lambda: ([chained(1), sketch(3, 2), chained(3)], [cameras(v, v) for v in (2, 1, 2)]),
    "kinds": lambda: (
        [sketch(3, 1), sketch(2, 2, controls=2), sketch(2, 3), sketch(2, 4, width_space="world"), sketch(1, 5)],
        [cameras(1), cameras(2), cameras(1, size=24), cameras(2), cameras(1, height=2.0)],
    ),
    "one camera for all": lambda: ([sketch(n, n) for n in (3, 2)], cameras(2)),
}


def moving(seen: Cameras) -> Cameras:
    """Cameras whose poses and intrinsics have gradients."""
    return replace(
        seen,
        world_to_camera=seen.world_to_camera.clone().requires_grad_(),
        intrinsics=seen.intrinsics.clone().requires_grad_(),
    )


def gradients(renderings, leaves):
    generator = torch.Generator().manual_seed(7)
    loss = torch.zeros(())
    for drawn in renderings:
        for image in (drawn.color, drawn.alpha, drawn.depth):
            loss = loss + (image * torch.rand(image.shape, generator=generator)).sum()
    return torch.autograd.grad(loss, leaves, allow_unused=True)


@pytest.mark.parametrize("name", BATCHES)
def test_a_batch_is_a_loop_to_the_last_bit(name, backend) -> None:
    sketches, given = BATCHES[name]()
    seen = moving(given) if isinstance(given, Cameras) else [moving(one) for one in given]
    each = [seen] * len(sketches) if isinstance(seen, Cameras) else seen
    cases = {id(one): one for one in each}.values()
    leaves = [getattr(s, field) for s in sketches for field in FIELDS]
    leaves += [getattr(c, field) for c in cases for field in ("world_to_camera", "intrinsics")]
    expected = [render(s, c, backend=backend) for s, c in zip(sketches, each, strict=True)]
    got = render_batch(sketches, seen, backend=backend)
    assert len(got) == len(expected)
    for one, other in zip(got, expected, strict=True):
        for field in ("color", "alpha", "depth"):
            assert torch.equal(getattr(one, field), getattr(other, field))
    for one, other in zip(gradients(got, leaves), gradients(expected, leaves), strict=True):
        assert (one is None) == (other is None)
        # Cameras of several sketches add up in another order.
        assert one is None or torch.equal(one, other) or (isinstance(seen, Cameras) and torch.allclose(one, other))


def test_backgrounds_of_a_batch(kernels) -> None:
    sketches, seen = [sketch(2, 1), sketch(3, 2)], [cameras(2), cameras(2, 1)]
    for shape in ((3,), (40, 37, 3), (2, 1, 1, 3)):
        background = torch.rand(shape, dtype=torch.float64, requires_grad=True)
        loop = [render(s, c, background=background, backend=kernels) for s, c in zip(sketches, seen, strict=True)]
        batch = render_batch(sketches, seen, background=background, backend=kernels)
        for one, other in zip(batch, loop, strict=True):
            assert torch.equal(one.color, other.color)
        torch.testing.assert_close(gradients(batch, [background]), gradients(loop, [background]))


def test_samples_of_a_batch_are_those_of_a_loop() -> None:
    sketches, seen = [sketch(2, 1), sketch(3, 2)], cameras(1)

    def how():
        return MonteCarlo(samples=4, generator=torch.Generator().manual_seed(3))

    loop = how()
    expected = [render(s, seen, antialiasing=loop).color for s in sketches]
    got = render_batch(sketches, seen, antialiasing=how())
    assert all(torch.equal(one.color, other) for one, other in zip(got, expected, strict=True))


def test_halves_in_a_batch_are_drawn_in_float32(kernels) -> None:
    sketches = [sketch(n, n).to(torch.float16) for n in (2, 3)]
    got = render_batch(sketches, cameras(1).to(torch.float16), backend=kernels)
    expected = [render(s, cameras(1).to(torch.float16), backend=kernels) for s in sketches]
    assert got[0].color.dtype == torch.float16
    assert all(torch.equal(one.color, other.color) for one, other in zip(got, expected, strict=True))


def test_what_is_wrong_in_a_batch_names_the_sketch() -> None:
    good = sketch(2, 1)
    with pytest.raises(ValueError, match="as many cameras as sketches, 2, or one for all, got 1"):
        render_batch([good, good], [cameras(1)])
    bad = sketch(3, 2)
    with torch.no_grad():
        bad.width[1] = -1.0
    with pytest.raises(ValueError, match="sketch 2 of the batch: width of stroke 1 must be finite and not negative"):
        render_batch([good, good, bad], cameras(1))
    with pytest.raises(ValueError, match="sketch 0 of the batch: background must broadcast"):
        render_batch([good, good], cameras(1), background=torch.rand(3, 1, 1, 3, dtype=torch.float64))
    assert render_batch([], cameras(1)) == []


def test_tables_that_do_not_fit_are_refused() -> None:
    from diff3ds.render.antialiasing import Analytic
    from diff3ds.render.backends import kernels as compiled
    from diff3ds.render.kernel_inputs import of_sketches

    if compiled() is None:
        pytest.skip("no compiled kernels")
    sketches, seen = [sketch(2, 1), sketch(3, 2)], [cameras(1), cameras(2)]
    inputs = of_sketches(sketches, seen, torch.ones(1, 1, 1, 3, dtype=torch.float64), Analytic())
    from diff3ds.render import cpu

    for row, column in ((0, 1), (1, 1), (2, 1), (3, 2), (4, 2), (0, 2)):
        table = inputs.batch.table.clone()
        table[row, column] += 1
        with pytest.raises(ValueError, match="batch"):
            cpu.forward(inputs._replace(batch=Batch(table)), save=False)
