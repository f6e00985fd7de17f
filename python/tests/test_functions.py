"""Every function against Pinocchio, and their shapes."""

import inspect
import json
import pickle

import numpy as np
import pytest

import powerball as pb
from conftest import ROOT, command, need
from powerball import _core

PUMA = ROOT / "dyngen" / "tests" / "urdf" / "puma.urdf"
PUBLIC = ["bullet__xarm__xarm6_robot.urdf", "bullet__kuka_lwr__kuka.urdf"]
N = 20


def urdf_text(path):
    # Pinocchio takes a joint without limits for a circle with two coordinates.
    return path.read_text().replace('"continuous"', '"revolute"')


def pinocchio(text):
    pin = need("pinocchio")
    model = pin.buildModelFromXML(text)
    return pin, model, model.createData()


def states(arm, rng, count=N):
    return [rng.uniform(-1.5, 1.5, (count, arm.dof)) for _ in range(3)]


def close(ours, theirs):
    scale = max(1.0, np.abs(theirs).max())
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-10 * scale)


def compare(text, rng):
    pin, model, data = pinocchio(text)
    arm = pb.Arm.from_urdf(text, exact=True)
    q, dq, ddq = states(arm, rng)
    tau = arm.inverse_dynamics(q, dq, ddq)
    close(tau, [pin.rnea(model, data, *s) for s in zip(q, dq, ddq)])
    regressor = arm.regressor(q, dq, ddq)
    assert regressor.shape == (N, arm.dof, len(arm.sets["minimal"]))
    close(regressor @ arm.set_values(), tau)
    full = arm.regressor(q, dq, ddq, parameters="full")
    close(full @ arm.set_values(parameters="full"), tau)
    close(arm.gravity(q), [pin.computeGeneralizedGravity(model, data, s) for s in q])

    def upper(matrix):
        return np.triu(matrix) + np.triu(matrix, 1).T

    close(arm.mass_matrix(q), [upper(pin.crba(model, data, s)) for s in q])
    # Pinocchio's own C is another factor of the same torques; those are compared.
    coriolis = [pin.computeCoriolisMatrix(model, data, *s) @ s[1] for s in zip(q, dq)]
    close(np.einsum("kij,kj->ki", arm.coriolis_matrix(q, dq), dq), coriolis)
    close(arm.coriolis_times_velocity(q, dq), coriolis)
    np.testing.assert_allclose(arm.forward_dynamics(q, dq, tau), ddq, rtol=0, atol=1e-8)
    # Its results are views of its data, which the next call writes over.
    derivatives = [[m.copy() for m in pin.computeABADerivatives(model, data, *s)] for s in zip(q, dq, tau)]
    for ours, theirs in (
        (arm.acceleration_by_position(q, dq, tau), [d[0] for d in derivatives]),
        (arm.acceleration_by_velocity(q, dq, tau), [d[1] for d in derivatives]),
        (arm.mass_matrix_inverse(q), [upper(d[2]) for d in derivatives]),
    ):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-8 * np.abs(theirs).max())

    momentum, matrix = arm.total_momentum(q, dq), arm.total_momentum_matrix(q)
    np.testing.assert_allclose(momentum, np.einsum("kij,kj->ki", matrix, dq), atol=1e-12)
    for k, (position, velocity) in enumerate(zip(q, dq)):
        centre = pin.centerOfMass(model, data, position).copy()
        hg = pin.computeCentroidalMomentum(model, data, position, velocity)
        close(arm.centre_of_mass(position), centre)
        close(arm.centre_of_mass_jacobian(position), pin.jacobianCenterOfMass(model, data, position))
        # Theirs is about the centre of mass.
        close(momentum[k], np.concatenate([hg.linear, hg.angular + np.cross(centre, hg.linear)]))

    def tip(s):
        pin.forwardKinematics(model, data, s)
        return data.oMi[model.njoints - 1]

    # The last frame sits on the last joint's axis: where, the axis and the way of turning are compared.
    pose = arm.forward_kinematics(q)
    fixed = [np.linalg.inv(tip(s).homogeneous) @ p for s, p in zip(q, pose)]
    close(np.array(fixed), np.broadcast_to(fixed[0], (N, 4, 4)))


def test_urdf_of_the_repository_against_pinocchio(rng):
    compare(urdf_text(PUMA), rng)


@pytest.mark.parametrize("name", PUBLIC)
def test_public_urdfs_against_pinocchio(name, public_urdf, rng):
    compare(urdf_text(public_urdf(name)), rng)


def test_every_function_of_the_generator_is_a_method_with_its_arguments():
    for name, arguments, what, _ in _core.functions():
        method = getattr(pb.Arm, name)
        given = [a for a in inspect.signature(method).parameters if a not in ("self", "values", "parameters")]
        assert given == [a for a in arguments if a != "parameters"], name
        assert ("values" in inspect.signature(method).parameters) == ("parameters" in arguments), name
        # The doc begins as the generator's own does.
        first = what.split("[")[0].split("(")[0].split(",")[0].split(":")[0].strip(" .")
        assert " ".join(method.__doc__.split()).startswith(first), (name, first)


def test_shapes_of_one_sample_and_of_many(rng):
    arm = pb.Arm.from_urdf(PUMA)
    n, p = arm.dof, len(arm.sets["minimal"])
    every = {"q", "dq", "ddq", "dqr", "ddqr", "tau", "e", "vq", "vdq"}
    given = {name: rng.uniform(-1, 1, (5, n)) for name in every}
    given["f"], given["payload"] = rng.uniform(-1, 1, (5, 6)), rng.uniform(-1, 1, (5, 10))
    for name, arguments, _, _ in _core.functions():
        many = getattr(arm, name)(**{a: given[a] for a in arguments if a != "parameters"})
        one = getattr(arm, name)(**{a: given[a][2] for a in arguments if a != "parameters"})
        assert many.shape == (5, *one.shape), name
        np.testing.assert_array_equal(many[2], one)
        stated = getattr(pb.Arm, name).__doc__.split("Returns: ")[1].split(" for one sample")[0]
        assert one.shape == eval(stated, {"n": n, "p": p}), name
        assert many.flags.c_contiguous and many.dtype == np.float64
    assert arm.inverse_dynamics(np.zeros((0, n)), np.zeros((0, n)), np.zeros((0, n))).shape == (0, n)


def test_functions_at_a_frame_are_those_of_a_tool_there(rng):
    text = (ROOT / "tests" / "arms" / "ur5e.toml").read_text()
    place = 'xyz = [0.1, -0.02, 0.3]\nrpy = [0, "pi/3", 0]\n'
    arm = pb.Arm.from_toml(text + '\n[[frame]]\nname = "hand"\nlink = 6\n' + place)
    tool = pb.Arm.from_toml(text + "\n[tool]\n" + place)
    assert arm.frames == ["hand"]
    at = arm.at_frame("hand")
    q, dq = rng.uniform(-1.5, 1.5, (2, 6))
    np.testing.assert_array_equal(at.forward_kinematics(q), tool.forward_kinematics(q))
    np.testing.assert_array_equal(at.jacobian_rate(q, dq), tool.jacobian_rate(q, dq))
    assert not np.allclose(arm.jacobian(q), at.jacobian(q))
    again = pickle.loads(pickle.dumps(at))
    np.testing.assert_array_equal(again.jacobian(q), at.jacobian(q))
    with pytest.raises(ValueError, match="no frame 'foot': it has hand"):
        arm.at_frame("foot")


def test_lists_integers_and_views_are_taken(rng):
    arm = pb.Arm.from_urdf(PUMA)
    table = rng.uniform(-1, 1, (10, 2 * arm.dof))
    view = table[::2, ::2]
    np.testing.assert_array_equal(arm.gravity(view), arm.gravity(view.copy()))
    np.testing.assert_array_equal(
        arm.gravity([0, 1, 0, 0, 0, 0]), arm.gravity([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    )
    np.testing.assert_array_equal(arm.gravity(view.astype(np.float32)).shape, (5, 6))


def test_wrong_arguments_name_themselves():
    arm = pb.Arm.from_urdf(PUMA)
    zero = np.zeros((4, 6))
    with pytest.raises(ValueError, match=r"q must have shape \(6,\) or \(N, 6\), it has \(5,\)"):
        arm.gravity(np.zeros(5))
    with pytest.raises(ValueError, match=r"dq must have the shape of q, \(4, 6\), it has \(3, 6\)"):
        arm.coriolis_matrix(zero, np.zeros((3, 6)))
    wrong = zero.copy()
    wrong[2, 1] = np.nan
    with pytest.raises(ValueError, match=r"ddq must be finite, shape \(6,\) or \(N, 6\): NaN at \[2, 1\]"):
        arm.inverse_dynamics(zero, zero, wrong)
    with pytest.raises(ValueError, match="tau must be an array of numbers"):
        arm.forward_dynamics(zero, zero, [["a"] * 6] * 4)
    with pytest.raises(
        ValueError, match=r"values must have shape \(\d+,\) for the set minimal, it has \(3,\)"
    ):
        arm.gravity(zero, [1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="values must be finite numbers: 'm1' is NaN"):
        arm.gravity(zero, {**arm.values, "m1": float("nan")})
    with pytest.raises(ValueError, match="there is no set 'tiny'"):
        arm.gravity(zero, parameters="tiny")
    with pytest.raises(pb.RefusedError, match="mass matrix B\\(q\\) is singular"):
        arm.forward_dynamics(zero, zero, zero, dict.fromkeys(arm.values, 0.0))


def test_values_by_dict_file_and_array_are_the_same(tmp_path, rng):
    arm = pb.Arm.from_urdf(PUMA)
    q, dq, ddq = states(arm, rng)
    expected = arm.inverse_dynamics(q, dq, ddq)
    file = tmp_path / "values.json"
    file.write_text(json.dumps(arm.values))
    for values in (arm.values, file, str(file), arm.set_values(arm.values)):
        np.testing.assert_array_equal(arm.inverse_dynamics(q, dq, ddq, values), expected)
    close(arm.inverse_dynamics(q, dq, ddq, parameters="symbolic"), expected)
    with pytest.raises(pb.InputError, match="no value for"):
        arm.gravity(q, {"m1": 1.0})


def test_the_command_says_the_same(tmp_path, rng):
    toml, values = tmp_path / "arm.toml", tmp_path / "values.json"
    arm = pb.Arm.from_urdf(PUMA)
    arm.save(toml)
    values.write_text(json.dumps(arm.values))
    assert arm.describe() == json.loads(command("dyngen", "describe", toml, "--json").stdout)
    q, dq, ddq = states(arm, rng, 3)
    header = ",".join(f"{name}{j + 1}" for name in ("q", "dq", "ddq") for j in range(6))
    np.savetxt(
        tmp_path / "s.csv", np.hstack([q, dq, ddq]), delimiter=",", header=header, comments="", fmt="%.17g"
    )
    done = command("dyngen", "eval", toml, "--function", "regressor", "--states", tmp_path / "s.csv")
    printed = np.loadtxt(done.stdout.splitlines()[1:], delimiter=",")
    np.testing.assert_array_equal(arm.regressor(q, dq, ddq).reshape(3, -1), printed)
