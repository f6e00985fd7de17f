"""What is known of each log: a row of Parquet, written once.

DIR/parts/KEY.parquet        one row, as soon as a log is done
DIR/logs/NAME.parquet        rows of finished runs
DIR/summaries/KEY.summary    a log, or several, as `powerball summarize` writes them
DIR/known/NAME.txt           keys of logs that the present run need not compute again
"""

from __future__ import annotations

import functools
import io
import uuid
from typing import Any, Dict, FrozenSet, Iterable, List, Optional, Set

import pyarrow as pa
import pyarrow.parquet as parquet

from . import _files

Row = Dict[str, Any]

_TEXTS, _NUMBERS = pa.list_(pa.string()), pa.list_(pa.float64())

#: One row a log. A log that could not be read has `verdict` "failed" and no numbers.
SCHEMA = pa.schema(
    [
        ("key", pa.string()),  # of content, arm file, options and version
        ("setup", pa.string()),  # the same without the content
        ("hash", pa.string()),  # SHA-256 of the content
        ("log", pa.string()),
        ("size", pa.int64()),  # bytes
        ("stamp", pa.string()),  # changes when the file does
        ("unit", pa.string()),
        ("date", pa.string()),  # ISO 8601
        ("seconds", pa.float64()),
        ("verdict", pa.string()),  # "usable", "should not be used" or "failed"
        ("reasons", _TEXTS),
        ("warnings", _TEXTS),
        ("parameters", _TEXTS),  # the minimal set
        ("values", _NUMBERS),  # SI units
        ("std", _NUMBERS),  # standard errors; null where the log does not determine one
        ("friction", pa.list_(_NUMBERS)),  # gamma1 to gamma5 of each joint
        ("covariance", _NUMBERS),  # parameters, then friction: lower triangle by rows
        ("freedom", _NUMBERS),  # degrees of freedom of each coefficient's standard error
        ("identified", pa.string()),  # identified.json
        ("path", pa.string()),  # of covariance.json: the log in the eyes of the model
    ]
)

#: Files with fewer rows are joined at the end of a run.
FULL = 1000


class Store:
    """The folder of a fleet, here or in an object store."""

    def __init__(self, url: str) -> None:
        self.url = url.rstrip("/")

    def add(self, row: Row) -> None:
        """A log's row, as a file of its own."""
        _files.write(f"{self.url}/parts/{row['key']}.parquet", _parquet([row]))

    def rows(self, setup: str, columns: Optional[List[str]] = None) -> List[Row]:
        """All rows of one setup by unit, date and name: one a key, though several files may have it."""
        by_key: Dict[str, Row] = {}
        needed = (
            None if columns is None else sorted({*columns, "key", "setup", "verdict", "unit", "date", "log"})
        )
        for file in self._tables():
            for row in self._read(file, needed):
                if row["setup"] == setup:
                    _keep(by_key, row)
        return sorted(by_key.values(), key=_order)

    def compact(self) -> None:
        """Joins the rows of small files. A stop at any moment loses nothing: what was joined goes last."""
        small: List[str] = []
        by_key: Dict[str, Row] = {}
        for file in self._tables():
            rows = self._read(file)
            if len(rows) < FULL:
                small.append(file)
                for row in rows:
                    _keep(by_key, row)
        if len(small) < 2 and not any(file.startswith("parts/") for file in small):
            return
        name = (
            f"logs/{_files.key_of(*sorted(by_key), *(by_key[k]['verdict'] for k in sorted(by_key)))}.parquet"
        )
        _files.write(f"{self.url}/{name}", _parquet(sorted(by_key.values(), key=_order)))
        for file in small:
            if file != name:
                _files.remove(f"{self.url}/{file}")

    def write_known(self, keys: Iterable[str]) -> str:
        """Writes the keys that workers of one run need not compute again; gives the file."""
        file = f"{self.url}/known/{uuid.uuid4().hex}.txt"
        _files.write(file, "\n".join(sorted(keys)).encode())
        return file

    def summary(self, key: str) -> str:
        """The file of a summary."""
        return f"{self.url}/summaries/{key}.summary"

    def _tables(self) -> List[str]:
        return [
            f"{folder}/{name}"
            for folder in ("logs", "parts")
            for name in _files.names(f"{self.url}/{folder}", ".parquet")
        ]

    def _read(self, file: str, columns: Optional[List[str]] = None) -> List[Row]:
        table = parquet.read_table(io.BytesIO(_files.read(f"{self.url}/{file}")), columns=columns)
        rows: List[Row] = table.to_pylist()
        return rows


def known_keys(rows: Iterable[Row], retry: bool) -> Set[str]:
    """The keys of what is done; with ``retry`` what failed is not."""
    return {row["key"] for row in rows if not (retry and row["verdict"] == "failed")}


@functools.lru_cache(maxsize=4)
def read_known(file: str) -> FrozenSet[str]:
    """The keys that ``Store.write_known`` wrote, read once in each process."""
    return frozenset(_files.read(file).decode().split())


def table_of(rows: List[Row], schema: pa.Schema) -> bytes:
    """Rows as a file of Parquet."""
    out = io.BytesIO()
    parquet.write_table(pa.Table.from_pylist(rows, schema=schema), out, compression="zstd")
    return out.getvalue()


def _parquet(rows: List[Row]) -> bytes:
    return table_of(rows, SCHEMA)


def _order(row: Row) -> Any:
    return (row["unit"] or "", row["date"] or "", row["log"], row["key"])


def _keep(by_key: Dict[str, Row], row: Row) -> None:
    """What was tried again with success counts."""
    if row["key"] not in by_key or by_key[row["key"]]["verdict"] == "failed":
        by_key[row["key"]] = row
