"""A MuJoCo arm identified from its own simulation, and its model written back.

    python mujoco_arm.py [MODEL.xml] [NEW.xml]

Needs: pip install powerball mujoco
"""

from __future__ import annotations

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


def main(path: Path, new: Path) -> None:
    model = mujoco.MjModel.from_xml_path(str(path))
    arm = pb.Arm.from_mjcf(path)
    identified = pb.identify(arm, [record(model, seed) for seed in range(4)], record(model, 9), progress=True)
    print(identified)
    pb.export(arm, identified, output=new)
    again = mujoco.MjModel.from_xml_path(str(new))
    print("joint   damping         frictionloss    armature")
    for j in range(model.nv):
        pairs = [
            getattr(m, key)[j]
            for key in ("dof_damping", "dof_frictionloss", "dof_armature")
            for m in (model, again)
        ]
        print("{:5d}   {:.3f} → {:.3f}   {:.3f} → {:.3f}   {:.3f} → {:.3f}".format(j + 1, *pairs))


if __name__ == "__main__":
    given = [Path(argument) for argument in sys.argv[1:]]
    main(*(given + [MODEL, Path("identified.xml")][len(given) :]))
