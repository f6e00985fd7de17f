"""Many logs on a local cluster of two workers: `examples/fleet/fleet.py`."""

import sys
from pathlib import Path

import numpy as np
import pytest

import powerball as pb
from conftest import ROOT, need

LOGS = 200


@pytest.fixture(scope="module")
def short_logs(tmp_path_factory):
    """Two hundred pieces of about 2 s of the virtual arm's logs, a broken one, and the arm file."""
    folder = tmp_path_factory.mktemp("fleet")
    logs = folder / "logs"
    logs.mkdir()
    sessions = [
        pb.virtual_session(folder / f"session{seed}", seed=seed, effect="load_friction") for seed in (1, 2)
    ]
    long = [Path(log) for session in sessions for log in session.log + session.validate]
    each = -(-LOGS // len(long))
    pieces = []
    for log in long:
        head, *lines = log.read_text().splitlines(keepends=True)
        size = len(lines) // each
        pieces += [head + "".join(lines[k * size : (k + 1) * size]) for k in range(each)]
    for number, piece in enumerate(pieces[:LOGS]):
        (logs / f"{number:03}.csv").write_text(piece)
    (logs / "broken.csv").write_text("t,q1\n0,nothing\n")
    return Path(sessions[0].arm_file), logs


def same(a, b):
    """Whether two identifications agree to 1e-9 of the largest parameter and of each joint's friction."""
    x, y = (np.array([p.value for p in m.parameters]) for m in (a, b))
    assert np.max(np.abs(x - y)) < 1e-9 * np.max(np.abs(x))
    speeds = np.array([-1.0, -0.1, -0.01, 0.01, 0.1, 1.0])
    for one, other in zip(a.friction, b.friction):

        def curve(friction):
            g = friction.gamma
            return g[0] * np.tanh(g[1] * speeds) + g[2] * np.tanh(g[3] * speeds) + g[4] * speeds

        assert np.max(np.abs(curve(one) - curve(other))) < 1e-9 * np.max(np.abs(curve(one)))


def test_a_fleet_is_one_process(short_logs, tmp_path):
    distributed = need("dask.distributed")
    sys.path.insert(0, str(ROOT / "examples" / "fleet"))
    import fleet

    arm_file, logs = short_logs
    job = fleet.Job(arm_file.read_text(), str(tmp_path / "store"))
    with distributed.Client(n_workers=2, threads_per_worker=1, dashboard_address=None) as client:
        client.upload_file(fleet.__file__)
        # Some of them, as of a run that was stopped.
        part = fleet.run(client, job, str(logs / "00*.csv"))
        assert sum(count for _, count in part.workers.values()) == 10 and not part.failed

        done = fleet.run(client, job, str(logs / "*.csv"))
        assert done.known == 10 and len(done.workers) == 2
        assert sum(count for _, count in done.workers.values()) == LOGS - 10 + 1
        # The broken one is reported, and the others went on.
        (name, why), *more = done.failed.items()
        assert name.endswith("broken.csv") and "q2" in why and not more

        # What is done, and what failed, is not done again.
        again = fleet.run(client, job, str(logs / "*.csv"))
        assert again.known == LOGS + 1 and not again.workers
        assert again.joined == done.joined and again.failed == done.failed
        assert fleet.run(client, job, str(logs / "*.csv"), retry=True).known == LOGS

    arm = pb.Arm.from_toml(arm_file)
    joined = pb.Summary.read(done.joined)
    assert len(joined.logs) == LOGS
    files = sorted(logs.glob("[0-9]*.csv"))
    same(pb.identify(arm, joined), pb.identify(arm, files))


@pytest.fixture(params=["memory", "s3"])
def bucket(request, monkeypatch):
    """A store in the memory of this process, and one behind S3's protocol, with workers that are threads."""
    distributed = need("dask.distributed")
    fsspec = need("fsspec")
    server = None
    if request.param == "s3":
        need("s3fs")
        server = need("moto.server").ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
        server.start()
        host, port = server.get_host_and_port()
        for name, value in {
            "AWS_ENDPOINT_URL": f"http://{host}:{port}",
            "AWS_ACCESS_KEY_ID": "any",
            "AWS_SECRET_ACCESS_KEY": "any",
            "AWS_DEFAULT_REGION": "us-east-1",
        }.items():
            monkeypatch.setenv(name, value)
    # What was opened before may be set to another server.
    fsspec.get_filesystem_class(request.param).clear_instance_cache()
    with distributed.Client(
        processes=False, n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as client:
        yield client, f"{request.param}://bucket"
    if server:
        server.stop()


def test_a_fleet_in_an_object_store(short_logs, bucket):
    client, bucket = bucket
    fsspec = need("fsspec")
    sys.path.insert(0, str(ROOT / "examples" / "fleet"))
    import fleet

    arm_file, logs = short_logs
    files = sorted(logs.glob("[0-9]*.csv"))[:20]
    fs, root = fsspec.url_to_fs(bucket)
    fs.mkdir(root)
    for file in [*files, logs / "broken.csv"]:
        fs.pipe_file(f"{root}/logs/{file.name}", file.read_bytes())
    job = fleet.Job(arm_file.read_text(), f"{bucket}/fleet")
    part = fleet.run(client, job, f"{bucket}/logs/00*.csv")
    done = fleet.run(client, job, f"{bucket}/logs/*.csv")
    assert part.known == 0 and done.known == 10
    assert [name.rsplit("/", 1)[1] for name in done.failed] == ["broken.csv"]
    again = fleet.run(client, job, f"{bucket}/logs/*.csv")
    assert again.known == 21 and not again.workers and again.joined == done.joined
    # A log that changed is another log.
    fs.pipe_file(f"{root}/logs/{files[0].name}", files[1].read_bytes())
    assert fleet.run(client, job, f"{bucket}/logs/*.csv").known == 20

    arm = pb.Arm.from_toml(arm_file)
    joined = pb.Summary.from_bytes(fleet.read(done.joined))
    same(pb.identify(arm, joined), pb.identify(arm, files))


def test_summaries_from_python(short_logs, tmp_path):
    import pickle

    arm_file, logs = short_logs
    arm = pb.Arm.from_toml(arm_file)
    files = sorted(logs.glob("[0-9]*.csv"))[:30]
    whole = pb.summarize(arm, files)
    parts = [pb.summarize(arm, file) for file in files]
    assert len(whole.logs) == 30 and whole.seconds == pytest.approx(sum(p.seconds for p in parts))
    # Joined, saved, pickled and mixed with logs they are the same rows.
    parts[3].save(tmp_path / "one.summary")
    mixed = [pickle.loads(pickle.dumps(parts[0])), *parts[1:3], tmp_path / "one.summary", *files[4:]]
    joined = pb.summarize(arm, mixed)
    assert joined.rows == whole.rows
    same(pb.identify(arm, whole), pb.identify(arm, joined))
    assert pb.Summary.from_bytes(whole.to_bytes()).to_bytes() == whole.to_bytes()
    with pytest.raises(pb.InputError, match="no summary"):
        pb.Summary.from_bytes(b"something else")
    assert "30 logs" in repr(whole)
