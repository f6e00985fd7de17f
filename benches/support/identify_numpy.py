"""Identification of base parameters with Pinocchio and numpy, as their users write it: the peer of `benches/identify.rs`.

Takes a folder with arm.json (standard DH rows [a, alpha, d, theta], gravity, friction steepnesses) and states.bin (little-endian
doubles: q, dq, ddq, tau of all samples, one array after the other), and prints one JSON line.
"""

import json
import sys
import time

import numpy as np
import pinocchio as pin

folder = sys.argv[1]
arm = json.load(open(f"{folder}/arm.json"))
n = len(arm["dh"])
q, dq, ddq, tau = np.fromfile(f"{folder}/states.bin").reshape(4, -1, n)

model = pin.Model()
model.gravity.linear = np.array(arm["gravity"])
before, parent = pin.SE3.Identity(), 0
for i, (a, alpha, d, theta) in enumerate(arm["dh"]):
    parent = model.addJoint(parent, pin.JointModelRZ(), before, f"joint{i + 1}")
    turn = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, theta), np.array([0.0, 0.0, d]))
    before = turn * pin.SE3(pin.rpy.rpyToMatrix(alpha, 0.0, 0.0), np.array([a, 0.0, 0.0]))
data = model.createData()
regressor = pin.computeJointTorqueRegressor
steep = np.array(arm["steepness"])

# Base columns, from random states: once, outside the time.
rng = np.random.default_rng(1)
some = np.vstack([regressor(model, data, *rng.uniform(-2, 2, (3, n))).copy() for _ in range(100)])
base, basis = [], np.zeros((len(some), 0))
for k in range(some.shape[1]):
    column = some[:, k]
    left = column - basis @ (basis.T @ column)
    if np.linalg.norm(left) > 1e-8 * max(np.linalg.norm(column), 1.0):
        base.append(k)
        basis = np.column_stack([basis, left / np.linalg.norm(left)])

CHUNK = 5000
p = len(base)
width = p + 3 * n
started = time.perf_counter()
gram, right, square = np.zeros((width, width)), np.zeros(width), 0.0
rows = np.empty((CHUNK, n, width))
for first in range(0, len(q), CHUNK):
    part = slice(first, min(first + CHUNK, len(q)))
    count = part.stop - part.start
    rows[:, :, p:] = 0.0
    for k in range(count):
        rows[k, :, :p] = regressor(model, data, q[first + k], dq[first + k], ddq[first + k])[:, base]
    for j in range(n):
        v = dq[part, j]
        rows[:count, j, p + 3 * j] = np.tanh(steep[j, 0] * v)
        rows[:count, j, p + 3 * j + 1] = np.tanh(steep[j, 1] * v)
        rows[:count, j, p + 3 * j + 2] = v
    flat, y = rows[:count].reshape(-1, width), tau[part].reshape(-1)
    gram += flat.T @ flat
    right += flat.T @ y
    square += y @ y
theta = np.linalg.solve(gram, right)
seconds = time.perf_counter() - started
rms = np.sqrt(max(square - right @ theta, 0.0) / tau.size)
print(json.dumps({"seconds": seconds, "columns": width, "rms": rms, "pinocchio": pin.__version__, "numpy": np.__version__}))
