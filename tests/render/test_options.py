"""Options of rendering as objects: the same pictures as by names, and what they refuse."""

import re
from dataclasses import FrozenInstanceError

import pytest
import torch

import diff3ds as ds
from diff3ds.render.backends import kernels
from diff3ds.render.kernel_inputs import Options

FIRST = torch.tensor(
    [[[-0.5, -0.4, 0.0], [0.1, 0.5, 0.2], [0.5, -0.3, 0.1]], [[-0.6, 0.0, 0.3], [0, 0.1, 0], [0.6, 0, -0.3]]]
)


def seeded(seed=5):
    return torch.Generator().manual_seed(seed)


def pictures(backend, options):
    """All images of a sketch, drawn by `render` and, projected before, by `rasterize`."""
    sketch, cameras = ds.Sketch(FIRST, width=0.1), ds.orbit([20.0, 100.0], size=(12, 15), distance=2.0)
    ways = (
        ds.render(sketch, cameras, backend=backend, **options()),
        ds.rasterize(ds.project(sketch, cameras), cameras.size, backend=backend, **options()),
    )
    return torch.stack([torch.cat([d.color, d.alpha[..., None], d.depth[..., None]], -1) for d in ways])


def test_a_name_draws_what_its_object_draws(backend, antialiasing):
    drawn = []
    for how in (antialiasing, {"analytic": ds.Analytic, "montecarlo": ds.MonteCarlo}[antialiasing]()):
        torch.manual_seed(3)
        drawn.append(pictures(backend, lambda how=how: {"antialiasing": how}))
    assert torch.equal(*drawn)


OBJECTS = {"analytic": lambda: ds.Analytic(1.5), "montecarlo": lambda: ds.MonteCarlo(9, seeded())}


def test_an_object_draws_otherwise(backend, antialiasing):
    how = OBJECTS[antialiasing]
    drawn = pictures(backend, lambda: {"antialiasing": how()})
    assert torch.equal(drawn, pictures(backend, lambda: {"antialiasing": how()}))
    assert not torch.equal(drawn, pictures(backend, dict))


def test_a_generator_of_samples_goes_on_from_drawing_to_drawing(backend):
    how = ds.MonteCarlo(generator=seeded())
    first, second, again = (
        pictures(backend, lambda how=how: {"antialiasing": how})
        for how in (how, how, ds.MonteCarlo(generator=seeded()))
    )
    assert torch.equal(first, again)
    assert not torch.equal(first, second)


def test_without_a_generator_torch_draws():
    torch.manual_seed(3)
    first = ds.MonteCarlo().seed()
    torch.manual_seed(3)
    assert [ds.MonteCarlo().seed() == first for _ in range(2)] == [True, False]


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: ds.Analytic(-1.0), ValueError, "blur must be a number of pixels from 0 to 1e6, got -1.0"),
        (lambda: ds.Analytic(float("nan")), ValueError, "blur must be a number of pixels from 0 to 1e6, got nan"),
        (lambda: ds.Analytic(1e6), ValueError, "got 1000000.0"),
        (lambda: ds.Analytic(None), ValueError, "got None"),
        (lambda: ds.Analytic("wide"), ValueError, "got wide"),
        (lambda: ds.MonteCarlo(5), ValueError, "samples must be a square number from 1 to 4096, got 5"),
        (lambda: ds.MonteCarlo(0), ValueError, "got 0"),
        (lambda: ds.MonteCarlo(4225), ValueError, "got 4225"),
        (lambda: ds.MonteCarlo(4.0), ValueError, "got 4.0"),
        (lambda: ds.MonteCarlo(generator=7), TypeError, "generator must be a torch.Generator, such as"),
    ],
)
def test_objects_are_checked_when_they_are_made(make, error, message):
    with pytest.raises(error, match=re.escape(message)):
        make()


def test_objects_cannot_be_changed():
    with pytest.raises(FrozenInstanceError):
        ds.Analytic().blur = -1.0
    with pytest.raises(FrozenInstanceError):
        ds.MonteCarlo().samples = 5
    assert ds.Analytic(1.0) == ds.Analytic(1.0) != ds.Analytic(2.0)


@pytest.mark.skipif(kernels() is None, reason="no compiled kernels")
def test_the_kernels_take_options_by_name_only():
    """So that two languages need not agree on an order."""
    options = Options(world=False, orthographic=False, near=0.01, blur=0.0, strata=0, seed=0, width_scale=1.0)
    kernels().Options(**options._asdict())
    for wrong in (lambda: kernels().Options(*options), lambda: kernels().Options(**{**options._asdict(), "far": 1.0})):
        with pytest.raises(TypeError, match="incompatible function arguments"):
            wrong()
