"""How pixels are averaged: `Analytic` or `MonteCarlo`, and the names that are short for them."""

import math
from dataclasses import dataclass
from numbers import Real
from typing import Literal

import torch

from diff3ds._checks import check_generator

MAX_SAMPLES = 4096


@dataclass(frozen=True)
class Analytic:
    """Antialiasing by the coverage of every pixel, computed from the distance to the strokes: without noise.

    Exact for strips along the axes; elsewhere within about .05 of a pixel's area along an edge, .09 for lines thinner
    than a pixel, but .25 at their round ends and .5 in cusps and hairpins of one stroke, where only the nearer part
    counts.

    Attributes:
        blur: standard deviation of a normal filter in pixels, below 1e6; gradients then reach 3.5 times as far beyond
            the strokes. 0 is the box of a pixel.

    Raises:
        ValueError: a blur that is no such number.
    """

    blur: float = 0.0

    def __post_init__(self) -> None:
        if not (isinstance(self.blur, Real) and 0 <= self.blur < 1e6):
            raise ValueError(f"blur must be a number of pixels from 0 to 1e6, got {self.blur}")


@dataclass(frozen=True)
class MonteCarlo:
    """Antialiasing by stratified random samples, the Diff3DS paper's estimator: noisy, unbiased in colour and alpha.

    Attributes:
        samples: samples per pixel, a square number from 1 to 4096.
        generator: source of the samples, on the CPU wherever the strokes are; every drawing draws anew from it. None
            is torch's default generator. A captured CUDA graph draws the samples of its capture in every replay.

    Raises:
        TypeError: a generator of another kind, such as a seed.
        ValueError: a number of samples that is no such square, or a generator that is not on the CPU.
    """

    samples: int = 4
    generator: torch.Generator | None = None

    def __post_init__(self) -> None:
        samples, generator = self.samples, self.generator
        if not (isinstance(samples, int) and 1 <= samples <= MAX_SAMPLES and math.isqrt(samples) ** 2 == samples):
            raise ValueError(f"samples must be a square number from 1 to {MAX_SAMPLES}, got {samples}")
        if generator is None:
            return
        check_generator(generator)
        if generator.device.type != "cpu":
            # To read its number would wait for the device, which a capture forbids.
            raise ValueError(
                f"generator must be on the CPU, wherever the strokes are, got one on {generator.device}: use "
                "torch.Generator().manual_seed(0)"
            )

    def seed(self) -> int:
        """A seed of 63 bits for one drawing: the next number of the generator."""
        return int(torch.randint(0, 2**63 - 1, (), generator=self.generator).item())


Antialiasing = Analytic | MonteCarlo | Literal["analytic", "montecarlo"]


def antialiasing_from(antialiasing: Antialiasing) -> Analytic | MonteCarlo:
    """The object that a name is short for.

    Raises:
        ValueError: neither an object nor a name.
    """
    if isinstance(antialiasing, Analytic | MonteCarlo):
        return antialiasing
    if not (isinstance(antialiasing, str) and antialiasing in ("analytic", "montecarlo")):
        expected = 'ds.Analytic(...), ds.MonteCarlo(...), "analytic" or "montecarlo"'
        raise ValueError(f"antialiasing must be {expected}, got {antialiasing!r}")
    return Analytic() if antialiasing == "analytic" else MonteCarlo()
