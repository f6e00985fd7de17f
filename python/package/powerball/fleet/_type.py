"""A unit against its type: all other units, with what units of one type differ by.

The spread of each number between units is a variance T; it comes to the errors of the others' fit, once for
the unit itself and once, by their number, for their mean. ``compare`` then asks whether the unit differs from
what such units are. Units that do are no longer part of the type, and all are asked again, until the same
units differ twice. The first spread is one that a few odd units cannot widen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Mapping, Optional, Sequence, Set

from .._errors import RefusedError
from ._fit import Extra, Json, Number, Variation, compare
from ._past import Past
from ._spread import Spread, between, robust_between
from ._work import Job, fit_joined, joined

#: With fewer units that are like each other no spread between them is known.
LEAST = 4

#: Units whose summaries are joined to one, so that all units but one are few summaries.
FAN_IN = 16

#: Calls a function for each of some arguments, wherever it likes, and gives the results in their order.
Mapped = Callable[..., List[Any]]


@dataclass
class Typed:
    """All units against their type."""

    #: The spread between units of every number.
    spread: Dict[str, Spread]
    #: What compare says of each unit; none where there are too few.
    comparison: Dict[str, Json]


def against_type(job: Job, units: Sequence[Past], vary: Variation, level: float, mapped: Mapped) -> Typed:
    """Compares each unit with all others that are like each other."""
    numbers = {past.unit: vary.numbers(past.fit, past.count) for past in units}
    if len(units) < LEAST:
        return Typed({}, {})
    spread = _spreads(numbers, robust_between)
    tried: List[Set[str]] = []
    like = units
    while True:
        comparison = _compared(job, units, like, spread, vary, level, mapped, first=not tried)
        odd = {unit for unit, said in comparison.items() if said["differ"]}
        if odd in tried or len(units) - len(odd) < LEAST:
            return Typed(spread, comparison)
        tried.append(odd)
        like = [past for past in units if past.unit not in odd]
        spread = _spreads({past.unit: numbers[past.unit] for past in like}, between)


def _spreads(
    numbers: Mapping[str, Mapping[str, Number]], estimator: Callable[[List[float], List[float]], Spread]
) -> Dict[str, Spread]:
    found: Dict[str, Spread] = {}
    for name in {name: None for own in numbers.values() for name in own}:
        known = [own[name] for own in numbers.values() if name in own]
        if len(known) >= LEAST:
            found[name] = estimator([n.value for n in known], [n.variance for n in known])
    return found


def _compared(
    job: Job,
    units: Sequence[Past],
    like: Sequence[Past],
    spread: Mapping[str, Spread],
    vary: Variation,
    level: float,
    mapped: Mapped,
    first: bool,
) -> Dict[str, Json]:
    """Each unit with all of ``like`` but itself, at its share of the level (Bonferroni over units).

    ``first``: with all, itself among them, so that one fit does for every unit. Nothing is concluded of
    that but who is no part of the type when all are asked again.
    """
    groups = [like[k : k + FAN_IN] for k in range(0, len(like), FAN_IN)]
    wholes = mapped(_joined, job, [[past.key for past in group] for group in groups])
    # The one that several units have: made once.
    mapped(fit_joined, job, [wholes])
    arguments = []
    for past in units:
        others: List[str] = []
        for group, whole in zip(groups, wholes):
            apart = [other.key for other in group if other.unit != past.unit]
            others += [whole] if first or len(apart) == len(group) else apart
        logs = sum(other.count for other in like if other.unit != past.unit)
        count = sum(other.unit != past.unit for other in like)
        type_extra = {
            name: Extra(s.deviation**2 * (1.0 + 1.0 / count), s.freedom) for name, s in spread.items()
        }
        for name, more in vary.of_mean(logs).items():
            old = type_extra.get(name)
            type_extra[name] = Extra(more.variance + (old.variance if old else 0.0), (old or more).freedom)
        arguments.append((past, others, type_extra))
    said = mapped(_compare_one, job, arguments, vary=vary, level=level / len(units))
    return {past.unit: one for past, one in zip(units, said) if one}


def _joined(job: Job, keys: List[str]) -> str:
    return joined(job, keys)


def _compare_one(job: Job, argument: Any, vary: Variation, level: float) -> Optional[Json]:
    """What compare says of a unit; nothing where its logs determine nothing that the others' do."""
    past, others, type_extra = argument
    type_side = fit_joined(job, others).widened(type_extra, vary.speeds).side("type")
    try:
        return compare(type_side, vary.side(past.fit, past.count, past.unit), level)
    except RefusedError:
        return None


def surest(comparison: Optional[Json]) -> float:
    """How often a unit like the others would differ so in the number in which it differs most."""
    if comparison is None:
        return 1.0
    parts = [*comparison["parameters"], *comparison["friction"], *comparison["constants"]]
    return min((part["p_value"] for part in parts), default=1.0)
