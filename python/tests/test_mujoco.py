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


def constraint(model, data):
    """What a connect leaves open, m, with its Jacobian and that one's rate."""
    ends = []
    for k, one in enumerate((model.eq_obj1id[0], model.eq_obj2id[0])):
        if model.eq_objtype[0] == mujoco.mjtObj.mjOBJ_SITE:
            body, point = model.site_bodyid[one], data.site_xpos[one]
        else:
            anchor = model.eq_data[0, 3 * k : 3 * k + 3]
            body, point = one, data.xpos[one] + data.xmat[one].reshape(3, 3) @ anchor
        rows, rates = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, rows, None, point, body)
        mujoco.mj_jacDot(model, data, rates, None, point, body)
        ends.append([point, rows, rates])
    return [first - second for first, second in zip(*ends)]


def constrained_torques(model, free, q, dq, ddq):
    """Torques of the joints that move on their own, by d'Alembert: Gᵀ(M q̈ + h), where J G = 0."""
    data = mujoco.MjData(model)
    tied = [j for j in range(model.nv) if j not in free]
    data.qpos[free] = q
    for _ in range(20):
        mujoco.mj_forward(model, data)
        gap, rows, _ = constraint(model, data)
        data.qpos[tied] -= np.linalg.pinv(rows[:, tied], rcond=1e-9) @ gap
    assert np.abs(gap).max() < 1e-12
    follow = np.linalg.pinv(rows[:, tied], rcond=1e-9)
    moves = np.zeros((model.nv, len(free)))
    moves[free] = np.eye(len(free))
    moves[tied] = -follow @ rows[:, free]
    data.qvel[:] = moves @ dq
    mujoco.mj_forward(model, data)
    acceleration = moves @ ddq
    acceleration[tied] -= follow @ (constraint(model, data)[2] @ data.qvel)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    return moves.T @ (inertia @ acceleration + data.qfrc_bias)


@pytest.mark.parametrize("name", ["crank", "level"])
def test_bars_of_a_closed_loop_are_exported(name, tmp_path):
    arm = pb.Arm.from_mjcf(ROOT / f"dyngen/tests/mjcf/{name}.xml", tip="hand")
    # Each body by a factor of its own, bars too.
    values = {key: value * (1 + int(key.lstrip("mxyzI")) / 4) for key, value in arm.values.items()}
    pb.export(arm, values, output=tmp_path / "new.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "new.xml"))
    free = [model.joint(joint).dofadr[0] for joint in arm.joint_names]
    rng = np.random.default_rng(3)
    for _ in range(5):
        q, dq, ddq = rng.uniform(-0.5, 0.5, (3, arm.dof))
        ours = arm.inverse_dynamics(q, dq, ddq, values)
        np.testing.assert_allclose(ours, constrained_torques(model, free, q, dq, ddq), rtol=1e-9, atol=1e-9)
