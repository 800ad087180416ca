"""Options of rendering as objects: the same pictures as by keywords, and what they refuse."""

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
    sketch, cameras = ds.Sketch(FIRST, width=0.1), ds.orbit([20.0, 100.0], size=(24, 31), distance=2.0)
    ways = (
        ds.render(sketch, cameras, backend=backend, **options()),
        ds.rasterize(ds.project(sketch, cameras), cameras.size, backend=backend, **options()),
    )
    return torch.stack([torch.cat([d.color, d.alpha[..., None], d.depth[..., None]], -1) for d in ways])


@pytest.mark.parametrize(
    ("by_object", "by_keywords"),
    [
        (lambda: ds.Analytic(), dict),
        (lambda: ds.Analytic(1.5), lambda: {"blur": 1.5}),
        (lambda: ds.Analytic(blur=2), lambda: {"antialiasing": "analytic", "blur": 2}),
        (lambda: ds.MonteCarlo(generator=seeded()), lambda: {"antialiasing": "montecarlo", "generator": seeded()}),
        (
            lambda: ds.MonteCarlo(9, seeded()),
            lambda: {"antialiasing": "montecarlo", "samples": 9, "generator": seeded(), "blur": 0.0},
        ),
    ],
)
def test_an_object_draws_what_its_keywords_draw(backend, by_object, by_keywords):
    drawn = pictures(backend, lambda: {"antialiasing": by_object()})
    assert torch.equal(drawn, pictures(backend, by_keywords))
    if by_object() != ds.Analytic():
        assert not torch.equal(drawn, pictures(backend, dict))


def test_a_generator_goes_on_from_drawing_to_drawing(backend):
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
        (lambda: ds.MonteCarlo(5), ValueError, "samples must be a square number from 1 to 4096, got 5"),
        (lambda: ds.MonteCarlo(4225), ValueError, "got 4225"),
        (lambda: ds.MonteCarlo(4.0), ValueError, "got 4.0"),
        (lambda: ds.MonteCarlo(generator=7), TypeError, "generator must be a torch.Generator, such as"),
    ],
)
def test_objects_are_checked_when_they_are_made(make, error, message):
    with pytest.raises(error, match=re.escape(message)):
        make()


@pytest.mark.parametrize(
    ("antialiasing", "keyword", "message"),
    [
        (
            ds.Analytic(1.5),
            {"blur": 1.5},
            "got blur= beside Analytic(blur=1.5): give it to the object, antialiasing=ds.Analytic(blur=...)",
        ),
        (ds.Analytic(), {"blur": 0.0}, "blur must be left out where antialiasing is an object"),
        (ds.Analytic(), {"samples": 4}, "give it to the object, antialiasing=ds.MonteCarlo(samples=...)"),
        (ds.MonteCarlo(), {"samples": 4}, "got samples= beside MonteCarlo(samples=4"),
        (ds.MonteCarlo(), {"generator": seeded()}, "antialiasing=ds.MonteCarlo(generator=...)"),
        (ds.MonteCarlo(), {"blur": 1.0}, "blur must be left out"),
    ],
)
def test_an_object_and_a_keyword_are_refused(antialiasing, keyword, message):
    sketch, cameras = ds.Sketch(FIRST), ds.orbit(0.0, size=8)
    for draw in (
        lambda **o: ds.render(sketch, cameras, **o),
        lambda **o: ds.rasterize(ds.project(sketch, cameras), 8, **o),
    ):
        with pytest.raises(ValueError, match=re.escape(message)):
            draw(antialiasing=antialiasing, **keyword)


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
