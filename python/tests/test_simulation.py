"""Controllers in simulation, against what closed forms and the arm's own functions say."""

import numpy as np
import pytest

import powerball as pb

ARM = """
name = "pendulum"
convention = "standard"
gravity = [0, -9.81, 0]
[[joint]]
kind = "revolute"
a = 0.5
alpha = 0
d = 0
theta = 0
"""


@pytest.fixture(scope="module")
def arm() -> pb.Arm:
    return pb.Arm.from_toml(ARM)


def model(arm: pb.Arm, spring: float = 0.0) -> dict:
    """2 kg at 0.5 m: all its inertia is at the frame at the end."""
    values = arm.set_values({"m1": 2.0, "mx1": 0.0, "my1": 0.0, "Izz1": 0.0})
    names = arm.sets["minimal"].names
    friction = {"joint": 1, "gamma1": 0.4, "gamma2": 50, "gamma3": 0.2, "gamma4": 20, "gamma5": 0.8}
    terms = [{"effect": "spring", "joint": 1, "law": "position", "coefficient": spring}] if spring else []
    parameters = [{"name": n, "value": float(v)} for n, v in zip(names, values)]
    return {
        "arm": "pendulum",
        "set": "minimal",
        "parameters": parameters,
        "friction": [friction],
        "terms": terms,
    }


def path():
    t = 0.002 * np.arange(1500)
    return t, (0.5 * (1 - np.cos(np.pi * t)))[:, None]


def test_the_effect_that_a_controller_knows_is_not_in_the_error(arm):
    plant = model(arm, spring=8.0)
    base = pb.simulate(arm, model(arm), "computed_torque", path(), plant=plant, bandwidth=20)
    explained = pb.simulate(arm, plant, "computed_torque", path(), bandwidth=20)
    assert explained.rms[0] < 0.1 * base.rms[0]
    # At rest a spring of k·q leaves k·q/(B·ω²); the path is slow compared with ω.
    assert base.rms[0] == pytest.approx(8.0 * np.sqrt(np.mean(base.q[:, 0] ** 2)) / (0.5 * 400), rel=0.15)


def test_a_function_controls_as_the_law_of_the_same_equation(arm):
    plant = model(arm)

    def gravity(t, q, dq, q_path, dq_path, ddq_path):
        return [9.81 * np.cos(q[0])]

    by_function = pb.simulate(arm, plant, gravity, path())
    by_name = pb.simulate(arm, plant, "gravity", path())
    np.testing.assert_allclose(by_function.q, by_name.q, atol=1e-9)
    # Nothing else pushes it: it stays.
    assert np.max(np.abs(by_name.q)) < 1e-9


def test_what_is_wrong_is_said(arm):
    plant = model(arm)
    with pytest.raises(pb.InputError, match="not stable at 500 Hz"):
        pb.simulate(arm, plant, "computed_torque", path(), bandwidth=3000)
    with pytest.raises(pb.InputError, match="controller must be"):
        pb.simulate(arm, plant, "pid", path())
    with pytest.raises(ValueError, match="evenly"):
        pb.simulate(arm, plant, "gravity", (np.array([0.0, 0.1, 0.3]), np.zeros((3, 1))))
    with pytest.raises(pb.InputError, match="1 finite torques"):
        pb.simulate(arm, plant, lambda *_: [np.nan], path())
    with pytest.raises(ZeroDivisionError):
        pb.simulate(arm, plant, lambda *_: [1 / 0], path())
