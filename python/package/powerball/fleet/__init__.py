"""Thousands of logs of many arms of one type: each arm (unit) against its type and against its own past.

    pip install 'powerball[fleet]'
    python -m powerball.fleet logs/ --arm arm.toml --store fleet

or, on a cluster of one's own:

    from dask.distributed import Client
    from powerball import fleet

    job = fleet.job("arm.toml", "s3://bucket/fleet")
    with Client("tcp://head:8786") as client:
        fleet.update(client, job, ["s3://bucket/logs/**/*.mcap"])
        report = fleet.save(job, fleet.judge(client, job))
    print(report["odd"])

Every fit is ``identify``'s, every difference ``compare``'s. What is computed here is how much units of one
type and logs of one unit differ (`_spread`); ``compare`` takes it as part of the errors.
"""

import importlib.util

if importlib.util.find_spec("distributed") is None or importlib.util.find_spec("pyarrow") is None:
    raise ImportError("a fleet needs Dask and pyarrow: pip install 'powerball[fleet]'")

from ._logs import Found, Rule, find
from ._run import LEVEL, QUIET, Judged, Work, judge, update
from ._save import job, save
from ._work import Job

__all__ = [
    "LEVEL",
    "QUIET",
    "Found",
    "Job",
    "Judged",
    "Rule",
    "Work",
    "find",
    "job",
    "judge",
    "save",
    "update",
]
