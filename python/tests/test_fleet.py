"""Many logs of many arms, on two workers: `powerball.fleet`; and summaries, which it is built on."""

import json
import os
import pickle
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import powerball as pb
import synthetic_fleet as synthetic
from conftest import need

need("distributed")
need("pyarrow")

from dask.distributed import Client  # noqa: E402

from powerball import fleet  # noqa: E402
from powerball.fleet import _files, _fit, _past, _report, _spread, _store  # noqa: E402
from powerball.fleet.__main__ import main  # noqa: E402

#: What a row says beyond the content of its log.
PLACES = ("log", "stamp")


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The arm file and the logs of four units, three of each, and a broken one."""
    arm_file, logs = synthetic.write_fleet(tmp_path_factory.mktemp("small"), 4, 3)
    (logs / "unit-00" / "broken.csv").write_text("t,q1\n0,nothing\n")
    return arm_file, logs


@pytest.fixture(scope="module")
def client():
    """Two workers that are processes."""
    with Client(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as client:
        yield client


@pytest.fixture(scope="module")
def uninterrupted(small, client, tmp_path_factory):
    """The small fleet in a store, in one go: job, what was done, report."""
    arm_file, logs = small
    job = fleet.job(arm_file, str(tmp_path_factory.mktemp("whole") / "store"))
    work = fleet.update(client, job, [str(logs)])
    return job, work, fleet.save(job, fleet.judge(client, job))


def same(a, b):
    """Whether two identifications agree to 1e-9 of the largest parameter and of each joint's friction."""
    (x, f), (y, g) = (
        (
            np.array([p["value"] for p in m["parameters"]]),
            [[j[f"gamma{k}"] for k in range(1, 6)] for j in m["friction"]],
        )
        for m in (a, b)
    )
    assert np.max(np.abs(x - y)) < 1e-9 * np.max(np.abs(x))
    v = np.array([-1.0, -0.1, -0.01, 0.01, 0.1, 1.0])
    for one, other in zip(f, g):
        curve, again = (c[0] * np.tanh(c[1] * v) + c[2] * np.tanh(c[3] * v) + c[4] * v for c in (one, other))
        assert np.max(np.abs(curve - again)) < 1e-9 * np.max(np.abs(curve))


def rows_of(job):
    """The rows of a store but for what names their files."""
    return [
        {name: value for name, value in row.items() if name not in PLACES}
        for row in _store.Store(job.store).rows(job.setup)
    ]


def test_the_changed_units_are_found_and_no_other(client, tmp_path):
    arm_file, logs = synthetic.write_fleet(tmp_path, 40, 2)
    job = fleet.job(arm_file, str(tmp_path / "store"))
    work = fleet.update(client, job, [str(logs)])
    assert len(work.outcomes) == 80 and {outcome.verdict for outcome in work.outcomes} == {"usable"}
    assert len({outcome.worker for outcome in work.outcomes}) == 2
    report = fleet.save(job, fleet.judge(client, job))
    found(report, since="2026-01-02T00:00:00")
    # Odd units are first on the page, which needs nothing from outside.
    page = _files.read(f"{job.store}/fleet.html").decode()
    assert page.index(f"<h2>{synthetic.WORN}</h2>") < page.index("<h2>All units</h2>")
    assert "http" not in page and "<svg" in page


def found(report, since):
    """The three odd units with what is odd about them, and that the others are alike."""
    assert sorted(report["odd"]) == synthetic.ODD
    units = {unit["unit"]: unit for unit in report["units"]}
    assert [unit["unit"] for unit in report["units"][:3]] == report["odd"]
    payload, stiff, worn = (units[name] for name in synthetic.ODD)
    assert [unit["changed"] for unit in (payload, stiff, worn)] == [False, False, True]
    (cause,) = payload["against_type"]["causes"]
    mass, std = cause["mass"]
    assert cause["cause"] == "payload" and cause["link"] == 2 and abs(mass - 0.5) < 3 * std < 0.5
    (cause,) = stiff["against_type"]["causes"]
    assert cause["cause"] == "friction" and cause["joint"] == 1
    assert 0.0 < cause["change"][0]
    # Coulomb friction is twice as large, viscous friction is not: within the intervals at every velocity.
    entry, (g1, g2, g3, g4, _) = stiff["against_type"]["friction"][0], synthetic.FRICTION[0]
    for v, (low, high) in zip(entry["velocities"], entry["interval"]):
        assert low < g1 * np.tanh(g2 * v) + g3 * np.tanh(g4 * v) < high
    (change,) = worn["against_past"]
    assert change["since"]["date"] == since
    (cause,) = change["comparison"]["causes"]
    assert cause["joint"] == 2 and cause["change"][0] < 1.0 < cause["change"][1]
    # Units were drawn with 10 % of Coulomb friction, and logs with 3 %: each within its interval.
    spread = {entry["number"]: entry for entry in report["spread"]}
    for joint, friction in enumerate(synthetic.FRICTION, 1):
        entry, level = spread[f"Coulomb friction of joint {joint}"], friction[0] + friction[2]
        low, high = entry["interval"]
        assert low < 0.1 * level < high and 0.6 * low < entry["between_units"] < high
        assert entry["from_log_to_log"] == pytest.approx(0.03 * level, rel=0.35)


def stopped(arm_file, logs, store, after):
    """Runs the command on ``logs`` and kills it when ``after`` of them are in the store."""
    words = ["-m", "powerball.fleet", str(logs), "--arm", str(arm_file), "--store", str(store)]
    process = subprocess.Popen([sys.executable, *words], start_new_session=True)
    while process.poll() is None and len(list(store.glob("parts/*.parquet"))) < after:
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def test_a_stopped_run_goes_on_to_the_same_store(small, uninterrupted, client, tmp_path):
    (arm_file, logs), (whole, _, report) = small, uninterrupted
    store = tmp_path / "store"
    stopped(arm_file, logs, store, after=2)
    # What a kill between two steps may leave: a row in both places, half a file.
    done = len(list(store.glob("parts/*.parquet")))
    assert 2 <= done < 13
    (store / "parts" / "half.parquet.0123.tmp").write_bytes(b"PAR1")

    job = fleet.job(arm_file, str(store))
    again = fleet.update(client, job, [str(logs)])
    assert again.known == done and len(again.outcomes) == 13 - done
    assert rows_of(job) == rows_of(whole)
    assert fleet.save(job, fleet.judge(client, job)) == report
    assert not list(store.glob("parts/*.parquet")) and len(list(store.glob("logs/*.parquet"))) == 1


def test_a_log_is_computed_once(small, uninterrupted, client, tmp_path):
    (arm_file, logs), (job, work, report) = small, uninterrupted
    assert work.known == 0 and len(work.outcomes) == 13
    # The broken one is reported with its reason, and the others went on.
    (failed,) = report["not_used"]
    assert failed["log"].endswith("broken.csv") and "q2" in failed["reasons"][0]

    again = fleet.update(client, job, [str(logs)])
    assert again.known == 13 and not again.outcomes
    # Nothing is left of what the workers of a finished run read.
    assert not _files.names(f"{job.store}/known", ".txt")
    # Nor as a copy under another name; with another arm file or map it is another one.
    copy = tmp_path / "unit-09"
    copy.mkdir()
    (copy / "2027-01-01.csv").write_bytes((logs / "unit-01" / "2026-01-02.csv").read_bytes())
    assert fleet.update(client, job, [str(copy)]).known == 1
    assert [outcome.verdict for outcome in fleet.update(client, job, [str(logs)], retry=True).outcomes] == [
        "failed"
    ]
    other = fleet.job(arm_file, job.store, map=["tau.sign = 1"])
    assert fleet.update(client, other, [str(copy)]).known == 0
    assert {row["unit"] for row in _store.Store(job.store).rows(other.setup)} == {"unit-09"}
    # Rows of another setup are another report's.
    assert fleet.judge(client, job).whole_key == fleet.judge(client, job).whole_key
    assert len(rows_of(job)) == 13

    arm = pb.Arm.from_toml(arm_file)
    same(
        json.loads(_files.read(f"{job.store}/identified.json")),
        pb.identify(arm, sorted(logs.glob("*/2*.csv"))).to_dict(),
    )


@pytest.fixture(params=["memory", "s3"])
def bucket(request, monkeypatch):
    """A store in the memory of this process, and one behind S3's protocol, with workers that are threads."""
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
    with Client(
        processes=False, n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0"
    ) as client:
        yield client, f"{request.param}://bucket"
    if server:
        server.stop()


def test_a_fleet_in_an_object_store(small, uninterrupted, bucket):
    (arm_file, logs), (*_, report) = small, uninterrupted
    client, bucket = bucket
    fs, root = need("fsspec").url_to_fs(bucket)
    fs.mkdir(root)
    files = sorted(logs.glob("*/*.csv"))
    for file in files:
        fs.pipe_file(f"{root}/logs/{file.parent.name}/{file.name}", file.read_bytes())
    job = fleet.job(arm_file, f"{bucket}/fleet")
    part = fleet.update(client, job, [f"{bucket}/logs/unit-01/*.csv"])
    done = fleet.update(client, job, [f"{bucket}/logs/**/*.csv"])
    assert part.known == 0 and len(part.outcomes) == 3 and done.known == 3
    saved = fleet.save(job, fleet.judge(client, job))
    assert json.loads(_files.read(f"{bucket}/fleet/fleet.json")) == json.loads(json.dumps(saved))
    assert saved["spread"] == report["spread"]
    # A log that changed is another log.
    fs.pipe_file(f"{root}/logs/unit-00/2026-01-01.csv", files[1].read_bytes()[:-80])
    assert fleet.update(client, job, [f"{bucket}/logs/**/*.csv"]).known == 12


def test_the_command(small, uninterrupted, tmp_path, capsys):
    (arm_file, logs), (job, *_) = small, uninterrupted
    options = ["--arm", str(arm_file), "--workers", "1"]
    assert main([str(logs), *options, "--store", job.store]) == 0
    out = capsys.readouterr().out
    assert "13 were known, 0 are new" in out and "not used:" in out and "fleet.html" in out
    # Wrong use, before anything is started.
    assert main([str(logs / "none.csv"), *options, "--store", str(tmp_path)]) == 2
    assert "no such log" in capsys.readouterr().err
    assert main([str(logs / "**.csv"), *options, "--store", str(tmp_path)]) == 2
    assert "**" in capsys.readouterr().err
    with pytest.raises(SystemExit) as left:
        main([str(logs), *options, "--store", str(tmp_path), "--unit-pattern", "("])
    assert left.value.code == 2
    # No result at all.
    assert main([str(logs / "unit-00" / "broken.csv"), *options, "--store", str(tmp_path)]) == 3
    assert "missing: q2" in capsys.readouterr().err


def test_a_spread_comes_to_the_errors_of_a_fit(small, tmp_path):
    arm_file, logs = small
    model = pb.identify(pb.Arm.from_toml(arm_file), logs / "unit-01" / "2026-01-01.csv")
    fit = _fit.Fit.of(model)
    # It is what the command writes.
    model.save(tmp_path)
    assert fit.covariance == json.loads((tmp_path / "covariance.json").read_text())
    assert fit.identified == json.loads((tmp_path / "identified.json").read_text())
    assert _fit.Fit.of_row(fit.columns()) == fit

    speeds = {1: (0.3, 1.2), 2: (0.5, 2.0)}
    own = fit.numbers(speeds)
    assert len(own) == 6 + 4
    for joint, (slow, fast) in speeds.items():
        # The line goes through Eq. 16.
        g1, g2, g3, g4, g5 = model.friction[joint - 1].gamma
        coulomb, viscous = (own[name].value for name in _fit.friction_names(joint))
        for v in (slow, fast):
            torque = g1 * np.tanh(g2 * v) + g3 * np.tanh(g4 * v) + g5 * v
            assert coulomb + viscous * v == pytest.approx(torque, rel=1e-12)
    # Each variance is larger by what was asked for, and no other one is.
    for name in own:
        wide = fit.widened({name: _fit.Extra(0.3, 12.0)}, speeds).numbers(speeds)
        for other in own:
            assert wide[other].variance == pytest.approx(
                own[other].variance + 0.3 * (other == name), rel=1e-6
            )
    # compare sees it: what differs by itself does not with the spread.
    changed = json.loads(json.dumps(fit.identified))
    for gamma in ("gamma1", "gamma3"):
        changed["friction"][0][gamma] *= 1.2
    other = _fit.Fit(changed, fit.covariance).side("b")
    assert _fit.compare(fit.side("a"), other, 0.01)["differ"]
    wide = fit.widened({_fit.friction_names(1)[0]: _fit.Extra(0.3, 50.0)}, speeds).side("a")
    said = _fit.compare(wide, other, 0.01)
    assert not said["differ"] and (said["a"], said["b"]) == ("a", "b")


@pytest.mark.parametrize(
    "path, unit, date",
    [
        ("/a/r7/2026-03-14.csv", "r7", "2026-03-14T00:00:00"),
        ("/a/20260314/r7/run.csv", "r7", "2026-03-14T00:00:00"),
        ("/2025-01-01/r7/20260314_093005.mcap", "r7", "2026-03-14T09:30:05"),
        ("s3://b/r7/2026-03-14T09:30.npz", "r7", "2026-03-14T09:30:00"),
        ("/a/r7/run-99999999.csv", "r7", "2001-02-03T04:05:06"),
    ],
)
def test_unit_and_date_of_a_path(path, unit, date):
    from powerball.fleet import _logs

    entry = fleet.Found(path, 1, "", "2001-02-03T04:05:06")
    assert _logs.unit_of(fleet.Rule(), path, path) == unit
    assert _logs.date_of(fleet.Rule(), entry, path) == date
    assert _logs.unit_of(fleet.Rule(unit="/(r)7/"), path, path) == "r"
    with pytest.raises(pb.InputError, match="--unit-pattern"):
        _logs.unit_of(fleet.Rule(unit="nobody"), path, path)


def test_unit_and_date_of_a_column(tmp_path):
    from powerball.fleet import _logs

    file = tmp_path / "a.csv"
    file.write_text("t,serial,when\n0,SN-12,1773480600\n")
    entry = fleet.Found(str(file), 1, "", "")
    rule = fleet.Rule(unit_column="serial", date_column="when")
    assert _logs.unit_of(rule, str(file), str(file)) == "SN-12"
    assert _logs.date_of(rule, entry, str(file)) == "2026-03-14T09:30:00"
    with pytest.raises(pb.InputError, match="columns are t, serial, when"):
        _logs.unit_of(fleet.Rule(unit_column="robot"), str(file), str(file))


def test_the_spread_is_paule_and_mandels(rng):
    """Against simulated truth, and where all variances are equal against the closed form."""
    y, v = rng.normal(3.0, 2.0, 30), np.full(30, 0.5)
    spread = _spread.between(y, v)
    assert spread.deviation**2 == pytest.approx(np.var(y, ddof=1) - 0.5, rel=1e-9)
    assert spread.mean == pytest.approx(np.mean(y))
    inside, deviations, cut = 0, [], []
    for _ in range(400):
        v = rng.uniform(0.1, 2.0, 20)
        y = rng.normal(0.0, np.sqrt(v + 1.0))
        spread = _spread.between(y, v)
        inside += spread.interval[0] <= 1.0 <= spread.interval[1]
        deviations.append(spread.deviation**2)
        y[:3] += 50.0
        cut.append(_spread.robust_between(y, v).deviation ** 2)
    assert np.mean(deviations) == pytest.approx(1.0, abs=0.1)
    assert 0.92 <= inside / 400 <= 0.98
    # Three of twenty anywhere make it larger, but not by their distance.
    assert 1.0 < np.mean(cut) < 4.0
    # No spread where there is none: half of the time the errors explain more than all.
    assert _spread.between([1.0, 1.1, 0.9], [1.0, 1.0, 1.0]).deviation == 0.0


def test_the_variance_from_log_to_log_does_not_see_a_step(rng):
    v, series = np.full(12, 0.01), []
    for unit in range(20):
        values = rng.normal(0.0, np.sqrt(0.04 + 0.01), 12)
        values[6:] += 10.0 * (unit < 3)
        series.append((values, v))
    variance, freedom = _spread.within(series)
    assert variance == pytest.approx(0.04, rel=0.25) and freedom == pytest.approx(2 / 3 * 220)


def test_evidence_has_its_odds(monkeypatch, rng):
    """If `compare` is wrong as often as its level states, the mean of a bet is 1."""
    level_of = {"p": 1.0}
    monkeypatch.setattr(_past, "compare", lambda a, b, level: {"differ": level_of["p"] < level})
    bets = []
    for p in (np.arange(2_000_000) + 0.5) / 2_000_000:
        if p >= max(_past.LEVELS):
            break
        level_of["p"] = p
        bets.append(_past.bet(None, None))
    mean = (sum(bets) + 0.5 * (2_000_000 - len(bets))) / 2_000_000
    assert mean == pytest.approx(1.0, abs=1e-6)


def test_summaries_from_python(small, tmp_path):
    arm_file, logs = small
    arm = pb.Arm.from_toml(arm_file)
    files = sorted(logs.glob("*/2*.csv"))
    whole = pb.summarize(arm, files)
    parts = [pb.summarize(arm, file) for file in files]
    assert len(whole.logs) == 12 and whole.seconds == pytest.approx(sum(p.seconds for p in parts))
    # Joined, saved, pickled and mixed with logs they are the same rows.
    parts[3].save(tmp_path / "one.summary")
    mixed = [pickle.loads(pickle.dumps(parts[0])), *parts[1:3], tmp_path / "one.summary", *files[4:]]
    joined = pb.summarize(arm, mixed)
    assert joined.rows == whole.rows
    same(pb.identify(arm, whole).to_dict(), pb.identify(arm, joined).to_dict())
    assert pb.Summary.from_bytes(whole.to_bytes()).to_bytes() == whole.to_bytes()
    with pytest.raises(pb.InputError, match="no summary"):
        pb.Summary.from_bytes(b"something else")
    assert "12 logs" in repr(whole)


@pytest.mark.slow
def test_a_thousand_logs(tmp_path, capsys):
    """Forty units, twenty-five logs of each, two workers; stopped on the way. Says what a log costs."""
    arm_file, logs = synthetic.write_fleet(tmp_path, 40, 25)
    store = tmp_path / "store"
    stopped(arm_file, logs, store, after=300)

    job = fleet.job(arm_file, str(store))
    with Client(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as client:
        work = fleet.update(client, job, [str(logs)])
        assert work.known >= 300 and work.known + len(work.outcomes) == 1000
        start = time.perf_counter()
        report = fleet.save(job, fleet.judge(client, job))
        judged = time.perf_counter() - start
        start = time.perf_counter()
        fleet.judge(client, job)
        again = time.perf_counter() - start
    with capsys.disabled():
        print(f"\n{_report.in_words(work)}; judged in {judged:.0f} s, and again in {again:.0f} s")
        print(_report.terminal(report, work))
    found(report, since="2026-01-13T00:00:00")
