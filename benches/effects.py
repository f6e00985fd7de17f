#!/usr/bin/env python3
"""Effects written into a MuJoCo model, against MuJoCo: what `.ci/arms` runs.

    pip install "mujoco>=4" numpy
    cargo build --release -p dyngen
    python3 benches/effects.py --dyngen target/release/dyngen

The model of the tests is imported and exported with the effects of dyngen/tests/mjcf/model.json. Then

1. the torque that MuJoCo asks for at random states and bristles is that of `dyngen eval` with the effects' own formulas added, and so where
   motors 1 and 2 turn with joints 1 and 2 as those of a differential do;
2. bristles that MuJoCo moves along a path with reversals are where Dahl's solution says;
3. in steady sliding LuGre's friction is Coulomb's with Stribeck's bump.

Differences are relative to the largest torque. The exit code is 1 where one is above 1e-9.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import mujoco
import numpy as np

TESTS = pathlib.Path(__file__).resolve().parent.parent / "dyngen" / "tests" / "mjcf"
NAMES = ["pan", "lift", "stroke", "turn"]
LIMIT = 1e-9
# Of model.json: Coulomb's level and damping of each joint, presliding of `lift`, Stribeck's bump of `turn`.
COULOMB, DAMPING, LEVEL, DISTANCE, BUMP, VELOCITY = 0.75, 1.5, 1.5, 0.02, 0.4, 0.05


# Motors 1 and 2 of the differential, and what its first rotor is at the joint, kg·m².
DIFFERENTIAL, ARMATURE = [[1, 1], [1, -1]], 0.02


def exported(dyngen, folder):
    """The new model, that of the arm with a differential, and rigid torques of states by `dyngen eval`."""
    arm, values, new = folder / "arm.toml", folder / "arm.values.json", folder / "new.xml"
    call = lambda *command: subprocess.run([dyngen, *command], check=True, capture_output=True).stdout
    call("import", TESTS / "arm.xml", "--exact", "-o", arm)
    # MuJoCo leaves out that a rotor turns with the link that carries it.
    no_rotors = {k: 0.0 if k.startswith("Im") else v for k, v in json.loads(values.read_text()).items()}
    values.write_text(json.dumps(no_rotors))
    files = ["--arm", arm, "--values", values, "--friction", TESTS / "model.json"]
    call("export", TESTS / "arm.xml", *files, "--to", "mjcf", "-o", new)
    coupled, turned = folder / "coupled.toml", folder / "coupled.xml"
    coupled.write_text(arm.read_text() + f"\n[[transmission]]\njoints = [1, 2]\nmatrix = {DIFFERENTIAL}\n")
    rotor = folder / "rotor.values.json"
    rotor.write_text(json.dumps(no_rotors | {"Im1": ARMATURE / 100**2}))
    files = ["--arm", coupled, "--values", rotor, "--friction", TESTS / "model.json"]
    call("export", TESTS / "arm.xml", *files, "--to", "mjcf", "-o", turned)
    assert json.loads((TESTS / "model.json").read_text())["terms"], "the effects that ripple() and the rest know"

    def rigid(states):
        file = folder / "states.csv"
        head = ",".join(f"{x}{i + 1}" for x in ("q", "dq", "ddq") for i in range(4))
        np.savetxt(file, states, delimiter=",", header=head, comments="", fmt="%.17g")
        lines = call("eval", arm, "--function", "inverse_dynamics", "--states", file, "--values", values)
        return np.array([line.split(",") for line in lines.decode().split()[1:]], dtype=float)

    load = lambda path: mujoco.MjModel.from_xml_path(str(path))
    return load(new), load(turned), rigid


def ripple(q):
    pan = 0.5 * np.cos(32 * q[0]) - 0.25 * np.sin(32 * q[0]) + 0.125 * np.sin(2.5 * q[0])
    return np.array([pan, 20 * q[1] - 5, 3 * np.cos(100 * q[2]), 0])


def sliding(v):
    return COULOMB + BUMP * np.exp(-((v / VELOCITY) ** 2))


def torques(model, rigid, matrix, rotors):
    """The largest difference of what the motors have to bring up; they turn at `matrix` times the joints' velocities."""
    random = np.random.default_rng(4)
    states = random.uniform(-1.5, 1.5, (200, 12))
    states[::2, 7] *= 0.05
    bristles = random.uniform(-1, 1, (200, 2)) * [DISTANCE, COULOMB / 750]
    data = mujoco.MjData(model)
    found, expected = [], []
    for state, rest, torque in zip(states, bristles, rigid(states)):
        q, v, a = np.split(state, 3)
        data.qpos[:], data.qvel[:], data.act[:] = q, v, rest
        mujoco.mj_forward(model, data)
        data.qacc[:] = a
        mujoco.mj_inverse(model, data)
        found.append(np.append(data.qfrc_inverse - data.qfrc_actuator, data.act_dot))
        place, rate, change = (matrix @ x for x in (q, v, a))
        friction = np.array([0, LEVEL / DISTANCE * rest[0], 0, 750 * rest[1]])
        moves = [rate[i] - abs(rate[i]) * k * rest[j] for i, j, k in [(1, 0, 1 / DISTANCE), (3, 1, 750 / sliding(rate[3]))]]
        motors = DAMPING * rate + ripple(place) + friction + rotors * change
        expected.append(np.append(torque + matrix.T @ motors, moves))
    return np.abs(np.array(found) - expected).max() / np.abs(expected).max()


def path(model):
    """The largest difference of Dahl's z, along pieces of even velocity."""
    data, wound, worst = mujoco.MjData(model), 0.0, 0.0
    for k in range(4000):
        v = [0.3, -0.1, 0.02, -0.5][k // 37 % 4]
        data.qpos[:], data.qvel[:] = 0, [0, v, 0, 0]
        mujoco.mj_step(model, data)
        wound = np.sign(v) + (wound - np.sign(v)) * np.exp(-abs(v) * model.opt.timestep / DISTANCE)
        worst = max(worst, abs(data.act[0] / DISTANCE - wound))
    return worst


def steady(model):
    """The largest difference from Coulomb's and Stribeck's friction, once the bristles have given way."""
    worst = 0.0
    for v in (-0.5, -0.07, -0.02, 0.01, 0.05, 0.1, 1.0):
        data = mujoco.MjData(model)
        for _ in range(2000):
            data.qpos[:], data.qvel[:] = 0, [0, 0, 0, v]
            mujoco.mj_step(model, data)
        data.qpos[:], data.qvel[:] = 0, [0, 0, 0, v]
        mujoco.mj_forward(model, data)
        worst = max(worst, abs(data.qfrc_actuator[3] + np.sign(v) * sliding(v)))
    return worst


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dyngen", required=True, type=pathlib.Path, help="the program")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        model, coupled, rigid = exported(options.dyngen.resolve(), pathlib.Path(folder))
        for each in (model, coupled):
            each.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(model.njnt)]
        assert names == NAMES and model.na == 2, names
        matrix = np.eye(4)
        matrix[:2, :2] = DIFFERENTIAL
        found = {
            "torque": torques(model, rigid, np.eye(4), np.zeros(4)),
            "torque of coupled motors": torques(coupled, rigid, matrix, np.array([ARMATURE, 0, 0, 0])),
        }
        found |= {"path": path(model), "steady sliding": steady(model)}
    print(f"effects in MuJoCo {mujoco.__version__}: " + ", ".join(f"{k} {v:.0e}" for k, v in found.items()))
    sys.exit(0 if max(found.values()) < LIMIT else 1)


if __name__ == "__main__":
    main()
