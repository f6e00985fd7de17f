"""``python -m powerball.fleet``."""

from __future__ import annotations

import argparse
import json
import re
import sys
from typing import List, Optional

from .._errors import Error

DESCRIPTION = """\
Reduces logs of many arms of one type, keeps what they say in a store, and compares each arm (unit) with its
type, which is all others, and with its own past. Odd units come first.

LOGS are files, folders (logs in them at any depth), patterns in quotes, or addresses that fsspec reads (s3://,
gs://). --store is a folder or such an address. A log is computed once: run again with more logs, or after a
stop, it goes on where it was. A log that cannot be used is listed with its reason, and the others go on.

The unit of a log is the name of its folder. Its date is the last one in its path (2026-03-14 or 20260314,
perhaps with a time), else that of the file. --unit-pattern, --date-pattern, --unit-column and --date-column
say otherwise.
"""

EPILOG = """\
example:
  python -m powerball.fleet logs/ --arm arm.toml --store fleet
  python -m powerball.fleet 's3://bucket/logs/**/*.mcap' --arm arm.toml --store s3://bucket/fleet \\
      --scheduler tcp://head:8786 --unit-pattern 'robot-([0-9]+)'

files in the store:
  fleet.html, fleet.json  each unit against its type and its past; spread between units
  events.parquet          changes of units
  identified.json         the fit of all usable logs together
  logs/*.parquet          one row a log: unit, date, hash, parameters with covariance, friction, verdict
  summaries/*.summary     each log as `powerball summarize` writes it

exit codes:
  0  done, also where units are odd
  2  wrong use, or an input that cannot be read
  3  no log gave a usable result
"""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(
        prog="python -m powerball.fleet",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.add_argument("logs", nargs="+", metavar="LOGS", help="files, folders, patterns or addresses")
    made.add_argument("--arm", required=True, metavar="ARM.toml", help="the arm file")
    made.add_argument("--store", required=True, metavar="DIR", help="where results are kept")
    made.add_argument(
        "--map", action="append", default=[], help="as powerball --map takes it; may be repeated"
    )
    made.add_argument("--unit-pattern", metavar="REGEX", help="its first group is the unit")
    made.add_argument("--date-pattern", metavar="REGEX", help="its first group is the date")
    made.add_argument("--unit-column", metavar="NAME", help="a column whose first value is the unit")
    made.add_argument("--date-column", metavar="NAME", help="as well for the date, or Unix time in s")
    made.add_argument("--workers", type=int, default=2, metavar="N", help="started here (default 2)")
    made.add_argument("--scheduler", metavar="ADDRESS", help="a Dask cluster in place of workers here")
    made.add_argument("--retry", action="store_true", help="logs that failed, again")
    made.add_argument(
        "--level",
        type=float,
        default=0.01,
        help="share of reports in which any of equal units is called different (default 0.01)",
    )
    made.add_argument(
        "--quiet-logs",
        type=float,
        default=1e5,
        metavar="N",
        help="logs of the fleet between two false changes, on average at least (default 100000)",
    )
    made.add_argument("--json", action="store_true", help="print fleet.json")
    return made


def main(arguments: Optional[List[str]] = None) -> int:
    """Runs the command; its exit code."""
    made = parser()
    given = made.parse_args(arguments)
    if given.workers < 1 or not 0 < given.level < 1 or given.quiet_logs < 1:
        made.error("--workers and --quiet-logs must be at least 1, --level between 0 and 1")
    for pattern in (given.unit_pattern, given.date_pattern):
        try:
            re.compile(pattern or "")
        except re.error as why:
            made.error(f"{pattern} is no regular expression: {why}")
    try:
        return _run(given)
    except (Error, OSError, ImportError) as why:
        print(f"error: {why}", file=sys.stderr)
        return 2


def _run(given: argparse.Namespace) -> int:
    from dask.distributed import Client

    from . import Rule, _report, _store, find, job, judge, save, update

    default = Rule()
    rule = Rule(
        given.unit_pattern or default.unit,
        given.date_pattern or default.date,
        given.unit_column,
        given.date_column,
    )
    one = job(given.arm, given.store, given.map, rule)
    # Before workers are started.
    find(given.logs)
    if given.scheduler:
        client = Client(given.scheduler)
    else:
        client = Client(n_workers=given.workers, threads_per_worker=1, dashboard_address="127.0.0.1:0")
    with client:
        work = update(client, one, given.logs, given.retry)
        judged = judge(client, one, given.level, given.quiet_logs)
    if judged is None:
        print(f"no log gave a usable result\n{_report.in_words(work)}", file=sys.stderr)
        for log, reasons in _report.not_used(_store.Store(one.store).rows(one.setup)):
            print(f"not used: {log}: {reasons}", file=sys.stderr)
        return 3
    report = save(one, judged)
    if given.json:
        print(json.dumps(report, ensure_ascii=False))
    else:
        print(_report.terminal(report, work))
        print(f"{one.store}/fleet.html")
    return 0


if __name__ == "__main__":
    sys.exit(main())
