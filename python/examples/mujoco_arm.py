"""A MuJoCo arm identified from its own simulation, and its model written back.

    python mujoco_arm.py [MODEL.xml] [NEW.xml]

Needs: pip install powerball mujoco
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import mujoco
import numpy as np

import powerball as pb

MODEL = Path(__file__).with_name("panda_like.xml")
RATE = 500.0


def fourier_path(model: mujoco.MjModel, seed: int, period: float = 10.0, periods: int = 2):
    """Times (N,), positions, velocities and accelerations (N, n) of a path in the joints' ranges."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, period * periods, 1.0 / RATE)
    middle, half = model.jnt_range.mean(axis=1), np.ptp(model.jnt_range, axis=1) / 2
    orders = np.arange(1, 6)
    w = 2 * np.pi * orders / period
    a, b = rng.normal(size=(2, model.nv, len(orders))) / orders
    phase = np.multiply.outer(t, w)
    sine, cosine = np.sin(phase), np.cos(phase)
    q, dq, ddq = sine @ a.T + cosine @ b.T, (cosine * w) @ a.T - (sine * w) @ b.T, None
    ddq = -(sine * w**2) @ a.T - (cosine * w**2) @ b.T
    scale = 0.8 * half / np.abs(q).max(axis=0)
    scale = np.minimum(scale, 2.0 / np.abs(dq).max(axis=0))
    return t, middle + scale * q, scale * dq, scale * ddq


def torques(model: mujoco.MjModel, q, dq, ddq):
    """The torques, (N, n), that MuJoCo needs for a motion."""
    data = mujoco.MjData(model)
    out = np.empty_like(q)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], dq[k], ddq[k]
        mujoco.mj_inverse(model, data)
        out[k] = data.qfrc_inverse
    return out


def record(model: mujoco.MjModel, seed: int) -> pb.Log:
    """A log of a path, with noise as a good torque sensor has it."""
    t, q, dq, ddq = fourier_path(model, seed)
    noise = np.random.default_rng(1000 + seed).normal(scale=0.02, size=q.shape)
    return pb.Log(t, q, tau=torques(model, q, dq, ddq) + noise, name=f"path {seed}")


def as_delivered(text: str) -> str:
    """The model as makers give it: no friction, a guess of the armatures, masses that are off."""
    text = re.sub(r'damping="[^"]*" frictionloss="[^"]*" armature="[^"]*"', 'armature="0.2"', text)
    return re.sub(r'mass="([^"]*)"', lambda m: f'mass="{0.8 * float(m[1]):.3f}"', text)


def main(path: Path, new: Path) -> None:
    """Identifies the arm of a file that knows neither friction nor masses, and writes the file anew."""
    model = mujoco.MjModel.from_xml_path(str(path))
    arm = pb.Arm.from_mjcf(as_delivered(path.read_text()))
    identified = pb.identify(arm, [record(model, seed) for seed in range(4)], record(model, 9), progress=True)
    print(identified)
    pb.export(arm, identified, output=new)
    again = mujoco.MjModel.from_xml_path(str(new))
    keys = ("dof_damping", "dof_frictionloss", "dof_armature")
    print("joint  in the plant → identified:", ", ".join(keys))
    for j in range(model.nv):
        pairs = [f"{getattr(model, key)[j]:.3f} → {getattr(again, key)[j]:.3f}" for key in keys]
        print(f"{j + 1:5d}  " + "   ".join(pairs))


if __name__ == "__main__":
    given = [Path(argument) for argument in sys.argv[1:]]
    main(*(given + [MODEL, Path("identified.xml")][len(given) :]))
