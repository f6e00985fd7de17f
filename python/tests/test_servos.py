"""Arms on position servos: the commands' JSON of logs with set-points and no torque."""

import json

import numpy as np
import pytest

import powerball as pb
from conftest import command, need

ARM = """name = "pendulum"
convention = "standard"
gravity = [0, -9.81, 0]
[[joint]]
kind = "revolute"
a = 0.12
alpha = 0
d = 0
theta = "-pi/2"
[joint.servo]
kp = 16
"""
LENGTH, KP = 0.12, 16
#: The truth of the servo: N·m, N·m·s/rad, kg·m², 1/rad, s.
TORQUE, BACK_EMF, ARMATURE, COULOMB, GAIN, DELAY = 6.0, 1.1, 0.02, 0.12, 0.18, 0.03
T = 0.01 * np.arange(500)


def goal(path, t):
    """Set-points, rad; where they begin the joint hangs at rest."""
    if path == "chirp":
        return 0.9 * np.sin(1.2 * t * t)
    heights = {"steps": [0.0, 1.2, -0.9, 0.4, 1.5], "others": [0.0, -1.1, 0.7, 1.4, -0.3]}[path]
    return np.asarray(heights)[np.minimum(t.astype(int), 4)]


def record(path, mass):
    """The columns of a log: the servo by explicit steps of 0.1 ms, Karnopp's friction."""
    h, q, v, way = 1e-4, 0.0, 0.0, np.sign
    logged = goal(path, T)
    fine = np.interp(np.arange(0, T[-1], h) - DELAY, T, logged)
    inertia, positions = mass * LENGTH**2 + ARMATURE, []
    for k, wanted in enumerate(fine):
        if k % 100 == 0:
            positions.append(q)
        duty = max(-1.0, min(1.0, GAIN * KP * (wanted - q)))
        drive = TORQUE * duty - BACK_EMF * v - mass * 9.81 * LENGTH * np.sin(q)
        if abs(v) < 1e-4 and abs(drive) <= COULOMB:
            v = 0.0
        else:
            v += h * (drive - (way(drive) if abs(v) < 1e-4 else way(v)) * COULOMB) / inertia
        q += h * v
    positions += [q] * (len(T) - len(positions))
    return {"t": T, "q1": np.array(positions), "goal1": logged}


def point(mass):
    """All parameters of a mass at the end of the link."""
    others = ("mx1", "my1", "mz1", "Ixx1", "Ixy1", "Ixz1", "Iyy1", "Iyz1", "Izz1")
    return {"m1": mass, **dict.fromkeys(others, 0.0)}


@pytest.fixture(scope="module")
def servo(tmp_path_factory):
    """The folder of an arm file with its masses next to it, and of three logs; the last has another mass."""
    folder = tmp_path_factory.mktemp("servo")
    (folder / "arm.toml").write_text(ARM)
    (folder / "arm.values.json").write_text(json.dumps(point(0.5)))
    for name, path, mass in [("steps", "steps", 0.5), ("chirp", "chirp", 0.5), ("others", "others", 0.5)]:
        write(folder / f"{name}.csv", record(path, mass))
    write(folder / "loaded.csv", record("others", 0.9))
    return folder


def write(file, columns):
    table = np.stack(list(columns.values()), axis=1)
    np.savetxt(file, table, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")


def read(file):
    names = file.read_text().split("\n", 1)[0].split(",")
    return dict(zip(names, np.loadtxt(file, delimiter=",", skiprows=1).T))


def commanded(what, servo, out, validate):
    """What a command prints and writes."""
    done = command(
        "powerball",
        *(what, "--arm", servo / "arm.toml", "--log", servo / "steps.csv", servo / "chirp.csv"),
        *("--validate", *validate, "--out", out, "--json"),
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def arm(servo):
    return pb.Arm.from_toml(servo / "arm.toml")


@pytest.fixture(scope="module")
def identified(servo, arm):
    return pb.identify(arm, [servo / "steps.csv", servo / "chirp.csv"], servo / "others.csv")


def test_identify_is_the_commands(servo, identified, tmp_path):
    theirs = commanded("identify", servo, tmp_path / "theirs", [servo / "others.csv"])
    assert identified.to_dict() == theirs
    assert any("the masses are taken from it" in warning for warning in identified.warnings)
    identified.save(tmp_path / "ours")
    ours, written = ((tmp_path / who / "identified.json").read_bytes() for who in ("ours", "theirs"))
    assert ours == written and (tmp_path / "ours" / "report.html").exists()


def test_what_an_identification_tells(identified):
    assert isinstance(identified, pb.IdentifiedServos) and identified.unusable == []
    (drive,), (friction,) = identified.servo, identified.friction
    assert drive.joint == friction.joint == 1 and drive.absolute and identified.parameters == []
    found = {name: constant.value for name, constant in drive.constants.items()}
    # Never switched off: back-EMF and viscous friction are known as their sum.
    truth = {"torque": TORQUE, "viscous": BACK_EMF, "armature": ARMATURE, "gain": GAIN, "delay": DELAY}
    for name, value in truth.items():
        assert found[name] == pytest.approx(value, rel=0.05), (name, found[name])
    assert found["kp"] == KP and drive.constants["kp"].known and drive.constants["kp"].std is None
    assert friction.coulomb == pytest.approx(COULOMB, rel=0.15)
    errors = identified.validate
    assert errors.position_error.shape == (1,) and errors.samples == len(T)
    assert errors.position_error[0] < 3e-3 < errors.goal_error[0]
    assert "position error" in repr(identified) and "torque" in identified._repr_html_()


def test_frames_dicts_and_arrays_are_the_same_log(servo, arm, identified):
    pandas = need("pandas")
    columns = [read(servo / f"{name}.csv") for name in ("steps", "chirp")]
    samples = [
        pb.Log(one["t"], one["q1"][:, None], goal=one["goal1"][:, None], name="here") for one in columns
    ]
    validate = read(servo / "others.csv")
    for logs in (columns, [pandas.DataFrame(one) for one in columns], samples):
        again = pb.identify(arm, logs, validate, values=servo / "arm.values.json")
        assert {**again.to_dict(), "warnings": 0} == {**identified.to_dict(), "warnings": 0}
    named = pb.identify(arm, columns, validate, values=point(0.5))
    assert named.to_dict()["servo"] == identified.to_dict()["servo"]
    # Another mass next to the same positions: every torque is larger by as much.
    heavier = pb.identify(arm, columns, validate, values=point(1.0)).servo[0].constants["torque"].value
    assert heavier > 1.3 * identified.servo[0].constants["torque"].value
    degrees = [{**one, "q1": np.degrees(one["q1"]), "goal1": np.degrees(one["goal1"])} for one in columns]
    mapped = pb.identify(arm, degrees, map='q.unit = "deg"')
    assert mapped.fit.position_error == pytest.approx(identified.fit.position_error, rel=1e-3)


def test_masses_are_next_to_the_arm_file_wherever_the_program_works(servo, tmp_path, monkeypatch):
    monkeypatch.chdir(servo)
    arm = pb.Arm.from_toml("arm.toml")
    monkeypatch.chdir(tmp_path)
    assert pb.identify(arm, servo / "steps.csv").servo[0].absolute
    assert not pb.identify(pb.Arm.from_toml(ARM), servo / "steps.csv").servo[0].absolute


def test_samples_after_the_drive_was_switched_off_are_those_of_a_column(servo, arm):
    one = read(servo / "steps.csv")
    on = (T < 4.0).astype(float)
    column = pb.identify(arm, {**one, "torque_enable1": on}).to_dict()
    given = pb.Log(one["t"], one["q1"][:, None], goal=one["goal1"][:, None], torque_enable=on[:, None])
    again = pb.identify(arm, given).to_dict()
    assert again["servo"] == column["servo"] != pb.identify(arm, one).to_dict()["servo"]


def test_explain_is_the_commands_and_names_a_load(servo, arm, tmp_path):
    validate = [servo / "others.csv", servo / "loaded.csv"]
    explained = pb.explain(arm, [servo / "steps.csv", servo / "chirp.csv"], validate)
    theirs = commanded("explain", servo, tmp_path / "theirs", validate)
    assert explained.to_dict() == theirs
    explained.save(tmp_path / "ours")
    ours, written = ((tmp_path / who / "explained.json").read_bytes() for who in ("ours", "theirs"))
    assert ours == written
    (load,) = explained.effects
    assert load.effect == "payload" and load.joints == [1] and load.logs == [str(servo / "loaded.csv")]
    assert load.parameters["mass"] == pytest.approx(0.4, rel=0.1)
    assert load.rms_after[0] < load.rms_before[0] and load.rivals[0][0] == "torque_constant"
    assert [log["like_the_others"] for log in explained.logs] == [True, True, True, False]
    assert explained.verdict[0].state == "predicted" and explained.after[0] < explained.before[0]
    assert explained.goal_error.shape == (1,) and "payload" in repr(explained)
    assert "payload" in explained._repr_html_()


def test_what_servos_do_not_take(servo, arm, identified):
    log, torques = servo / "steps.csv", {"t": T, "q1": T, "tau1": T}
    with pytest.raises(pb.InputError, match="model takes logs with torques"):
        pb.identify(arm, log, model={})
    with pytest.raises(pb.InputError, match=r"validate\[0\]: has torques"):
        pb.explain(arm, log, torques)
    with pytest.raises(pb.InputError, match="of position servos .* logs with torques are needed"):
        pb.identify(arm, torques, read(log))
    with pytest.raises(pb.InputError, match="is given to --log and --validate"):
        pb.identify(arm, log, log)
    with pytest.raises(pb.InputError, match="--mounting is of logs with torques"):
        pb.identify(arm, pb.Mounted(log, "90,0"))
    with pytest.raises(pb.InputError, match="give at least one validation log"):
        pb.explain(arm, log, [])
    with pytest.raises(pb.InputError, match="values takes logs of position servos"):
        pb.identify(arm, torques, values=point(0.5))
    with pytest.raises(ValueError, match="values must be given by name"):
        pb.identify(arm, log, values=[1.0])
    with pytest.raises(ValueError, match="fits of torques are compared"):
        pb.compare(log, log, arm=arm)
    with pytest.raises(ValueError, match="a is of position servos"):
        pb.compare(identified, identified)
    with pytest.raises(pb.InputError, match="has no torque model"):
        pb.verify(arm, identified, torques)
