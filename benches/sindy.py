"""What sparse regression makes of the questions of docs/results/known_truth.md.

    pip install pin pysindy pandas
    python benches/sindy.py ../shared/data

The base model is a textbook's: Pinocchio's regressor, rotors, viscous, Coulomb and constant friction by least squares. What
it leaves of each joint's torque goes to PySINDy: sequentially thresholded least squares (S. L. Brunton, J. L. Proctor,
J. N. Kutz, "Discovering governing equations from data by sparse identification of nonlinear dynamical systems", PNAS 113
(2016)) over all products of two of 1, sin q, cos q, q̇, q̈ and a smooth sign of q̇ of all joints. Its threshold is the best
of twelve on the last quarter of the fitted logs. Writes docs/results/sindy.csv, which `xtask known-truth` reads.
"""

import csv
import itertools
import sys
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pandas
import pinocchio as pin
import pysindy
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

#: Logs of a folder, fitted and for validation, that `xtask known-truth` asks too.
QUESTIONS = Path(__file__).parent.parent / "xtask/src/known_truth/questions.csv"


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


def sparse(library, left, names):
    """The sparse law of one joint's residual: coefficients of the library's terms."""
    size, cut = library.std(axis=0), 3 * len(left) // 4
    size[size == 0] = 1
    terms, scale = library / size, left.std()

    def fit(rows, threshold):
        solver = pysindy.STLSQ(threshold=threshold, alpha=1e-3 * rows.stop, max_iter=20)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of thresholds that leave no term
            solver.fit(terms[rows], left[rows, None] / scale)
        return solver.coef_[0]

    def error(threshold):
        return np.mean((left[cut:] / scale - terms[cut:] @ fit(slice(0, cut), threshold)) ** 2)

    best = min(np.geomspace(0.02, 1.0, 12), key=error)
    coefficients = fit(slice(0, len(left)), best) * scale
    # Nothing at all is a law too.
    if error(best) >= np.mean((left[cut:] / scale) ** 2):
        coefficients = np.zeros_like(coefficients)
    largest = np.argsort(-np.abs(coefficients))
    return coefficients / size, [names[k] for k in largest if coefficients[k] != 0]


def answer(data, folder, fit, validate):
    arm = tomllib.loads((data / folder / "arm.toml").read_text())
    model, constants = pinocchio_model(arm)

    def read(files):
        parts = [rows(model, constants, data / folder / f"{file}.csv") for file in files.split()]
        return [np.concatenate(part) for part in zip(*parts)]

    n = model.nv
    symbols = ["sin q", "cos q", "dq", "ddq", "sgn dq"]
    variables = [f"{symbol}{j + 1}" for symbol, j in itertools.product(symbols, range(n))]
    products = pysindy.PolynomialLibrary(degree=2, include_bias=True)
    fitted, judged = read(fit), read(validate)
    products.fit(fitted[0])
    names = products.get_feature_names(variables)
    base = base_model(*fitted[1:])
    before, after, terms, first = [], [], [], []
    library, elsewhere = np.asarray(products.transform(fitted[0])), np.asarray(products.transform(judged[0]))
    left, missed = fitted[3] - base(*fitted[1:3]), judged[3] - base(*judged[1:3])
    for j in range(n):
        torque = np.sqrt(np.mean(judged[3][:, j] ** 2))
        law, words = sparse(library, left[:, j], names)
        before.append(np.sqrt(np.mean(missed[:, j] ** 2)) / torque)
        after.append(np.sqrt(np.mean((missed[:, j] - elsewhere @ law) ** 2)) / torque)
        terms.append(len(words))
        first.append(words[0] if words else "none")
    return before, after, terms, first


def main():
    data = Path(sys.argv[1] if len(sys.argv) > 1 else "../shared/data")
    out = Path(__file__).parent.parent / "docs/results/sindy.csv"
    with out.open("w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["folder", "fit", "validate", "before, %", "after, %", "terms", "largest term"])
        for question in csv.DictReader(QUESTIONS.open()):
            folder, fit, validate = (question[name] for name in ("folder", "fit", "validate"))
            before, after, terms, first = answer(data, folder, fit, validate)
            percent = [" ".join(f"{100 * share:.0f}" for share in shares) for shares in (before, after)]
            row = [folder, fit, validate, *percent, " ".join(map(str, terms)), "; ".join(first)]
            table.writerow(row)
            print(*row, sep=" | ", flush=True)


main()
