"""Logs of many arms of one type, of two joints in a vertical plane, of which the truth is known.

Torques are the arm's own inverse dynamics (proven against the Lagrangian) with Eq. 16 friction and noise.
Units differ by 2 % of inertia and 10 % of friction, which varies by 3 % from log to log. Three are odd.
"""

import numpy as np

import powerball as pb

ARM = """
name = "two_links"
convention = "standard"
gravity = [0, -9.81, 0]
[[joint]]
kind = "revolute"
a = 0.4
alpha = 0
d = 0
theta = 0
[[joint]]
kind = "revolute"
a = 0.3
alpha = 0
d = 0
theta = 0
"""
#: Mass, first moments about the frame at the link's end, and inertia about it, of both links.
LINKS = np.array([[4.0, -0.9, 0.01, 0.25], [2.0, -0.3, 0.01, 0.07]])
#: Eq. 16 of both joints.
FRICTION = np.array([[1.2, 60.0, 0.6, 15.0, 1.5], [0.6, 60.0, 0.3, 15.0, 0.8]])

#: What is odd, and from which log on.
PAYLOAD, STIFF, WORN = "unit-07", "unit-23", "unit-31"
ODD = [PAYLOAD, STIFF, WORN]


def write_fleet(folder, units, logs, seconds=6.0, worn_from=None, seed=1):
    """The arm file, and a folder of CSV logs for each unit; gives both."""
    arm_file = folder / "arm.toml"
    arm_file.write_text(ARM)
    arm, rng = pb.Arm.from_toml(ARM), np.random.default_rng(seed)
    for number in range(units):
        unit = f"unit-{number:02}"
        (folder / "logs" / unit).mkdir(parents=True)
        links = LINKS * (1 + 0.02 * rng.standard_normal(LINKS.shape))
        friction = FRICTION.copy()
        friction[:, [0, 2, 4]] *= 1 + 0.1 * rng.standard_normal((2, 1))
        for day in range(logs):
            now, own = friction.copy(), links.copy()
            now[:, [0, 2, 4]] *= 1 + 0.03 * rng.standard_normal((2, 1))
            if unit == PAYLOAD:
                # 0.5 kg at the end of the last link.
                own[1, 0] += 0.5
            if unit == STIFF:
                now[0, [0, 2]] *= 2.0
            if unit == WORN and day >= (logs // 2 if worn_from is None else worn_from):
                now[1, [0, 2, 4]] *= 2.0
            name = f"2026-{1 + day // 28:02}-{1 + day % 28:02}.csv"
            (folder / "logs" / unit / name).write_text(one_log(arm, own, now, seconds, rng))
    return arm_file, folder / "logs"


def one_log(arm, links, friction, seconds, rng):
    """A log at 200 Hz as CSV: five harmonics a joint, from rest to rest."""
    t = np.arange(0.0, seconds, 0.005)
    window, d_window, dd_window = smooth(t, seconds)
    q, dq, ddq = (np.zeros((len(t), 2)) for _ in range(3))
    for k in range(1, 6):
        w, a, phase = k * np.pi * 2 / 6.0, 0.5 / k**0.8, rng.uniform(0, 2 * np.pi, 2)
        wave = a * np.sin(w * t[:, None] + phase)
        slope = a * w * np.cos(w * t[:, None] + phase)
        q += window * wave
        dq += window * slope + d_window * wave
        ddq += window * -(w**2) * wave + 2 * d_window * slope + dd_window * wave
    m1, mx1, my1, izz1 = links[0]
    m2, mx2, my2, izz2 = links[1]
    full = dict(m1=m1, mx1=mx1, my1=my1, Izz1=izz1, m2=m2, mx2=mx2, my2=my2, Izz2=izz2)
    tau = arm.inverse_dynamics(q, dq, ddq, arm.set_values(full))
    g = friction.T
    tau += g[0] * np.tanh(g[1] * dq) + g[2] * np.tanh(g[3] * dq) + g[4] * dq
    tau += 0.05 * rng.standard_normal(tau.shape)
    q = q + 2e-5 * rng.standard_normal(q.shape)
    rows = np.column_stack([t, q, tau])
    lines = [",".join(f"{x:.6f}" for x in row) for row in rows]
    return "t,q1,q2,tau1,tau2\n" + "\n".join(lines) + "\n"


def smooth(t, seconds):
    """A window that is 0 at both ends and 1 a second later, and its derivatives; (N, 1) each."""
    near = np.minimum(t, seconds - t)
    sign = np.where(t < seconds / 2, 1.0, -1.0)
    s = np.clip(near, 0.0, 1.0)
    value = s**3 * (10 - 15 * s + 6 * s**2)
    first = np.where(s < 1, 30 * s**2 * (1 - s) ** 2, 0.0) * sign
    second = np.where(s < 1, 60 * s * (1 - s) * (1 - 2 * s), 0.0)
    return value[:, None], first[:, None], second[:, None]
