"""What a worker does: a log into the store, a fit of several."""

from __future__ import annotations

import functools
import hashlib
import os
import tempfile
import time
from dataclasses import dataclass, field
from typing import Any, Dict, FrozenSet, List, Optional, Sequence

import fsspec

from .._errors import Error
from ..arm import Arm
from ..identification import identify
from ..summary import Summary, summarize
from . import _files
from ._fit import Fit
from ._logs import Found, Rule, date_of, unit_of
from ._store import SCHEMA, Row, Store


@dataclass(frozen=True)
class Job:
    """What is the same for every log."""

    #: The text of the arm file.
    arm: str
    #: The folder of the results, as fsspec names it.
    store: str
    #: The package's version: another one computes all logs again.
    version: str
    #: How columns are read: lines as ``powerball --map`` takes them.
    map: Sequence[str] = ()
    #: How unit and date are found.
    rule: Rule = field(default_factory=Rule)

    @property
    def setup(self) -> str:
        """A name for all of this but the store's place."""
        return _files.key_of(self.arm, self.version, *self.map, repr(self.rule))


@dataclass(frozen=True)
class Outcome:
    """What became of a log."""

    log: str
    key: str
    #: "usable", "should not be used", "failed", or "known": the store has a log of the same content.
    verdict: str
    #: Seconds of work, bytes of the log and of its summary, and who did it.
    seconds: float
    bytes: int
    summary: int
    worker: str


@functools.lru_cache(maxsize=4)
def arm_of(text: str) -> Arm:
    """An arm, read once in each process."""
    return Arm.from_toml(text)


def reduce_log(job: Job, found: Found, known: FrozenSet[str], worker: Optional[str] = None) -> Outcome:
    """One log into the store: its fit and its summary, or why there is none."""
    start, store, size = time.perf_counter(), Store(job.store), 0
    row: Row = {name: None for name in SCHEMA.names}
    row.update(setup=job.setup, log=found.log, size=found.size, stamp=found.stamp, date=found.written)
    try:
        fs, name = fsspec.url_to_fs(found.log)
        with tempfile.TemporaryDirectory() as folder:
            # A file elsewhere is fetched: readers want to seek.
            here = name if "file" in fs.protocol else os.path.join(folder, os.path.basename(name))
            if here != name:
                fs.get_file(name, here)
            row["hash"] = _hash(here)
            row["key"] = _files.key_of(job.setup, row["hash"])
            if row["key"] in known:
                return _outcome(row, "known", start, 0, worker)
            row["unit"] = unit_of(job.rule, found.log, here)
            row["date"] = date_of(job.rule, found, here)
            summary = summarize(arm_of(job.arm), here, map=list(job.map) or None)
        model = identify(arm_of(job.arm), summary)
        row.update(Fit.of(model).columns(), seconds=summary.seconds)
        row["warnings"] = [*summary.warnings, *row["warnings"]]
        data = summary.to_bytes()
        size = len(data)
        # Before the row, which says that it is there.
        _files.write(store.summary(row["key"]), data)
    except (Error, OSError) as why:
        row.update(verdict="failed", reasons=[str(why)])
    row["key"] = row["key"] or unread(job, found)
    store.add(row)
    return _outcome(row, row["verdict"], start, size, worker)


def failed_row(job: Job, found: Found, why: str) -> Row:
    """The row of a log that ended its worker."""
    row: Row = {name: None for name in SCHEMA.names}
    row.update(key=unread(job, found), setup=job.setup, log=found.log, size=found.size, stamp=found.stamp)
    row.update(date=found.written, verdict="failed", reasons=[why])
    return row


def unread(job: Job, found: Found) -> str:
    """The key of a log of which the content is not known."""
    return _files.key_of(job.setup, found.log, found.stamp)


def joined(job: Job, keys: Sequence[str]) -> str:
    """The key of some summaries of the store as one, which is made where it is missing."""
    if len(keys) == 1:
        return keys[0]
    store, key = Store(job.store), _files.key_of(job.setup, *keys)
    if not _files.exists(store.summary(key)):
        _files.write(store.summary(key), join(job, keys).to_bytes())
    return key


def join(job: Job, keys: Sequence[str]) -> Summary:
    """Some summaries of the store as one, read one by one."""
    store = Store(job.store)
    whole = Summary.from_bytes(_files.read(store.summary(keys[0])))
    for key in keys[1:]:
        part = Summary.from_bytes(_files.read(store.summary(key)))
        whole = summarize(arm_of(job.arm), [whole, part])
    return whole


def fit_of(job: Job, summary: Summary) -> Fit:
    """The fit of a summary."""
    return Fit.of(identify(arm_of(job.arm), summary))


def fit_joined(job: Job, keys: List[str]) -> Fit:
    """The fit of some summaries of the store."""
    return fit_of(job, join(job, keys))


def _hash(file: str) -> str:
    digest = hashlib.sha256()
    with open(file, "rb") as opened:
        while block := opened.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def _outcome(row: Dict[str, Any], verdict: str, start: float, size: int, worker: Optional[str]) -> Outcome:
    seconds = time.perf_counter() - start
    return Outcome(row["log"], row["key"], verdict, seconds, row["size"], size, worker or _worker())


def _worker() -> str:
    from dask.distributed import get_worker

    try:
        return str(get_worker().address)
    except ValueError:
        return "here"
