"""Which logs there are, and of which unit and date each is."""

from __future__ import annotations

import csv
import os
import re
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import Any, List, Optional, Sequence

import fsspec

from .._errors import InputError

#: Files of a folder that are logs, by the end of their names.
SUFFIXES = (".csv", ".parquet", ".mcap", ".db3", ".bag", ".npz", ".mat", ".h5", ".hdf5")

#: The name of the folder that a log is in.
UNIT = r"([^/\\]+)[/\\][^/\\]+$"

#: A day in the log's path, 2026-03-14 or 20260314, perhaps with a time of day: 2026-03-14T09:30:00.
DATE = r"(?<!\d)((?:19|20)\d\d-?[01]\d-?[0-3]\d(?:[T_ -]?[0-2]\d[:h.-]?[0-5]\d(?:[:m.-]?[0-5]\d)?)?)(?!\d)"


@dataclass(frozen=True)
class Rule:
    """How unit and date of a log are found.

    A column wins over the path. A log of which the path has no date is of the date of its file.
    """

    #: A regular expression that is searched in the path; its first group is the unit.
    unit: str = UNIT
    #: As well; its first group is the date. Of several matches the last counts.
    date: str = DATE
    #: A column of CSV and Parquet logs: its first value is the unit.
    unit_column: Optional[str] = None
    #: As well for the date: a text as ``2026-03-14 09:30:00``, or Unix time in s.
    date_column: Optional[str] = None


@dataclass(frozen=True)
class Found:
    """A log that is there."""

    #: Its path or address.
    log: str
    #: Bytes.
    size: int
    #: What changes when the file does.
    stamp: str
    #: When the file was written, UTC, as ISO 8601; empty where its place does not say.
    written: str


def find(logs: Sequence[str]) -> List[Found]:
    """All logs of some files, folders and patterns, sorted by name.

    Raises: ``InputError`` where one of these is not there.
    """
    found = {}
    for given in logs:
        fs, name = fsspec.url_to_fs(given)
        fs.invalidate_cache()
        for path in _expanded(fs, name, given):
            entry = _entry(fs, path)
            found[entry.log] = entry
    return [found[log] for log in sorted(found)]


def _expanded(fs: Any, name: str, given: str) -> List[str]:
    if fs.isdir(name):
        inside = [path for path in fs.find(name) if path.lower().endswith(SUFFIXES)]
        if not inside:
            raise InputError(f"{given}: no log in this folder (files that end in {' '.join(SUFFIXES)})")
        return inside
    if fs.exists(name):
        return [name]
    try:
        matching = (
            [path for path in fs.glob(name) if not fs.isdir(path)] if re.search(r"[*?\[]", name) else []
        )
    except ValueError as why:
        raise InputError(f"{given}: {why}") from None
    if not matching:
        raise InputError(f"{given}: no such log")
    return matching


def _entry(fs: Any, path: str) -> Found:
    # Not fs.ukey: S3 tells more of a file by itself than in a listing.
    info = fs.info(path)
    tags = ("ETag", "etag", "md5Hash", "mtime", "created")
    stamp = next((str(info[tag]) for tag in tags if info.get(tag)), None)
    when = next(
        (info[tag] for tag in ("mtime", "LastModified", "last_modified", "created") if info.get(tag)), ""
    )
    if isinstance(when, (int, float)):
        when = datetime.fromtimestamp(when, timezone.utc)
    written = (
        when.astimezone(timezone.utc).strftime("%Y-%m-%dT%H:%M:%S") if isinstance(when, datetime) else ""
    )
    log = path if "file" in fs.protocol else fs.unstrip_protocol(path)
    return Found(log, int(info["size"]), stamp or str(fs.ukey(path)), written)


def unit_of(rule: Rule, log: str, file: str) -> str:
    """The unit of a log; ``file`` is where it can be read. Raises: ``InputError`` where nothing names it."""
    if rule.unit_column:
        return str(_first(file, rule.unit_column))
    match = re.search(rule.unit, log)
    if not match or not (match.group(1) if match.re.groups else match.group(0)):
        raise InputError(f"no unit: the pattern {rule.unit} is not in {log}; give another --unit-pattern")
    return match.group(1) if match.re.groups else match.group(0)


def date_of(rule: Rule, found: Found, file: str) -> str:
    """The date of a log as ISO 8601. Raises: ``InputError`` where a column's value is none."""
    if rule.date_column:
        value = _first(file, rule.date_column)
        date = _date(value)
        if not date:
            raise InputError(f"the column {rule.date_column} begins with {value!r}, which is no date")
        return date
    for match in reversed(list(re.finditer(rule.date, found.log))):
        date = _date(match.group(1) if match.re.groups else match.group(0))
        if date:
            return date
    return found.written


def _date(value: Any) -> str:
    """A date of text or Unix time as ISO 8601; empty where it is none."""
    if isinstance(value, datetime):
        return value.strftime("%Y-%m-%dT%H:%M:%S")
    text = str(value).strip()
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    # 20260314 is a day; Unix time has had nine digits since 1973 and ten since 2001.
    if 1e9 <= seconds < 1e11:
        return datetime.fromtimestamp(seconds, timezone.utc).strftime("%Y-%m-%dT%H:%M:%S")
    digits = re.sub(r"\D", "", text)[:14]
    form = {8: "%Y%m%d", 12: "%Y%m%d%H%M", 14: "%Y%m%d%H%M%S"}.get(len(digits))
    try:
        return datetime.strptime(digits, form).strftime("%Y-%m-%dT%H:%M:%S") if form else ""
    except ValueError:
        return ""


def _first(file: str, column: str) -> Any:
    """The first value of a column of a table."""
    what = os.path.basename(file)
    if file.lower().endswith(".parquet"):
        import pyarrow.parquet as parquet

        table = parquet.ParquetFile(file)
        names = table.schema_arrow.names
        if column in names:
            return next(table.iter_batches(1, columns=[column])).column(0)[0].as_py()
    elif file.lower().endswith(".csv"):
        with open(file, encoding="utf-8", newline="") as opened:
            rows = csv.reader(opened)
            names, values = (next(rows, []) for _ in range(2))
        if column in names and len(values) == len(names):
            return values[names.index(column)]
    else:
        raise InputError(f"{what}: columns for unit and date are read from CSV and Parquet")
    raise InputError(f"{what}: no value in a column {column}; columns are {', '.join(names)}")
