"""How fast the package is compared with the command and with Pinocchio; all ratios are of one run.

python speed.py POWERBALL       (the path of the command `powerball`)
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import powerball as pb

ROOT = Path(__file__).resolve().parents[2]
URDF = ROOT / "dyngen" / "tests" / "urdf" / "puma.urdf"


def cpu(work, times: int = 3) -> float:
    """Least processor time of a piece of work, children included, s."""

    def spent() -> float:
        used = os.times()
        return used.user + used.system + used.children_user + used.children_system

    def once() -> float:
        before = spent()
        work()
        return spent() - before

    return min(once() for _ in range(times))


def wall(work, times: int = 5) -> float:
    """Least wall time, s."""

    def once() -> float:
        before = time.perf_counter()
        work()
        return time.perf_counter() - before

    return min(once() for _ in range(times))


def identification(command: str) -> list[str]:
    """Identifying from files, here and by the command."""
    with tempfile.TemporaryDirectory() as folder:
        session = pb.virtual_session(folder, seed=1, effect="torque_constant")
        line = [command, "identify", "--arm", session.arm_file, "--out", folder, "--log", *session.log[:3]]
        line += ["--validate", session.validate[0]]
        there = cpu(lambda: subprocess.run(line, check=True, capture_output=True))

        def identify():
            arm = pb.Arm.from_toml(session.arm_file)
            pb.identify(arm, session.log[:3], session.validate[0]).save(folder)

        here = cpu(identify)
    return [
        "identify, 3 logs and 1 to judge",
        f"{here:.2f} s of processor",
        f"{here / there:.2f} × the command",
    ]


def functions() -> list[list[str]]:
    """Functions over a batch, against Pinocchio's in a Python loop."""
    import pinocchio as pin

    text = URDF.read_text().replace('"continuous"', '"revolute"')
    model = pin.buildModelFromXML(text)
    data = model.createData()
    arm = pb.Arm.from_urdf(text)
    q, dq, ddq = np.random.default_rng(0).uniform(-1, 1, (3, 20_000, arm.dof))
    values = arm.set_values()
    calls = {
        "inverse_dynamics": (
            lambda: arm.inverse_dynamics(q, dq, ddq, values),
            lambda: [pin.rnea(model, data, *s) for s in zip(q, dq, ddq)],
        ),
        "mass_matrix": (lambda: arm.mass_matrix(q, values), lambda: [pin.crba(model, data, s) for s in q]),
        "regressor": (
            lambda: arm.regressor(q, dq, ddq),
            lambda: [pin.computeJointTorqueRegressor(model, data, *s) for s in zip(q, dq, ddq)],
        ),
    }
    rows = []
    for name, (ours, theirs) in calls.items():
        a, b = wall(ours) / len(q), wall(theirs, 2) / len(q)
        rows.append([f"`{name}`, 20 000 samples", f"{1e9 * a:.0f} ns a sample", f"{b / a:.0f} × faster"])
    one = wall(lambda: [arm.inverse_dynamics(q[0], dq[0], ddq[0], values) for _ in range(2000)]) / 2000
    pinned = wall(lambda: [pin.rnea(model, data, q[0], dq[0], ddq[0]) for _ in range(2000)]) / 2000
    rows.append(
        ["`inverse_dynamics`, one sample a call", f"{1e6 * one:.1f} µs", f"{one / pinned:.1f} × slower"]
    )
    return rows


if __name__ == "__main__":
    print("| what | time | ratio |\n|---|---|---|")
    for row in [identification(sys.argv[1]), *functions()]:
        print("| " + " | ".join(row) + " |")
