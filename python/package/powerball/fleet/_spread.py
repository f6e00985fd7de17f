"""How much a number varies beyond the errors of its estimates: between units, and from log to log.

Random effects: estimate k has the variance v_k of its fit and a variance T that all share. T is Paule and
Mandel's (1982, J. Res. Natl. Bur. Stand. 87, 377): what makes the sum of (y_k - m)²/(v_k + T) its
expectation, K - 1, with m the weighted mean. It needs no normal distribution of the effects and has less bias
than DerSimonian and Laird's where T is large (Veroniki et al. 2016, Res. Synth. Methods 7, 55).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Callable, List, Sequence, Tuple

import numpy as np

from .._arrays import Array

#: The median of a squared standard normal variable.
_MEDIAN = NormalDist().inv_cdf(0.75) ** 2
#: Terms are cut here where a few may be of another distribution: two standard deviations.
_CUT = 4.0
#: The mean of a squared standard normal variable that is cut there.
_CUT_MEAN = math.erf(math.sqrt(2)) - 4 * NormalDist().pdf(2) + _CUT * 2 * (1 - NormalDist().cdf(2))


@dataclass(frozen=True)
class Spread:
    """A variance over and above that of the fits."""

    #: The weighted mean of the estimates.
    mean: float
    #: Standard error of the mean, with the spread in it.
    mean_std: float
    #: Standard deviation T^½ in the number's unit; 0 where the fits' errors explain all differences.
    deviation: float
    #: 95 % interval of the standard deviation (Q profile).
    interval: Tuple[float, float]
    #: Degrees of freedom of T.
    freedom: float


def between(values: Sequence[float], variances: Sequence[float]) -> Spread:
    """The spread of units that are like each other; two at least."""
    y, v = np.asarray(values), np.asarray(variances)
    left = len(y) - 1.0

    def sum_of(t: float) -> float:
        return float(np.sum((y - _mean(y, v + t)) ** 2 / (v + t)))

    t = _root(sum_of, left, y, v)
    low, high = (_root(sum_of, chi_square(p, left), y, v) for p in (0.975, 0.025))
    mean, weight = _mean(y, v + t), float(np.sum(1 / (v + t)))
    return Spread(mean, weight**-0.5, math.sqrt(t), (math.sqrt(low), math.sqrt(high)), left)


def robust_between(values: Sequence[float], variances: Sequence[float]) -> Spread:
    """As well, where a few of them may be anywhere: the median of the terms is its expectation."""
    y, v = np.asarray(values), np.asarray(variances)
    left = len(y) - 1.0
    middle = float(np.median(y))
    t = _root(lambda t: float(np.median((y - middle) ** 2 / (v + t))), _MEDIAN, y, v)
    weight = float(np.sum(1 / (v + t)))
    return Spread(middle, weight**-0.5, math.sqrt(t), (0.0, math.inf), left)


def within(series: Sequence[Tuple[Sequence[float], Sequence[float]]]) -> Tuple[float, float]:
    """The variance from log to log over all units, and its degrees of freedom.

    ``series`` has the values and variances of each unit in the order of their dates. Differences of
    successive logs count, each cut at two deviations, so that neither a change nor a drift makes it large.
    """
    steps: List[float] = []
    variances: List[float] = []
    for values, errors in series:
        steps += list(np.diff(values) ** 2)
        variances += [a + b for a, b in zip(errors[:-1], errors[1:])]
    if not steps:
        return 0.0, 0.0
    d, v = np.asarray(steps), np.asarray(variances)
    t = _root(lambda t: _cut_sum(d, v + t), _CUT_MEAN * len(d), np.sqrt(d), v)
    # Successive differences have a log in common: two of three are independent.
    return 0.5 * t, max(1.0, 2.0 * len(d) / 3.0)


def chi_square(p: float, freedom: float) -> float:
    """The quantile of χ² (Wilson and Hilferty 1931; within 1 % from 3 degrees of freedom)."""
    a = 2.0 / (9.0 * freedom)
    return freedom * max(0.0, 1.0 - a + NormalDist().inv_cdf(p) * math.sqrt(a)) ** 3


def _mean(y: Array, v: Array) -> float:
    return float(np.sum(y / v) / np.sum(1 / v))


def _cut_sum(squares: Array, v: Array) -> float:
    return float(np.sum(np.minimum(squares / v, _CUT)))


def _root(falling: Callable[[float], float], target: float, y: Array, v: Array) -> float:
    """Where a sum that falls with T is its expectation; 0 where it is less without any T."""
    low = 1e-12 * float(np.min(v))
    if falling(low) <= target:
        return 0.0
    high = float(np.max(v) + np.ptp(y) ** 2 + np.max(np.abs(y)) ** 2)
    while falling(high) > target:
        high *= 4.0
    for _ in range(200):
        # On a scale of ratios: T may be far smaller than its bound.
        middle = math.sqrt(low * high)
        low, high = (middle, high) if falling(middle) > target else (low, middle)
        if high < low * (1 + 1e-12):
            break
    return high
