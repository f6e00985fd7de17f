#!/usr/bin/env python3
"""Exported URDFs against Pinocchio: other values, written into the original, give the torque of those values.

    pip install pin numpy
    cargo build --release -p dyngen
    python3 benches/export.py --dyngen target/release/dyngen --urdf FOLDER

Every link's parameters are scaled by a factor of its own between 1 and 1.5, which leaves them those of a body; friction
and its standard errors are made up. Pinocchio then loads the new file. What is printed is the largest difference of inverse
dynamics over 20 random states, relative to the largest torque there, for each file; the exit code is 1 where one is above
1e-9 or where more than the elements that hold values has changed.
"""

import argparse
import json
import pathlib
import sys
import tempfile
import xml.etree.ElementTree as ET

import numpy as np
from arms import STATES, longest_chain, run, torques


def outline(path):
    """All elements but those that hold values, with their attributes."""
    held = ("inertial", "dynamics", "limit")
    walk = lambda node: [(node.tag, sorted(node.attrib.items()))] + [
        item for child in node if child.tag not in held for item in walk(child)
    ]
    return walk(ET.parse(path).getroot())


def check(dyngen, path, folder):
    chain = longest_chain(path)
    if chain is None:
        return None
    joints, tip = chain
    n = len(joints)
    arm, values, new = folder / "arm.toml", folder / "arm.values.json", folder / "new.urdf"
    values.unlink(missing_ok=True)
    if run([dyngen, "import", path, "--tip", tip, "--exact", "--force", "-o", arm])[0] is None or not values.exists():
        return None
    scaled = json.loads(values.read_text())
    for name in scaled:
        scaled[name] *= 1 + int("".join(c for c in name if c.isdigit())) / 32
    values.write_text(json.dumps(scaled))
    identified = folder / "identified.json"
    friction = [dict(joint=j + 1, gamma1=0.5, gamma2=50, gamma3=0.25, gamma4=5, gamma5=1.5, std=[0.01] * 5) for j in range(n)]
    identified.write_text(json.dumps({"friction": friction}))
    command = [dyngen, "export", path, "--arm", arm, "--values", values, "--friction", identified, "--to", "urdf", "--force"]
    if run(command + ["--tip", tip, "-o", new])[0] is None:
        return "refused"
    if outline(path) != outline(new):
        return "changed elsewhere"
    states = np.random.default_rng(2).uniform(-1.5, 1.5, (STATES, 3 * n))
    file = folder / "states.csv"
    head = ",".join(f"{x}{i + 1}" for x in ("q", "dq", "ddq") for i in range(n))
    np.savetxt(file, states, delimiter=",", header=head, comments="", fmt="%.17g")
    output = run([dyngen, "eval", arm, "--function", "inverse_dynamics", "--states", file, "--values", values])[0]
    if output is None:
        return None
    try:
        expected = torques(new, joints, states)
    except ValueError:
        return None
    found = np.array([line.split(",") for line in output.decode().split()[1:]], dtype=float)
    return np.abs(found - expected).max() / max(np.abs(expected).max(), 1e-300)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dyngen", required=True, help="the program")
    parser.add_argument("--urdf", required=True, type=pathlib.Path, help="a folder of URDF files")
    options = parser.parse_args()
    worst = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for path in sorted(options.urdf.glob("*.urdf")):
            found = check(options.dyngen, path, pathlib.Path(folder))
            print(path.stem, found)
            if isinstance(found, str):
                worst = np.inf
            elif found is not None:
                worst = max(worst, found)
    print("worst", worst)
    sys.exit(0 if worst < 1e-9 else 1)


if __name__ == "__main__":
    main()
