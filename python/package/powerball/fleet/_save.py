"""The files of a report, next to the store's own."""

from __future__ import annotations

import json
from typing import Optional, Sequence

import pyarrow as pa

from .. import __version__
from .._arrays import PathLike
from . import _files
from ._fit import Json
from ._logs import Rule
from ._page import page
from ._report import events, to_json
from ._run import Judged
from ._store import table_of
from ._work import Job, arm_of

_EVENTS = pa.schema(
    [(name, pa.string()) for name in ("unit", "since", "since_log", "seen", "seen_log", "what")]
    + [("causes", pa.list_(pa.string()))]
)


def job(arm_file: PathLike, store: str, map: Sequence[str] = (), rule: Optional[Rule] = None) -> Job:
    """What is done with every log. Raises: ``InputError`` where the arm file cannot be used."""
    with open(arm_file, encoding="utf-8") as file:
        made = Job(file.read(), store.rstrip("/"), __version__, tuple(map), rule or Rule())
    arm_of(made.arm)
    return made


def save(job: Job, judged: Judged) -> Json:
    """Writes fleet.json, fleet.html, events.parquet, and identified.json of all logs; gives fleet.json."""
    report = to_json(judged)
    _files.write(f"{job.store}/events.parquet", table_of(events(report), _EVENTS))
    _files.write(f"{job.store}/identified.json", _text(judged.whole.identified))
    _files.write(f"{job.store}/covariance.json", _text(judged.whole.covariance))
    _files.write(f"{job.store}/fleet.html", page(report, judged).encode())
    _files.write(f"{job.store}/fleet.json", _text(report))
    return report


def _text(parsed: Json) -> bytes:
    return json.dumps(parsed, indent=1, ensure_ascii=False).encode()
