"""Makes the datasets of this folder: LeRobot's version 3, of two joints of an SO-101 on position servos.

    pip install mujoco numpy pyarrow && python make.py so101.urdf [--hold]

MuJoCo simulates them, with one thing as powerball has it: between two frames the goal goes in a straight
line. With --hold the drive holds each goal until the next one comes, and acts half a frame later:
docs/servos.md has what is then found. The URDF is that of TheRobotStudio (SO-ARM100, Apache 2.0); arm.toml
and arm.values.json are `dyngen import so101.urdf --lock shoulder_pan=0 --lock wrist_flex=0 --lock wrist_roll=0 --lock gripper=0`.
"""

import json
import math
import pathlib
import re
import sys

import mujoco
import numpy as np
import pyarrow
import pyarrow.parquet

JOINTS = ["shoulder_lift", "elbow_flex"]
FIXED = ["shoulder_pan", "wrist_flex", "wrist_roll", "gripper"]
KP, FORCE, DAMPING, ARMATURE, FRICTION, DELAY = 17.8, 3.0, 0.6, 0.028, 0.052, 0.03
RATE, SECONDS, STEP = 30, 4, 2e-4
HOLD = "--hold" in sys.argv
MIDDLE, HALF = np.array([-1.5, 1.3]), np.array([1.2, 1.2])


def model(urdf):
    text = re.sub(r"<(visual|collision|transmission).*?</\1>", "", urdf, flags=re.S)
    for name in FIXED:
        text = text.replace(f'<joint name="{name}" type="revolute">', f'<joint name="{name}" type="fixed">')
    compiler = '<mujoco><compiler fusestatic="false" balanceinertia="false" boundmass="0" boundinertia="0"/></mujoco>'
    spec = mujoco.MjSpec.from_string(re.sub(r"(<robot [^>]*>)", rf"\1{compiler}", text, count=1))
    for name in JOINTS:
        joint = spec.joint(name)
        joint.damping, joint.armature, joint.frictionloss, joint.limited = [DAMPING, 0, 0], ARMATURE, FRICTION, 0
        actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        actuator.set_to_position(kp=KP)
        actuator.forcerange, actuator.forcelimited = [-FORCE, FORCE], 1
    spec.option.timestep = STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    return spec.compile()


def goals(rng):
    """From one random pose to the next, with a rest."""
    points, each = [MIDDLE + HALF * rng.uniform(-1, 1, 2) for _ in range(10)], rng.uniform(0.5, 1.0)

    def goal(time):
        k = min(int(time / each), 8)
        s = min(max((time - k * each) / (0.8 * each), 0), 1)
        s = 10 * s**3 - 15 * s**4 + 6 * s**5
        return points[k] * (1 - s) + points[k + 1] * s

    return np.array([goal(k / RATE) for k in range(RATE * SECONDS)])


def episode(m, rng):
    frames, data, states = goals(rng), mujoco.MjData(m), []
    data.qpos[:] = data.ctrl[:] = frames[0]
    mujoco.mj_step(m, data, 1500)
    for k in range(len(frames)):
        states.append(data.qpos.copy())
        first, last = (round(n / RATE / STEP) for n in (k, k + 1))
        for s in range(last - first):
            seen = max((k / RATE + s * STEP - DELAY) * RATE, 0)
            at, share = math.floor(seen), 0 if HOLD else seen % 1
            data.ctrl[:] = frames[at] * (1 - share) + frames[min(at + 1, len(frames) - 1)] * share
            mujoco.mj_step(m, data)
    return frames, np.array(states)


def write(folder, episodes):
    (folder / "meta").mkdir(parents=True, exist_ok=True)
    (folder / "data/chunk-000").mkdir(parents=True, exist_ok=True)
    frames, states = (np.degrees(np.concatenate(part)).tolist() for part in zip(*episodes))
    pair, count, each = pyarrow.list_(pyarrow.float32(), 2), len(frames), RATE * SECONDS
    columns = {
        "action": pyarrow.array(frames, pair),
        "observation.state": pyarrow.array(states, pair),
        "timestamp": pyarrow.array([k % each / RATE for k in range(count)], pyarrow.float32()),
        "episode_index": pyarrow.array([k // each for k in range(count)], pyarrow.int64()),
    }
    pyarrow.parquet.write_table(pyarrow.table(columns), folder / "data/chunk-000/file-000.parquet", compression="zstd")
    names = [f"{name}.pos" for name in JOINTS]
    features = {key: {"dtype": "float32", "shape": [2], "names": names} for key in ("action", "observation.state")}
    info = {"codebase_version": "v3.0", "robot_type": "so101_follower", "total_episodes": len(episodes)}
    info |= {"total_frames": count, "fps": RATE, "features": features}
    (folder / "meta/info.json").write_text(json.dumps(info, indent=1) + "\n")


if __name__ == "__main__":
    arm, random = model(pathlib.Path(sys.argv[1]).read_text()), np.random.default_rng(7)
    all_episodes = [episode(arm, random) for _ in range(6)]
    write(pathlib.Path("fit"), all_episodes[:4])
    write(pathlib.Path("validate"), all_episodes[4:])
