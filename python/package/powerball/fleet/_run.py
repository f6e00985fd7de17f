"""A run: what is new goes into the store, then all of the store is judged."""

from __future__ import annotations

import statistics
import time
from dataclasses import dataclass
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

import dask.distributed as dd

from . import _files
from ._fit import FAST, SLOW, Extra, Fit, Speeds, Variation
from ._logs import find
from ._past import Past, past_of
from ._spread import within
from ._store import Row, Store, known_keys
from ._type import FAN_IN, Typed, against_type
from ._work import Job, Outcome, failed_row, fit_joined, joined, reduce_log

#: Units that are like the others are called odd in this share of runs.
LEVEL = 0.01

#: Logs of the fleet between two false alarms, on average at least.
QUIET = 100_000.0


@dataclass
class Work:
    """What was done for the store."""

    #: Logs that were asked for, and how many of them the store had.
    found: int
    known: int
    #: Those that were not in it.
    outcomes: List[Outcome]
    #: Seconds from the first to the last of them.
    seconds: float


@dataclass
class Judged:
    """All logs of a store with this arm and these options."""

    rows: List[Row]
    units: List[Past]
    typed: Typed
    vary: Variation
    level: float
    quiet: float
    #: The fit of all usable logs together; its summary's key.
    whole: Fit
    whole_key: str


def update(client: dd.Client, job: Job, logs: Sequence[str], retry: bool = False) -> Work:
    """Brings logs into the store, as far as it has not got them.

    A log counts as done by its content: a copy under another name is not computed again. A stopped run loses
    what its workers were at, at most. ``retry``: logs that failed, again.

    Raises: ``InputError`` where a log is not there.
    """
    store = Store(job.store)
    found = find(logs)
    rows = store.rows(job.setup, ["key", "log", "size", "stamp", "verdict"])
    known = known_keys(rows, retry)
    done = {(row["log"], row["size"], row["stamp"]) for row in rows if row["key"] in known}
    todo = [one for one in found if (one.log, one.size, one.stamp) not in done]

    start = time.perf_counter()
    # Every worker reads this file once. Dask's `scatter` can lose what it shares (dask/distributed#3703).
    known_file = store.write_known(known)
    try:
        # A worker that dies takes its logs to another one; a log that kills every worker is given up.
        futures = {
            client.submit(reduce_log, job, one, known_file, pure=False, retries=1): one for one in todo
        }
        outcomes = []
        for future in dd.as_completed(futures):
            if future.status == "finished":
                outcomes.append(future.result())
            else:
                row = failed_row(job, futures[future], f"the worker ended: {future.exception()}")
                store.add(row)
                outcomes.append(Outcome(row["log"], row["key"], "failed", 0.0, row["size"], 0, "none"))
            future.release()
    finally:
        _files.remove(known_file)
    store.compact()
    again = sum(outcome.verdict == "known" for outcome in outcomes)
    new = [outcome for outcome in outcomes if outcome.verdict != "known"]
    return Work(len(found), len(found) - len(todo) + again, new, time.perf_counter() - start)


def judge(client: dd.Client, job: Job, level: float = LEVEL, quiet: float = QUIET) -> Optional[Judged]:
    """Judges all that the store has of this arm and these options: each unit against its type and its past.

    Nothing where no log of it is usable.
    """
    rows = Store(job.store).rows(job.setup)
    by_unit: Dict[str, List[Row]] = {}
    for row in rows:
        if row["verdict"] == "usable":
            by_unit.setdefault(row["unit"], []).append(row)
    if not by_unit:
        return None

    def mapped(function: Any, job: Job, arguments: Sequence[Any], **same: Any) -> List[Any]:
        futures = [client.submit(function, job, argument, pure=False, **same) for argument in arguments]
        gathered: List[Any] = client.gather(futures)
        return gathered

    vary = _from_log_to_log(by_unit)
    units: List[Past] = mapped(past_of, job, list(by_unit.values()), vary=vary, level=level, quiet=quiet)
    typed = against_type(job, units, vary, level, mapped)
    whole_key = _whole(job, [[row["key"] for row in own] for own in by_unit.values()], mapped)
    (whole,) = mapped(fit_joined, job, [[whole_key]])
    return Judged(rows, units, typed, vary, level, quiet, whole, whole_key)


def _from_log_to_log(by_unit: Mapping[str, List[Row]]) -> Variation:
    """The variance of each number from log to log of a unit."""
    fits = {unit: [Fit.of_row(row) for row in rows] for unit, rows in by_unit.items()}
    speeds = _speeds([fit for own in fits.values() for fit in own])
    series: Dict[str, List[Tuple[List[float], List[float]]]] = {}
    for one_unit in fits.values():
        own: Dict[str, Tuple[List[float], List[float]]] = {}
        for fit in one_unit:
            for name, number in fit.numbers(speeds).items():
                values, variances = own.setdefault(name, ([], []))
                values.append(number.value)
                variances.append(number.variance)
        for name, one in own.items():
            series.setdefault(name, []).append(one)
    return Variation({name: Extra(*within(all_units)) for name, all_units in series.items()}, speeds)


def _speeds(fits: Sequence[Fit]) -> Speeds:
    """Where friction is followed: shares of the median of the logs' rms velocities, by joint."""
    found = {}
    for joint in range(1, fits[0].covariance["joints"] + 1):
        known = [v for v in (fit.velocity(joint) for fit in fits) if v]
        if known:
            rms = statistics.median(known)
            found[joint] = (SLOW * rms, FAST * rms)
    return found


def _whole(job: Job, keys: List[List[str]], mapped: Any) -> str:
    """The key of all summaries joined, in a tree: a worker holds two at a time."""
    level = [key for own in keys for key in own]
    while len(level) > 1:
        level = mapped(joined, job, [level[k : k + FAN_IN] for k in range(0, len(level), FAN_IN)])
    return level[0]
