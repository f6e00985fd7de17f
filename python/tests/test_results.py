"""Results: the commands' JSON from files, frames and arrays."""

import dataclasses
import json
import re

import numpy as np
import pytest

import powerball as pb
from conftest import command, load, need


@pytest.fixture(scope="session")
def session(tmp_path_factory):
    return pb.virtual_session(tmp_path_factory.mktemp("session"), seed=1, effect="torque_constant")


@pytest.fixture(scope="session")
def arm(session):
    return pb.Arm.from_toml(session.arm_file)


@pytest.fixture(scope="session")
def identified(session, arm):
    return pb.identify(arm, session.log[:3], session.validate[:1])


def table(file):
    head = open(file).readline().strip().split(",")
    return dict(zip(head, np.loadtxt(file, delimiter=",", skiprows=1).T))


def written(file):
    """The content of a file, without what only a command knows: how it was called, and the arm file."""
    return re.sub(rb"<footer>.*?</footer>\n|  \"arm_file\": .*?,\n", b"", file.read_bytes())


def of_command(done, session):
    """The result that a command printed, without the arm file that it names."""
    result = json.loads(done.stdout)
    assert result.pop("arm_file") == str(session.arm_file)
    return result


def test_identify_is_the_commands(session, identified, tmp_path):
    done = command(
        "powerball",
        *("identify", "--arm", session.arm_file, "--log", *session.log[:3]),
        *("--validate", session.validate[0], "--out", tmp_path / "theirs", "--json"),
    )
    assert identified.to_dict() == of_command(done, session)
    identified.save(tmp_path / "ours")
    for name in ("identified.json", "covariance.json", "consistent.json", "report.html"):
        assert written(tmp_path / "ours" / name) == written(tmp_path / "theirs" / name), name


def test_what_an_identification_tells(identified, arm, rng):
    assert [p.name for p in identified.parameters] == arm.sets["minimal"].names
    assert identified.fit.rms.shape == (6,) and identified.validate.samples > 0
    assert [f.joint for f in identified.friction] == [1, 2, 3, 4, 5, 6]
    assert identified.friction[0].gamma.shape == (5,)
    q = rng.uniform(-1, 1, (4, 6))
    by_name = arm.gravity(q, identified)
    array = np.array([p.value for p in identified.parameters])
    np.testing.assert_array_equal(by_name, arm.gravity(q, array))
    # The nearest real arm has a body for each link, and nearly the same torques.
    assert arm.check(identified.consistent).possible
    assert "joint" in identified._repr_html_() and "Identified" in repr(identified)
    assert identified.conventions is not None
    assert identified.unusable == [] and set(identified.fit.band) == {7.0}


def test_frames_dicts_and_arrays_are_the_same_log(session, arm):
    pandas, polars = need("pandas"), need("polars")
    columns = table(session.log[0])
    expected = pb.identify(arm, session.log[0]).values
    stacked = {key: np.stack([columns[f"{key}{j}"] for j in range(1, 7)], axis=1) for key in ("q", "tau")}
    structured = np.zeros(len(columns["t"]), dtype=[(name, "f8") for name in columns])
    for name, column in columns.items():
        structured[name] = column
    frames = [columns, pandas.DataFrame(columns), polars.DataFrame(columns), structured]
    for log in [*frames, pb.Log(columns["t"], **stacked)]:
        values = pb.identify(arm, log).values
        np.testing.assert_allclose(list(values.values()), list(expected.values()), rtol=1e-9, atol=1e-12)


def test_a_log_is_read_and_inspected(session, arm, tmp_path):
    recording = pb.read_log(arm, session.log[0])
    columns = table(session.log[0])
    assert recording.q.shape == recording.tau.shape == (len(recording.t), 6)
    np.testing.assert_array_equal(recording.q[:, 2], columns["q3"])
    values, expected = (list(pb.identify(arm, log).values.values()) for log in (recording, columns))
    np.testing.assert_allclose(values, expected, rtol=1e-9)
    done = command("powerball", "log", session.log[0], "--arm", session.arm_file, "--json")
    assert {"files": [pb.inspect(session.log[0], arm=arm)]} == json.loads(done.stdout)
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("t,q1\n0,0\n1,0\n")
    with pytest.raises(pb.InputError, match=r"wrong.csv"):
        pb.read_log(arm, wrong)


def test_time_stamps_and_summaries(session, arm, tmp_path):
    columns = table(session.log[0])
    stamps = np.datetime64("2026-01-02T03:04:05") + (columns["t"] * 1e9).astype("timedelta64[ns]")
    recording = pb.read_log(arm, {**columns, "t": stamps})
    np.testing.assert_allclose(np.diff(recording.t), np.diff(columns["t"]), atol=1e-6)
    summary = tmp_path / "log.summary"
    command(
        "powerball",
        *("summarize", "--arm", session.arm_file, "--log", session.log[0], "--out", summary),
    )
    values, expected = (list(pb.identify(arm, log).values.values()) for log in (summary, session.log[0]))
    np.testing.assert_allclose(values, expected, rtol=1e-9)


def test_columns_that_are_no_numbers_are_reported(session, arm):
    log = {**table(session.log[0]), "operator": np.array(["somebody"] * len(table(session.log[0])["t"]))}
    found = pb.identify(arm, log)
    assert any("operator" in warning for warning in found.warnings), found.warnings


def test_maps_and_options(session, arm, identified):
    log = table(session.log[0])
    flipped = {key: -value if key.startswith("tau") else value for key, value in log.items()}
    plain, corrected = pb.identify(arm, log), pb.identify(arm, flipped, map="tau.sign = -1")
    assert plain.values == corrected.values != pb.identify(arm, flipped).values
    assert pb.identify(arm, log, friction="asymmetric").friction[0].offset is not None
    assert pb.identify(arm, [pb.Mounted(log, "filed")], estimator="robust").values != plain.values
    with pytest.raises(ValueError, match="estimator must be"):
        pb.identify(arm, log, estimator="magic")
    with pytest.raises(ValueError, match="is no mounting"):
        pb.identify(arm, pb.Mounted(log, "up"))


def test_errors_of_logs_have_the_commands_words(session, arm, tmp_path):
    with pytest.raises(pb.InputError) as raised:
        pb.identify(arm, session.log[0], session.log[0])
    done = command(
        "powerball",
        *("identify", "--arm", session.arm_file, "--log", session.log[0], "--validate", session.log[0]),
        *("--out", tmp_path),
    )
    assert done.stderr.strip() == f"powerball: {raised.value}" and done.returncode == 2
    with pytest.raises(pb.InputError, match=r"log\[0\].*q6"):
        short = table(session.log[0])
        del short["q6"]
        pb.identify(arm, short)
    with pytest.raises(pb.InputError, match="missing.csv"):
        pb.explain(arm, "missing.csv", session.validate)
    with pytest.raises(TypeError, match="log.0. must be a file"):
        pb.identify(arm, [3])
    with pytest.raises(ValueError, match=r"log\[0\]: t must have shape \(N,\)"):
        pb.identify(arm, {"t": np.zeros((3, 2)), "q": np.zeros((3, 6))})


def test_verify_and_compare_are_the_commands(session, arm, identified, tmp_path):
    identified.save(tmp_path / "a")
    other = pb.identify(arm, session.log[2:])
    other.save(tmp_path / "b")
    verified = pb.verify(arm, identified, session.validate[1:], tolerance=0.05)
    done = command(
        "powerball",
        *("verify", "--arm", session.arm_file, "--model", tmp_path / "a" / "identified.json"),
        *("--log", *session.validate[1:], "--tolerance", "0.05", "--out", tmp_path / "v", "--json"),
    )
    assert verified.to_dict() == json.loads(done.stdout)
    assert (done.returncode == 0) == verified.within_tolerance
    assert len(verified.joints) == 6 and "joint" in verified._repr_html_()
    compared = pb.compare(identified, other)
    done = command("powerball", "compare", tmp_path / "a", tmp_path / "b", "--out", tmp_path / "c", "--json")
    theirs = json.loads(done.stdout)
    # The names of the sides differ: objects have none.
    assert {**compared.to_dict(), "a": 0, "b": 0} == {**theirs, "a": 0, "b": 0}
    assert compared.sentence == theirs["sentence"] and compared.differ == theirs["differ"]
    again = pb.compare(tmp_path / "a", tmp_path / "b" / "identified.json")
    assert again.to_dict()["parameters"] == theirs["parameters"]
    compared.save(tmp_path / "saved")
    assert load(tmp_path / "saved" / "comparison.json")["differ"] == compared.differ
    with pytest.raises(ValueError, match="give its arm"):
        pb.compare(identified, session.log[0])


def test_thresholds_are_the_programs_and_can_be_given(session, arm):
    assert dataclasses.asdict(pb.Rule()) == json.loads(pb._core.rule())
    log, validate = session.log[:2], session.validate[:1]
    asked = pb.explain(arm, log, validate, rule=pb.Rule(most_steps=0))
    assert not asked.effects
    for rule, why in [
        (pb.Rule(least_score=-1.0), "least_score is -1: give 0 or more"),
        (pb.Rule(least_score=float("nan")), "expected value"),
        (pb.Rule(most_steps=1.5), "most_steps: invalid type"),
        (pb.Rule(shortest_block=3.0), "shortest_block .* is longer than longest_block"),
    ]:
        with pytest.raises(pb.InputError, match=why):
            pb.explain(arm, log, validate, rule=rule)


def test_explain_is_the_commands_and_its_model_goes_on(session, arm, tmp_path):
    messages = []
    log, validate = session.log[:3], session.validate[:1]
    explained = pb.explain(arm, log, validate, progress=messages.append)
    assert len(messages) > 3 and all(isinstance(what, str) for what in messages)
    done = command(
        "powerball",
        *("explain", "--arm", session.arm_file, "--log", *log),
        *("--validate", *validate, "--out", tmp_path / "theirs", "--json"),
    )
    assert explained.to_dict() == of_command(done, session)
    explained.save(tmp_path / "ours")
    for name in ("explained.json", "model.json", "report.html"):
        assert written(tmp_path / "ours" / name) == written(tmp_path / "theirs" / name), name
    assert session.truth.effect in [effect.effect for effect in explained.effects]
    assert [law.formula for law in explained.laws] == [law["formula"] for law in explained.to_dict()["laws"]]
    assert len(explained.verdict) == 6 and explained.after.rms.sum() < explained.before.rms.sum()
    assert session.truth.effect in explained._repr_html_()
    verified = pb.verify(arm, explained, validate)
    assert verified.joints[1].relative < 0.2
    source = pb.generate(arm, model=explained, scalar="f32")
    code = tmp_path / "controller.rs"
    command(
        "powerball",
        *("generate", "--arm", session.arm_file, "--model", tmp_path / "ours" / "model.json"),
        *("-o", code, "--scalar", "f32"),
    )
    assert source == code.read_text()


def test_excite_is_the_commands(arm, session, tmp_path):
    excited = pb.excite(arm, evaluations=300, harmonics=3, seed=5, floor="none")
    done = command(
        "powerball",
        *("excite", "--arm", session.arm_file, "--out", tmp_path / "path.csv", "--evaluations", "300"),
        *("--harmonics", "3", "--seed", "5", "--floor", "none", "--json"),
    )
    theirs = json.loads(done.stdout)
    theirs.pop("out")
    assert excited.to_dict() == theirs
    excited.save(tmp_path / "ours.csv", tmp_path / "report.html")
    assert (tmp_path / "ours.csv").read_bytes() == (tmp_path / "path.csv").read_bytes()
    path = excited.trajectory
    assert path.q.shape == path.dq.shape == path.ddq.shape == (len(path.t), 6)
    low, high = arm.limits.position.T
    assert (path.q >= low).all() and (path.q <= high).all() and path.dq[0].max() == 0
    assert "Condition" in excited._repr_html_()
    with pytest.raises(ValueError, match="objective"):
        pb.excite(arm, objective="fast")


def test_generate_is_the_commands(arm, session, tmp_path):
    command(
        "dyngen", "generate", session.arm_file, "-o", tmp_path / "arm.rs", "--functions", "gravity,regressor"
    )
    # Its head names the arm file's content, not its path.
    assert pb.generate(arm, functions=["gravity", "regressor"]) == (tmp_path / "arm.rs").read_text()
    with pytest.raises(ValueError, match="there is no function 'weight'"):
        pb.generate(arm, functions=["weight"])


def test_numbers_for_ros_are_the_models(arm, session, identified, tmp_path):
    yaml = need("yaml")
    identified.save(tmp_path)
    done = command(
        "powerball",
        *("generate", "--arm", session.arm_file, "--model", tmp_path / "identified.json"),
        *("--yaml", tmp_path / "arm.yaml", "--json"),
    )
    assert done.returncode == 0, done.stderr
    numbers = yaml.safe_load((tmp_path / "arm.yaml").read_text())["/**"]["ros__parameters"]["torque_model"]
    assert dict(zip(numbers["inertial"]["names"], numbers["inertial"]["values"])) == identified.values
    assert numbers["gravity"] == [0.0, 0.0, -9.81] and numbers["encoder_offset"] == [0.0] * 6
    assert numbers["joints"] == [f"joint{j}" for j in range(1, 7)]
    for name, friction in zip(numbers["joints"], identified.friction):
        own = numbers["friction"][name]
        assert [own[f"gamma{k}"] for k in range(1, 6)] == list(friction.gamma)
        assert own["coulomb"] == friction.gamma[0] + friction.gamma[2] and own["viscous"] == friction.gamma[4]


def test_recordings_as_mcap_open_with_the_reader_of_its_makers(session, identified, tmp_path):
    reader = need("mcap.reader")
    identified.save(tmp_path / "fit")
    out = tmp_path / "run.mcap"
    done = command(
        "powerball",
        *("log", session.log[0], "--arm", session.arm_file, "--to", "mcap", "-o", out),
        *("--model", tmp_path / "fit" / "identified.json"),
    )
    assert done.returncode == 0, done.stderr
    states, torques = 0, []
    with open(out, "rb") as file:
        for schema, channel, message in reader.make_reader(file, validate_crcs=True).iter_messages():
            if channel.topic == "/joint_states":
                assert schema.name == "sensor_msgs/msg/JointState"
                states += 1
            elif channel.topic == "/torque/joint2":
                torques.append(json.loads(message.data))
    assert states == len(table(session.log[0])["t"])
    measured, predicted, residual = (
        np.array([torque[key] for torque in torques]) for key in ("measured", "predicted", "residual")
    )
    np.testing.assert_allclose(measured - predicted, residual, atol=1e-9)
    rms = [float(np.sqrt(np.mean(x**2))) for x in (measured, residual)]
    assert len(residual) > 100 and rms[1] < 0.2 * rms[0]
