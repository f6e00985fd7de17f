"""A model from thousands of logs, on any number of machines: each is reduced by itself, summaries are joined.

    pip install ./python dask distributed fsspec
    python examples/fleet/fleet.py --arm arm.toml --logs 'logs/*.csv' --store fleet --workers 2
    python examples/fleet/fleet.py --arm arm.toml --logs 's3://bucket/logs/**.mcap' \
        --store s3://bucket/fleet --scheduler tcp://head:8786

Logs and the store are folders or whatever fsspec has a name for (``s3://`` with s3fs, ``gs://`` with gcsfs);
every worker must reach both. What is in the store is not done again, so a run that was stopped goes on where
it was. A log that cannot be used is a file in ``failed/`` with the reason, and the others go on.
"""

from __future__ import annotations

import argparse
import functools
import hashlib
import importlib.metadata
import json
import os
import sys
import tempfile
import time
import uuid
from dataclasses import dataclass, field
from typing import Any

import dask.distributed as dd
import fsspec

import powerball as pb

#: Summaries that one task joins: one is read at a time, so a worker holds two.
FAN_IN = 16


@dataclass(frozen=True)
class Job:
    """What is the same for every log."""

    #: The text of the arm file.
    arm: str
    #: The folder of the results, as fsspec names it.
    store: str
    #: How columns are read: lines as ``powerball --map`` takes them.
    map: tuple[str, ...] = ()


@dataclass
class Report:
    """What was done."""

    #: The store's file with all summaries joined; none where no log could be used.
    joined: str | None
    #: Logs by name, and why they could not be used.
    failed: dict[str, str]
    #: Logs that had been done before.
    known: int
    #: Seconds of work and logs, by worker.
    workers: dict[str, list[float]] = field(default_factory=dict)
    #: Seconds from the first log to the last.
    seconds: float = 0.0
    #: Bytes of the logs that were reduced, and of their summaries.
    bytes: tuple[int, int] = (0, 0)


def key_of(*parts: str) -> str:
    """A name for what these parts determine."""
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:32]


def write(path: str, data: bytes) -> None:
    """Writes a file whole or not at all: object stores do so by themselves."""
    fs, name = fsspec.url_to_fs(path)
    local = "file" in fs.protocol
    part = f"{name}.{uuid.uuid4().hex}.part" if local else name
    fs.makedirs(os.path.dirname(name), exist_ok=True)
    fs.pipe_file(part, data)
    if local:
        os.replace(part, name)


def read(path: str) -> bytes:
    """The bytes of a file."""
    fs, name = fsspec.url_to_fs(path)
    data: bytes = fs.cat_file(name)
    return data


@functools.lru_cache(maxsize=4)
def arm_of(text: str) -> pb.Arm:
    """An arm, read once in each process."""
    return pb.Arm.from_toml(text)


def reduce_log(job: Job, log: str, key: str) -> dict[str, Any]:
    """One log into the store: its summary, or why there is none."""
    start = time.perf_counter()
    outcome: dict[str, Any] = {"log": log, "key": key, "worker": worker_name()}
    try:
        fs, name = fsspec.url_to_fs(log)
        with tempfile.TemporaryDirectory() as folder:
            # A file elsewhere is fetched: readers want to seek.
            here = name if "file" in fs.protocol else os.path.join(folder, os.path.basename(name))
            if here != name:
                fs.get_file(name, here)
            outcome["bytes"] = os.path.getsize(here)
            data = pb.summarize(arm_of(job.arm), here, map=job.map or None).to_bytes()
        write(f"{job.store}/logs/{key}.summary", data)
        outcome["summary"] = len(data)
    except (pb.Error, OSError) as why:
        outcome["failed"] = str(why)
        write(f"{job.store}/failed/{key}.json", json.dumps({"log": log, "why": str(why)}).encode())
    return {**outcome, "seconds": time.perf_counter() - start}


def join(job: Job, *members: str) -> str:
    """Some summaries of the store as one; its file."""
    path = f"{job.store}/joined/{key_of(*members)}.summary"
    fs, name = fsspec.url_to_fs(path)
    if not fs.exists(name):
        whole = pb.Summary.from_bytes(read(members[0]))
        for member in members[1:]:
            whole = pb.summarize(arm_of(job.arm), [whole, pb.Summary.from_bytes(read(member))])
        write(path, whole.to_bytes())
    return path


def worker_name() -> str:
    """Which worker this is."""
    try:
        return str(dd.get_worker().address)
    except ValueError:
        return "here"


def keys_in(store: str, folder: str) -> set[str]:
    """The keys of a folder of the store."""
    fs, name = fsspec.url_to_fs(f"{store}/{folder}")
    if not fs.exists(name):
        return set()
    fs.invalidate_cache(name)
    return {os.path.basename(path).split(".")[0] for path in fs.ls(name, detail=False)}


def version_of(fs: fsspec.AbstractFileSystem, name: str) -> str:
    """What changes when a file does. Not ``fs.ukey``: S3 tells more of a file by itself than in a listing."""
    info = fs.info(name)
    for tag in ("ETag", "etag", "md5Hash", "mtime", "created"):
        if info.get(tag):
            return f"{info['size']} {info[tag]}"
    return str(fs.ukey(name))


def find(job: Job, logs: str) -> dict[str, str]:
    """The logs of a pattern, by key. The key changes with the file, the arm file, the map and the version."""
    fs, pattern = fsspec.url_to_fs(logs)
    fs.invalidate_cache()
    same = (job.arm, "\n".join(job.map), importlib.metadata.version("powerball"))
    names = sorted(fs.glob(pattern))
    return {key_of(*same, name, version_of(fs, name)): fs.unstrip_protocol(name) for name in names}


def run(client: dd.Client, job: Job, logs: str, retry: bool = False) -> Report:
    """Reduces all logs that are not done, and joins all summaries in a tree.

    ``retry``: those that failed, again.
    """
    found = find(job, logs)
    done, failed = keys_in(job.store, "logs"), keys_in(job.store, "failed")
    skipped = done if retry else done | failed
    todo = {key: log for key, log in found.items() if key not in skipped}
    report = Report(None, {}, len(found) - len(todo))

    start = time.perf_counter()
    # A worker that dies takes its logs to another one; a log that kills every worker is given up.
    futures = {
        client.submit(reduce_log, job, log, key, pure=False, retries=1): key for key, log in todo.items()
    }
    sizes = [0, 0]
    for future in dd.as_completed(futures):
        key = futures[future]
        if future.status != "finished":
            why = f"the worker ended: {future.exception()}"
            write(f"{job.store}/failed/{key}.json", json.dumps({"log": todo[key], "why": why}).encode())
        else:
            outcome = future.result()
            of_worker = report.workers.setdefault(outcome["worker"], [0.0, 0.0])
            of_worker[0] += outcome["seconds"]
            of_worker[1] += 1
            if "summary" in outcome:
                sizes[0] += outcome["bytes"]
                sizes[1] += outcome["summary"]
        future.release()
    report.seconds, report.bytes = time.perf_counter() - start, (sizes[0], sizes[1])

    done = keys_in(job.store, "logs")
    for key, log in found.items():
        if key not in done:
            report.failed[log] = json.loads(read(f"{job.store}/failed/{key}.json"))["why"]
    # Leaves in one order, whoever was first: the same tree, so what is joined already is found again.
    level: list[Any] = [f"{job.store}/logs/{key}.summary" for key in sorted(done & found.keys())]
    while len(level) > 1:
        groups = [level[k : k + FAN_IN] for k in range(0, len(level), FAN_IN)]
        level = [
            group[0] if len(group) == 1 else client.submit(join, job, *group, pure=False) for group in groups
        ]
    if level:
        report.joined = level[0] if isinstance(level[0], str) else level[0].result()
    return report


def main() -> int:
    parser = argparse.ArgumentParser(description="A model from thousands of logs.")
    parser.add_argument("--arm", required=True, help="the arm file (TOML)")
    parser.add_argument(
        "--logs", required=True, help="a pattern: a folder's files, or s3://bucket/logs/**.mcap"
    )
    parser.add_argument("--store", required=True, help="a folder for results, here or in an object store")
    parser.add_argument("--map", action="append", default=[], help="as powerball --map takes it")
    parser.add_argument("--scheduler", help="a Dask cluster; without it workers are started here")
    parser.add_argument("--workers", type=int, default=2, help="how many are started here")
    parser.add_argument("--retry", action="store_true", help="logs that failed, again")
    said = parser.parse_args()

    with open(said.arm, encoding="utf-8") as file:
        job = Job(file.read(), said.store.rstrip("/"), tuple(said.map))
    if said.scheduler:
        client = dd.Client(said.scheduler)
    else:
        client = dd.Client(n_workers=said.workers, threads_per_worker=1, dashboard_address=None)
    with client:
        if said.scheduler:
            client.upload_file(os.path.abspath(__file__))
        report = run(client, job, said.logs, said.retry)

    for log, why in report.failed.items():
        print(f"failed: {log}: {why}")
    count = sum(logs for _, logs in report.workers.values())
    print(
        f"{count:.0f} logs in {report.seconds:.1f} s, {report.known} were known, {len(report.failed)} failed"
    )
    for worker, (seconds, logs) in sorted(report.workers.items()):
        print(f"  {worker}: {logs:.0f} logs, {logs / max(seconds, 1e-9):.1f} a second of its work")
    if count:
        print(f"  {report.bytes[0] / 1e6:.1f} MB of logs, {report.bytes[1] / 1e6:.1f} MB of summaries")
    if report.joined is None:
        print("no log could be used")
        return 1
    identified = pb.identify(arm_of(job.arm), pb.Summary.from_bytes(read(report.joined)))
    write(f"{job.store}/identified.json", json.dumps(identified.to_dict()).encode())
    print(f"{identified}\n{job.store}/identified.json")
    return 0


if __name__ == "__main__":
    sys.exit(main())
