"""A textbook's identification in numpy: Pinocchio's regressor, rotors, viscous, Coulomb and constant friction, by least squares.

What `sindy.py` explains further and `seconds.py` compares times with.
"""

import numpy as np
import pandas
import pinocchio as pin
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

#: Samples a second of the rows, and the band of both sides, Hz.
RATE, BAND = 100.0, 10.0
#: A row of five is kept: still four times the band.
EVERY = 5
#: Slower joints than this rest, rad/s or m/s.
SLOW = 0.02
#: Where the smooth sign of a velocity turns, rad/s or m/s.
TURN = 0.05


def angle(value):
    """A number, or the few words that an arm file has for an angle."""
    if not isinstance(value, str):
        return float(value)
    sign, text = (-1, value[1:]) if value.startswith("-") else (1, value)
    over = text.removeprefix("pi/")
    return sign * (np.pi if text == "pi" else np.pi / float(over) if over != text else float(text))


def pinocchio_model(arm):
    """The arm's table as a chain of Pinocchio, and its joints' torque constants."""

    def turn_x(joint):
        return pin.SE3(pin.rpy.rpyToMatrix(angle(joint["alpha"]), 0, 0), np.array([joint["a"], 0.0, 0.0]))

    model, parent, standard = pin.Model(), 0, arm["convention"] == "standard"
    before = pin.SE3.Identity()
    for k, joint in enumerate(arm["joint"]):
        along_z = pin.SE3(pin.rpy.rpyToMatrix(0, 0, angle(joint["theta"])), np.array([0, 0, float(joint["d"])]))
        kind = pin.JointModelPZ() if joint["kind"] == "prismatic" else pin.JointModelRZ()
        place = before if standard else before * turn_x(joint)
        # The fixed part of the joint's own axis commutes with its motion.
        parent = model.addJoint(parent, kind, place * along_z, f"j{k}")
        before = turn_x(joint) if standard else pin.SE3.Identity()
    model.gravity.linear = np.array(arm["gravity"], dtype=float)
    return model, np.array([joint.get("torque_constant", 1.0) for joint in arm["joint"]])


def filtered(signal):
    return sosfiltfilt(butter(4, BAND, fs=RATE, output="sos"), signal, axis=0)


def rows(model, constants, path):
    """States, the columns of the base model by joint and torques of one log, all in the same band, without rest."""
    frame, n = pandas.read_csv(path), model.nv
    t = frame["t"].to_numpy()
    first = np.concatenate([[True], np.diff(t) > 0])
    uniform = np.arange(t[0], t[-1], 1 / RATE)

    def signal(name):
        columns = frame[[f"{name}{j + 1}" for j in range(n)]].to_numpy()
        return filtered(CubicSpline(t[first], columns[first])(uniform))

    q = signal("q")
    dq = np.gradient(q, 1 / RATE, axis=0)
    ddq = np.gradient(dq, 1 / RATE, axis=0)
    tau = signal("tau") if "tau1" in frame else signal("i") * constants
    data = model.createData()
    rigid = np.array([pin.computeJointTorqueRegressor(model, data, *state) for state in zip(q, dq, ddq)])
    own = np.stack([ddq, dq, np.tanh(dq / TURN), np.ones_like(q)], axis=2)
    keep = np.abs(dq).max(axis=1) > SLOW
    keep[: int(RATE / BAND)] = keep[-int(RATE / BAND) :] = False
    states = np.hstack([np.sin(q), np.cos(q), dq, ddq, np.tanh(dq / TURN)])
    return [x[keep][::EVERY] for x in (states, filtered(rigid), filtered(own), tau)]


def base_model(rigid, own, tau):
    """The least-squares fit of all joints, each weighted by what it leaves: a function of columns."""
    n = tau.shape[1]
    weights = np.ones(n)

    def design(rigid, own):
        friction = np.zeros((len(rigid), n, 4 * n))
        for j in range(n):
            friction[:, j, 4 * j : 4 * j + 4] = own[:, j]
        return np.concatenate([rigid, friction], axis=2)

    columns = design(rigid, own)
    for _ in range(4):
        flat = (columns * weights[:, None]).reshape(-1, columns.shape[2])
        scale = np.linalg.norm(flat, axis=0)
        scale[scale == 0] = 1
        theta = np.linalg.lstsq(flat / scale, (tau * weights).ravel(), rcond=1e-6)[0] / scale
        weights = 1 / np.sqrt(np.mean((tau - columns @ theta) ** 2, axis=0))
    return lambda rigid, own: design(rigid, own) @ theta
