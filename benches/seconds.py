"""Processor seconds of `identify` and `explain` next to a textbook's fit of the same logs, all in one run on one core.

    pip install pin pandas scipy
    python benches/seconds.py target/release/powerball ../shared/data

The textbook's fit (`textbook.py`) reads the logs, filters them, builds Pinocchio's regressor, fits, and predicts the logs that
judge; its imports do not count. The commands are counted whole, with the report that they write. The least of three rounds.
"""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before numpy is loaded

import resource
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import numpy as np
from textbook import base_model, pinocchio_model, rows

ROUNDS = 3
CASES = [
    ("ur10e", "fourier_12a fourier_12b fourier_12c fourier_7 fourier_8", "fourier_5 fourier_14"),
    ("ur5_pushes", "no6 no7 no8", "no9_pushed"),
]


def textbook(folder, fit, validate):
    began = time.process_time()
    model, constants = pinocchio_model(tomllib.loads((folder / "arm.toml").read_text()))

    def read(paths):
        parts = [rows(model, constants, path) for path in paths]
        return [np.concatenate(part) for part in zip(*parts)]

    fitted, judged = read(fit), read(validate)
    base_model(*fitted[1:])(*judged[1:3])
    return time.process_time() - began


def command(*arguments):
    def used():
        times = resource.getrusage(resource.RUSAGE_CHILDREN)
        return times.ru_utime + times.ru_stime

    began, environment = used(), {**os.environ, "RAYON_NUM_THREADS": "1"}
    done = subprocess.run(arguments, env=environment, capture_output=True, text=True)
    # 3: there is a result, with something that it is not to be used for.
    if done.returncode not in (0, 3):
        sys.exit(done.stderr)
    return used() - began


def main():
    powerball, data = sys.argv[1], Path(sys.argv[2])
    print("| logs | textbook, s | identify, × | explain, × |\n|---|---|---|---|")
    for name, fit, validate in CASES:
        folder = data / name
        fit, validate = ([folder / f"{log}.csv" for log in logs.split()] for logs in (fit, validate))
        with tempfile.TemporaryDirectory() as out:
            arm = ["--arm", folder / "arm.toml", "--log", *fit, "--out", out]
            rounds = [
                (
                    textbook(folder, fit, validate),
                    command(powerball, "identify", *arm),
                    command(powerball, "explain", *arm, "--validate", *validate),
                )
                for _ in range(ROUNDS)
            ]
        own, identify, explain = (min(times) for times in zip(*rounds))
        print(f"| {name} | {own:.2f} | {identify / own:.2f} | {explain / own:.1f} |")


main()
