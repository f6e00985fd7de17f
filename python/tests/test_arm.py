"""Arms from files and texts, and what is known of them."""

import json
import pickle

import numpy as np
import pytest

import powerball as pb
from conftest import ROOT, command

LWA4P = ROOT / "powerball" / "arm.toml"
PUMA = ROOT / "dyngen" / "tests" / "urdf" / "puma.urdf"
MJCF = ROOT / "dyngen" / "tests" / "mjcf" / "arm.xml"


def test_an_arm_file():
    arm = pb.Arm.from_toml(LWA4P)
    assert arm.dof == 6 and arm.joint_kinds == ["revolute"] * 6
    assert pb.Arm.from_toml(LWA4P.read_text()).parameters == arm.parameters
    assert len(arm.sets["minimal"]) == 19 and len(arm.sets["symbolic"]) == 29
    assert arm.sets["published"].rank == 19
    assert arm.values == {} and np.array_equal(arm.base, np.eye(4))
    np.testing.assert_allclose(arm.gravity_vector, [0, 0, -9.81])
    assert "6 joints" in repr(arm)
    assert arm._repr_html_().count("<tr>") == 7 and "revolute" in arm._repr_html_()
    described = arm.describe()
    assert described == json.loads(command("dyngen", "describe", LWA4P, "--json").stdout)
    for kind, known in arm.sets.items():
        assert known.names == [p["name"] for p in described["sets"][kind]["parameters"]]
    with pytest.raises(ValueError, match="values are needed"):
        arm.gravity(np.zeros(6))
    # The paper's Table 3 is no real arm's.
    checked = (
        arm.check(ROOT / "powerball" / "table3.json") if (ROOT / "powerball/table3.json").exists() else None
    )
    assert checked is None or (not checked.possible and checked.min_eigenvalue < 0)


def test_a_urdf_with_its_options():
    arm = pb.Arm.from_urdf(PUMA)
    assert arm.joint_names[:3] == ["waist", "shoulder", "elbow"]
    np.testing.assert_allclose(arm.limits.position[0], [-2.79, 2.79])
    assert arm.limits.torque[1] == 186.4 and np.isnan(arm.limits.acceleration).all()
    assert arm.check().possible
    short = pb.Arm.from_urdf(PUMA, tip="forearm")
    assert short.joint_names == ["waist", "shoulder", "elbow"]
    held = pb.Arm.from_urdf(PUMA, lock={"elbow": 0.5})
    assert held.dof == 5 and "elbow" not in held.joint_names
    with pytest.raises(pb.InputError, match="nowhere"):
        pb.Arm.from_urdf(PUMA, tip="nowhere")
    with pytest.raises(ValueError, match="convention"):
        pb.Arm.from_urdf(PUMA, convention="mine")


def test_a_mujoco_model():
    arm = pb.Arm.from_mjcf(MJCF)
    assert arm.dof > 1 and arm.values
    assert pb.Arm.from_mjcf(MJCF.read_text()).values == arm.values


def test_a_mujoco_model_in_parts(tmp_path):
    text = MJCF.read_text()
    start, end = text.index("<default>"), text.rindex("</default>") + len("</default>")
    (tmp_path / "classes.xml").write_text(f"<mujoco>{text[start:end]}</mujoco>")
    parts = text[:start] + '<include file="classes.xml"/>' + text[end:]
    (tmp_path / "model.xml").write_text(parts, encoding="utf-16")
    arm = pb.Arm.from_mjcf(tmp_path / "model.xml")
    assert arm.values == pb.Arm.from_mjcf(MJCF).values
    assert "<default>" in pb.export(arm, arm.values)
    (tmp_path / "classes.xml").unlink()
    with pytest.raises(pb.InputError, match=r"line \d+: <include file=\"classes.xml\"> cannot be read"):
        pb.Arm.from_mjcf(tmp_path / "model.xml")


def test_an_arm_goes_to_other_processes():
    for arm in (pb.Arm.from_urdf(PUMA, tip="forearm"), pb.Arm.from_toml(LWA4P)):
        copy = pickle.loads(pickle.dumps(arm))
        assert copy.text == arm.text and copy.values == arm.values and copy.notes == arm.notes


def test_errors_have_the_commands_words(tmp_path):
    file = tmp_path / "arm.toml"
    file.write_text('name = "x"\nconvention = "standard"\ngravity = [0, 0, -9.81]\nspeed = 3\n')
    with pytest.raises(pb.InputError) as raised:
        pb.Arm.from_toml(file)
    assert str(raised.value) == command("dyngen", "describe", file).stderr.strip()
    assert isinstance(raised.value, (pb.Error, ValueError))
    with pytest.raises(pb.InputError, match="cannot be read"):
        pb.Arm.from_toml(tmp_path / "missing.toml")
