"""An arm simulated in MuJoCo, identified, written back and simulated again."""

import sys

import numpy as np
import pytest

import powerball as pb
from conftest import ROOT, need

mujoco = need("mujoco")
sys.path.insert(0, str(ROOT / "python" / "examples"))
import mujoco_arm as example  # noqa: E402


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    model = mujoco.MjModel.from_xml_path(str(example.MODEL))
    arm = pb.Arm.from_mjcf(example.as_delivered(example.MODEL.read_text()))
    logs = [example.record(model, seed) for seed in range(4)]
    identified = pb.identify(arm, logs, example.record(model, 9))
    new = tmp_path_factory.mktemp("mujoco") / "identified.xml"
    pb.export(arm, identified, output=new)
    return model, arm, identified, mujoco.MjModel.from_xml_path(str(new))


def test_friction_and_armature_come_back(result):
    model, arm, identified, again = result
    np.testing.assert_allclose(again.dof_frictionloss, model.dof_frictionloss, rtol=0.01)
    np.testing.assert_allclose(again.dof_damping, model.dof_damping, rtol=0.02)
    # The first two joints' armatures act as parts of their links' inertia do: torques tell the sums alone.
    np.testing.assert_allclose(again.dof_armature[2:], model.dof_armature[2:], rtol=0.1)
    assert identified.physically_consistent or arm.check(identified.consistent).possible


def test_the_exported_models_torque_is_the_reports(result):
    model, _, identified, again = result
    t, q, dq, ddq = example.fourier_path(model, 9)
    measured, exported = (example.torques(m, q, dq, ddq) for m in (model, again))
    error = np.sqrt(((measured - exported) ** 2).mean(axis=0))
    # MuJoCo's friction is that of the plant, so the new model may do better than the report's own law.
    assert (error <= identified.validate.rms).all(), (error, identified.validate.rms)
    # Without friction what is left is the rigid arm's alone.
    for m in (model, again):
        m.dof_frictionloss[:] = 0
        m.dof_damping[:] = 0
    rigid, exported = (example.torques(m, q, dq, ddq) for m in (model, again))
    share = np.sqrt(((rigid - exported) ** 2).mean(axis=0) / (rigid**2).mean(axis=0))
    assert (share < 0.05).all(), share


def test_the_arm_has_mujocos_dynamics():
    """Mass matrix and gravity, without armature: MuJoCo's does not act on the link that carries the motor."""
    model = mujoco.MjModel.from_xml_path(str(example.MODEL))
    model.dof_armature[:] = 0
    arm = pb.Arm.from_mjcf(example.MODEL, exact=True)
    values = {name: 0.0 if name.startswith("Im") else value for name, value in arm.values.items()}
    model.dof_frictionloss[:] = 0
    rng = np.random.default_rng(2)
    unit, rest = np.eye(model.nv), np.zeros((model.nv, model.nv))
    for _ in range(5):
        q = np.broadcast_to(rng.uniform(*model.jnt_range.T), rest.shape)
        gravity = example.torques(model, q, rest, rest)
        columns = example.torques(model, q, rest, unit) - gravity
        np.testing.assert_allclose(arm.mass_matrix(q[0], values), columns.T, atol=1e-9)
        np.testing.assert_allclose(arm.gravity(q, values), gravity, atol=1e-9)
