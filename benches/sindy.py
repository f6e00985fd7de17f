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
import pysindy
from textbook import base_model, pinocchio_model, rows

#: Logs of a folder, fitted and for validation, that `xtask known-truth` asks too.
QUESTIONS = Path(__file__).parent.parent / "xtask/src/known_truth/questions.csv"


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
