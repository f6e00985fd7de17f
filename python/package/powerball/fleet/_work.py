"""What a worker does: a log into the store, a fit of several."""

from __future__ import annotations

import functools
import hashlib
import json
import os
import tempfile
import time
from dataclasses import dataclass, field
from typing import Any, Dict, Optional, Sequence

import fsspec

from .._errors import Error
from ..arm import Arm
from ..identification import Identified, identify
from ..summary import Summary, summarize
from . import _files
from ._fit import Fit
from ._logs import Found, Rule, date_of, unit_of
from ._store import SCHEMA, Row, Store, read_known

#: Summaries that are in memory together: each has three megabytes at most.
AT_ONCE = 32


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


def _fitted(job: Job, summary: Summary) -> Identified:
    """The fit of a summary, which never is of position servos."""
    found = identify(arm_of(job.arm), summary)
    assert isinstance(found, Identified)
    return found


def reduce_log(job: Job, found: Found, known_file: str) -> Outcome:
    """One log into the store: its fit and its summary, or why there is none.

    ``known_file``: the keys of logs that need not be computed again, as ``Store.write_known`` writes them.
    """
    start, store, size = time.perf_counter(), Store(job.store), 0
    # Not below: that this file cannot be read says nothing about the log.
    known = read_known(known_file)
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
                return _outcome(row, "known", start, 0)
            row["unit"] = unit_of(job.rule, found.log, here)
            row["date"] = date_of(job.rule, found, here)
            summary = summarize(arm_of(job.arm), here, map=list(job.map) or None)
        model = _fitted(job, summary)
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
    return _outcome(row, row["verdict"], start, size)


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


def join(job: Job, keys: Sequence[str], whole: Optional[Summary] = None) -> Summary:
    """Some summaries of the store as one, with ``whole`` where it is given; a few are in memory at once."""
    store = Store(job.store)
    for k in range(0, len(keys), AT_ONCE):
        parts = [Summary.from_bytes(_files.read(store.summary(key))) for key in keys[k : k + AT_ONCE]]
        parts = parts if whole is None else [whole, *parts]
        whole = parts[0] if len(parts) == 1 else summarize(arm_of(job.arm), parts)
    assert whole is not None
    return whole


class Growing:
    """Summaries of the store that are joined one after the other, and the fits of the first 1, 2, … of them.

    A fit that was made once is in the store; summaries are read only for those that are not.
    """

    def __init__(self, job: Job, keys: Sequence[str]) -> None:
        self.job, self.keys = job, list(keys)
        self.whole: Optional[Summary] = None
        self.have = 0

    def fit(self, count: int) -> Fit:
        """The fit of the first ``count``, which grows from call to call."""
        path = f"{self.job.store}/fits/{_files.key_of(self.job.setup, *self.keys[:count])}.json"
        if _files.exists(path):
            return Fit(*json.loads(_files.read(path)))
        self.whole = join(self.job, self.keys[self.have : count], self.whole)
        self.have = count
        fit = Fit.of(_fitted(self.job, self.whole))
        _files.write(path, json.dumps([fit.identified, fit.covariance]).encode())
        return fit


def fit_joined(job: Job, keys: Sequence[str]) -> Fit:
    """The fit of some summaries of the store."""
    return Growing(job, keys).fit(len(keys))


def _hash(file: str) -> str:
    digest = hashlib.sha256()
    with open(file, "rb") as opened:
        while block := opened.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def _outcome(row: Dict[str, Any], verdict: str, start: float, size: int) -> Outcome:
    seconds = time.perf_counter() - start
    return Outcome(row["log"], row["key"], verdict, seconds, row["size"], size, _worker())


def _worker() -> str:
    from dask.distributed import get_worker

    try:
        return str(get_worker().address)
    except ValueError:
        return "here"
