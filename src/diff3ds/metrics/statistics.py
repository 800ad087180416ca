"""Means with intervals, paired tests and agreement of the marks of a study."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Of confidence intervals.
LEVEL = 0.95


@dataclass(frozen=True)
class Mean:
    """A mean over participants, and half of its 95 % confidence interval; None of a single one."""

    value: float
    margin: float | None
    count: int


def mean_of(values: Sequence[float]) -> Mean:
    """The mean of independent values, with the interval of Student's t."""
    from scipy import stats

    count, mean = len(values), math.fsum(values) / len(values)
    if count == 1:
        return Mean(mean, None, 1)
    error = float(np.std(values, ddof=1)) / math.sqrt(count)
    return Mean(mean, float(stats.t.ppf((1 + LEVEL) / 2, count - 1)) * error, count)


def signed_rank(first: Sequence[float], second: Sequence[float]) -> float:
    """The p value, two-sided, of Wilcoxon's signed-rank test of paired values; 1 where all pairs are equal."""
    from scipy import stats

    # Means of the same marks may differ by rounding only.
    differences = np.round(np.subtract(first, second), 9)
    if not differences.any():
        return 1.0
    # Exact where there are few pairs and no ties, else by the normal distribution.
    rest = np.abs(differences[differences != 0])
    exact = len(rest) <= 50 and len(np.unique(rest)) == len(rest) == len(differences)
    return float(stats.wilcoxon(differences, method="exact" if exact else "approx").pvalue)


def holm(values: Sequence[float]) -> list[float]:
    """P values of several tests, corrected by Holm's method."""
    order = sorted(range(len(values)), key=values.__getitem__)
    corrected, greatest = [0.0] * len(values), 0.0
    for rank, index in enumerate(order):
        greatest = max(greatest, min(1.0, (len(values) - rank) * values[index]))
        corrected[index] = greatest
    return corrected


def agreement(marks: NDArray[np.float64]) -> float | None:
    """Krippendorff's alpha for intervals: 1 is perfect, 0 is chance; None where all marks are the same.

    Args:
        marks: (participants, sketches), NaN where one gave none.
    """
    # Sketches with fewer than two marks say nothing.
    units = [column[~np.isnan(column)] for column in marks.T]
    units = [unit for unit in units if len(unit) >= 2]
    if not units:
        return None
    every = np.concatenate(units)
    within = sum(_squares(unit) / (len(unit) - 1) for unit in units) / len(every)
    expected = _squares(every) / (len(every) * (len(every) - 1))
    return None if expected == 0 else 1 - float(within / expected)


def _squares(values: NDArray[np.float64]) -> float:
    """The squared differences of all ordered pairs, summed."""
    return float(2 * len(values) * ((values - values.mean()) ** 2).sum())
