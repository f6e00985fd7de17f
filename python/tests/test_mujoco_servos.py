"""Position servos simulated in MuJoCo, identified, written back and simulated again."""

import numpy as np
import pytest

import powerball as pb
from conftest import need

mujoco = need("mujoco")

MODEL = """
<mujoco model="two">
  <option timestep="0.0005" integrator="implicitfast"><flag contact="disable"/></option>
  <worldbody>
    <body name="upper">
      <inertial pos="0.1 0 0" mass="0.4" diaginertia="0.0002 0.0015 0.0015"/>
      <joint name="shoulder" type="hinge" axis="0 1 0" damping="0.5" armature="0.03" frictionloss="0.06"/>
      <body name="lower" pos="0.2 0 0">
        <inertial pos="0.08 0 0" mass="0.3" diaginertia="0.0001 0.0008 0.0008"/>
        <joint name="elbow" type="hinge" axis="0 1 0" damping="0.3" armature="0.02" frictionloss="0.04"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="shoulder" joint="shoulder" kp="18" forcerange="-3 3"/>
    <position name="elbow" joint="elbow" kp="12" forcerange="-2 2"/>
  </actuator>
</mujoco>
"""
#: From a set-point to what the drives do, s: MuJoCo's actuators have none.
DELAY = 0.02
T = 0.01 * np.arange(600)


def goals(seed):
    """Set-points, (N, 2), rad: steps, each held for a second, and two sines."""
    rng = np.random.default_rng(seed)
    if seed % 2:
        return np.stack([np.cos(x) - 1 for x in np.outer(rng.uniform(2, 4, 2), T)], axis=1) * 0.8
    heights = np.vstack([np.zeros(2), rng.uniform(-1.2, 1.2, (5, 2))])
    return heights[np.minimum(T.astype(int), 5)]


def record(model, seed, delay, name):
    """The log of a model that follows set-points; between two samples a set-point goes in a straight line."""
    wanted, data, q = goals(seed), mujoco.MjData(model), []
    data.ctrl[:] = wanted[0]
    mujoco.mj_step(model, data, 4000)
    start = data.time
    for t in T:
        while data.time - start < t - 1e-9:
            seen = data.time - start - delay
            data.ctrl[:] = [np.interp(seen, T, column) for column in wanted.T]
            mujoco.mj_step(model, data)
        q.append(data.qpos.copy())
    return pb.Log(T, np.array(q), goal=wanted, name=name)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    model = mujoco.MjModel.from_xml_string(MODEL)
    arm = pb.Arm.from_mjcf(MODEL)
    logs = [record(model, seed, DELAY, f"fit {seed}") for seed in range(4)]
    identified = pb.identify(arm, logs, record(model, 10, DELAY, "other"))
    new = tmp_path_factory.mktemp("mujoco") / "servos.xml"
    pb.export(arm, arm.values, friction=identified, output=new)
    return model, arm, logs, identified, mujoco.MjModel.from_xml_path(str(new))


def test_gains_limits_and_friction_come_back(result):
    model, _, _, identified, again = result
    np.testing.assert_allclose(again.actuator_gainprm[:, 0], model.actuator_gainprm[:, 0], rtol=0.05)
    np.testing.assert_allclose(again.actuator_forcerange, model.actuator_forcerange, rtol=0.05)
    np.testing.assert_allclose(again.dof_armature, model.dof_armature, rtol=0.1)
    np.testing.assert_allclose(again.dof_damping, model.dof_damping, rtol=0.1)
    np.testing.assert_allclose(again.dof_frictionloss, model.dof_frictionloss, rtol=0.2)
    for servo in identified.servo:
        assert servo.constants["delay"].value == pytest.approx(DELAY, abs=2e-3)


def test_the_exported_model_moves_as_it_is_simulated_here(result):
    model, arm, logs, identified, again = result
    delay = np.mean([servo.constants["delay"].value for servo in identified.servo])
    for seed in (10, 11):
        # Its positions in place of the measured ones: what is left is what the two simulations differ by.
        moved = pb.identify(arm, logs, record(again, seed, delay, "exported")).validate
        assert (moved.position_error < 2e-3).all() and (moved.goal_error > 0.05).all(), (seed, moved)
        # The exported model moves as the plant does.
        plant = record(model, seed, DELAY, "plant").q - record(again, seed, delay, "exported").q
        assert np.sqrt((plant**2).mean()) < 4e-3, seed
