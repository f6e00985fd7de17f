#!/usr/bin/env python3
"""MuJoCo models through dyngen, against MuJoCo.

    pip install mujoco numpy
    cargo build --release -p dyngen
    python3 benches/mjcf.py --dyngen target/release/dyngen --urdf FOLDER [--mjcf FOLDER]

MuJoCo loads each URDF of the folder (without shapes), saves it as its own format, dyngen imports that (--exact), and inverse
dynamics is compared with mj_inverse over 20 random states, relative to the largest torque there; files of the second folder
are taken as they are. Then every link's parameters are scaled, exported into the model, and compared again with what MuJoCo
makes of the new file. Damping, friction, contacts and armature are switched off in MuJoCo. The exit code is 1 where a
difference is above 1e-6: MuJoCo saves six digits unless it is set otherwise.
"""

import argparse
import json
import pathlib
import re
import sys
import tempfile
import xml.etree.ElementTree as ET

import mujoco
import numpy as np
from arms import STATES, longest_chain, run

HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)


def saved(path, file):
    """A URDF as MJCF; none where MuJoCo does not take it."""
    root = ET.parse(path).getroot()
    for link in root.findall("link"):
        for shape in link.findall("visual") + link.findall("collision"):
            link.remove(shape)
    for kind in ("material", "gazebo", "transmission"):
        for node in root.findall(kind):
            root.remove(node)
    extension = ET.SubElement(root, "mujoco")
    ET.SubElement(extension, "compiler", fusestatic="false", balanceinertia="false", discardvisual="true")
    try:
        model = mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    except ValueError:
        return False
    mujoco.mj_saveLastXML(str(file), model)
    return True


def torques(file, joints, states):
    model = mujoco.MjModel.from_xml_path(str(file))
    ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in joints]
    # What hangs on other joints is massless, as for dyngen.
    kept = set(ids)
    for body in range(1, model.nbody):
        at, moved = body, False
        while at:
            first, count = model.body_jntadr[at], model.body_jntnum[at]
            moved |= any(j not in kept for j in range(first, first + count))
            at = model.body_parentid[at]
        if moved:
            model.body_mass[body], model.body_inertia[body] = 0, 0
    model.dof_damping[:], model.dof_frictionloss[:], model.dof_armature[:], model.jnt_stiffness[:] = 0, 0, 0, 0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    data = mujoco.MjData(model)
    found = []
    for state in states:
        data.qpos[:], data.qvel[:], data.qacc[:] = model.qpos0, 0, 0
        for j, (q, v, a) in zip(ids, zip(*np.split(state, 3))):
            data.qpos[model.jnt_qposadr[j]] = q
            data.qvel[model.jnt_dofadr[j]], data.qacc[model.jnt_dofadr[j]] = v, a
        mujoco.mj_inverse(model, data)
        found.append([data.qfrc_inverse[model.jnt_dofadr[j]] for j in ids])
    return np.array(found)


def check(dyngen, file, tip, folder):
    arm, values, states_file = folder / "arm.toml", folder / "arm.values.json", folder / "states.csv"
    values.unlink(missing_ok=True)
    command = [dyngen, "import", file, "--exact", "--force", "-o", arm] + (["--tip", tip] if tip else [])
    if run(command)[0] is None or not values.exists():
        return "not imported"
    joints = re.findall(r'^name = "(.*)"', arm.read_text(), re.M)[1:]
    n = len(joints)
    states = np.random.default_rng(3).uniform(-1.5, 1.5, (STATES, 3 * n))
    head = ",".join(f"{x}{i + 1}" for x in ("q", "dq", "ddq") for i in range(n))
    np.savetxt(states_file, states, delimiter=",", header=head, comments="", fmt="%.17g")
    command = [dyngen, "eval", arm, "--function", "inverse_dynamics", "--states", states_file, "--values", values]

    def difference(model):
        output = run(command)[0]
        if output is None:
            return "not evaluated"
        found = np.array([line.split(",") for line in output.decode().split()[1:]], dtype=float)
        expected = torques(model, joints, states)
        return np.abs(found - expected).max() / max(np.abs(expected).max(), 1e-300)

    before = difference(file)
    scaled = json.loads(values.read_text())
    for name in scaled:
        scaled[name] *= 1 + int("".join(c for c in name if c.isdigit())) / 32
    values.write_text(json.dumps(scaled))
    new = folder / "new.xml"
    export = [dyngen, "export", file, "--arm", arm, "--values", values, "--to", "mjcf", "--force", "-o", new]
    if run(export)[0] is None:
        return before if isinstance(before, str) else "not exported"
    after = difference(new)
    return before if isinstance(before, str) else after if isinstance(after, str) else max(before, after)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dyngen", required=True, help="the program")
    parser.add_argument("--urdf", type=pathlib.Path, help="a folder of URDF files")
    parser.add_argument("--mjcf", type=pathlib.Path, help="a folder of MuJoCo models of serial arms")
    options = parser.parse_args()
    worst, count = 0.0, 0
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        jobs = [(path, None) for path in sorted(options.mjcf.glob("*.xml"))] if options.mjcf else []
        for path in sorted(options.urdf.glob("*.urdf")) if options.urdf else []:
            chain, file = longest_chain(path), folder / f"{path.stem}.xml"
            if chain is not None and saved(path, file):
                jobs.append((file, chain[1]))
        for file, tip in jobs:
            found = check(options.dyngen, file, tip, folder)
            print(file.stem, found, flush=True)
            if not isinstance(found, str):
                worst, count = max(worst, found), count + 1
    print(f"{count} models, worst {worst:.1e}")
    sys.exit(0 if worst < 1e-6 else 1)


if __name__ == "__main__":
    main()
