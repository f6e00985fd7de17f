"""A unit against its own past: since when it is another one, with a stated rate of false alarms.

The logs of a unit come by date. ``compare`` tests whether each differs from all before it, at the levels
1e-2 to 1e-6; errors of both hold what varies from log to log. While nothing changes it says so in at most the
share `level` of logs. So

    e = 1/2 + 1/2 · mean over levels of [differs at this level]/level

has at most the mean 1 given all before: it is a bet against "nothing has changed", at fair odds. The evidence
of a unit is M ← e·(1 + M) with each of its logs, from 0 (Shiryaev and Roberts' form of an e-detector: Shin,
Ramdas, Rinaldo 2022, as in ``powerball watch``). The sum of all units' M less the number of logs does not
grow on average, so the mean number of logs *of the fleet* until any M reaches ``quiet`` is ``quiet`` or more.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import List, Tuple

from .._errors import RefusedError
from ._fit import Fit, Json, Side, Variation, compare
from ._store import Row
from ._work import Growing, Job, fit_joined, joined

#: Where ``compare`` is asked.
LEVELS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)


@dataclass
class Past:
    """A unit over time."""

    unit: str
    #: The summary of its logs since it last changed, and how many these are.
    key: str
    count: int
    #: Their fit.
    fit: Fit
    #: Each change: ``since`` and ``seen``, a log and its date each, and ``comparison`` of after with before.
    changes: List[Json] = field(default_factory=list)


def past_of(job: Job, rows: List[Row], vary: Variation, level: float, quiet: float) -> Past:
    """Follows a unit through its usable logs, sorted by date."""
    starts, seen, fit = _segments(job, rows, vary, quiet)
    ends = [*starts[1:], len(rows)]
    parts = [[row["key"] for row in rows[start:end]] for start, end in zip(starts, ends)]
    fits = [fit_joined(job, part) for part in parts[:-1]] + [fit]
    changes = []
    for k in range(1, len(parts)):
        before, after = (
            vary.side(fits[i], len(parts[i]), name) for i, name in ((k - 1, "before"), (k, "after"))
        )
        since, alarm = rows[starts[k]], rows[seen[k - 1]]
        changes.append(
            {
                "since": {"log": since["log"], "date": since["date"]},
                "seen": {"log": alarm["log"], "date": alarm["date"]},
                "logs_before": len(parts[k - 1]),
                "logs_after": len(parts[k]),
                "comparison": compare(before, after, level),
            }
        )
    return Past(rows[0]["unit"], joined(job, parts[-1]), len(parts[-1]), fit, changes)


def _segments(job: Job, rows: List[Row], vary: Variation, quiet: float) -> Tuple[List[int], List[int], Fit]:
    """Where each stretch without a change begins, where each change was seen, the fit of the last stretch."""
    keys = [row["key"] for row in rows]
    starts: List[int] = [0]
    seen: List[int] = []
    growing, past = Growing(job, keys), Fit.of_row(rows[0])
    since, evidence = 0, 0.0
    for k in range(1, len(rows)):
        if evidence < 1.0:
            since = k
        count = k - starts[-1]
        evidence = (1.0 + evidence) * bet(
            vary.side(past, count, "past"), vary.side(Fit.of_row(rows[k]), 1, "log")
        )
        if evidence >= quiet:
            starts.append(since)
            seen.append(k)
            evidence, growing = 0.0, Growing(job, keys[since:])
        past = growing.fit(k + 1 - starts[-1])
    return starts, seen, past


def bet(past: Side, new: Side) -> float:
    """What a bet of 1 that nothing has changed makes of a log: at most 1 on average while that is true."""
    won = 0.0
    for level in LEVELS:
        try:
            differ = compare(past, new, level)["differ"]
        except RefusedError:
            # They determine nothing that both have: no bet.
            return 1.0
        if not differ:
            # What does not differ at one level does not at a stricter one.
            break
        won += 1.0 / level
    return 0.5 + 0.5 * won / len(LEVELS)
