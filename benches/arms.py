#!/usr/bin/env python3
"""Arms of public URDFs through dyngen, against Pinocchio: writes docs/results/arms.md.

    pip install pin numpy          # Pinocchio 4 from PyPI
    cargo build --release -p dyngen
    python3 benches/arms.py --dyngen target/release/dyngen --urdf FOLDER... --joints 6 > docs/results/arms.md

Each FOLDER is searched for URDF files, of which equal ones count once. Of each the longest chain of joints that move on their own
is taken. Time (the processor's) and memory are those of one `dyngen describe` process, which derives the sets, and builds and
proves every function. The error is the largest difference of inverse dynamics over 20 random states, relative to the largest
torque there, between `dyngen eval` on the arm as the file says it (--exact) and Pinocchio on the file. The table has the chains of at least
as many joints as --joints gives; the sentence above it counts all.
"""

import argparse
import hashlib
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin

MOVING = ("revolute", "continuous", "prismatic")
STATES = 20
LIMIT = 120  # seconds for one process


def longest_chain(path):
    """Names of the joints and the tip of the longest chain that an arm file can hold."""
    try:
        root = ET.parse(path).getroot()
    except ET.ParseError:
        return None
    above = {}
    for joint in root.findall("joint"):
        if joint.get("type") and joint.find("child") is not None and joint.find("parent") is not None:
            above[joint.find("child").get("link")] = joint
    parents = {joint.find("parent").get("link") for joint in above.values()}
    best = None
    for link in (link.get("name") for link in root.findall("link")):
        if link in parents:
            continue
        names, at, seen = [], link, set()
        while at in above and at not in seen:
            seen.add(at)
            joint = above[at]
            if joint.get("type") in MOVING and joint.find("mimic") is None:
                names.append(joint.get("name"))
            elif joint.get("type") != "fixed":
                names = []
                break
            at = joint.find("parent").get("link")
        if 0 < len(names) <= 16 and (best is None or len(names) > len(best[0])):
            best = (names[::-1], link)
    return best


def run(command):
    """Output, seconds and peak memory in MB of a process; no output where it fails or takes too long."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, preexec_fn=limited)
    output = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    return (output if status == 0 else None), usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def limited():
    """A process that takes too long, or too much memory, ends."""
    import resource

    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT))
    resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))


def torques(path, joints, states, followers=()):
    """Pinocchio's inverse dynamics of the chain, in which some joints may follow others by their <mimic>; what hangs on
    other joints is massless, as for dyngen."""
    model = pin.buildModelFromUrdf(str(path), mimic=True) if followers else pin.buildModelFromUrdf(str(path))
    ids = [model.getJointId(name) for name in joints]
    kept = {*ids, *(model.getJointId(name) for name in followers)}
    for j in range(1, model.njoints):
        if j not in kept:
            model.inertias[j] = pin.Inertia.Zero()
    data = model.createData()
    found = []
    for state in states:
        q, v, a = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        for j, (x, dx, ddx) in zip(ids, zip(*np.split(state, 3))):
            joint = model.joints[j]
            q[joint.idx_q : joint.idx_q + joint.nq] = (np.cos(x), np.sin(x)) if joint.nq == 2 else x
            v[joint.idx_v], a[joint.idx_v] = dx, ddx
        tau = pin.rnea(model, data, q, v, a)
        found.append([tau[model.joints[j].idx_v] for j in ids])
    return np.array(found)


def error(dyngen, path, joints, tip, folder):
    """Of inverse dynamics; none where the file has no inertia or Pinocchio does not read it."""
    arm, values, file = folder / "exact.toml", folder / "exact.values.json", folder / "states.csv"
    values.unlink(missing_ok=True)
    if run([dyngen, "import", path, "--tip", tip, "--exact", "--force", "-o", arm])[0] is None:
        return None
    if not values.exists():
        return None
    n = len(joints)
    states = np.random.default_rng(1).uniform(-1.5, 1.5, (STATES, 3 * n))
    head = ",".join(f"{x}{i + 1}" for x in ("q", "dq", "ddq") for i in range(n))
    np.savetxt(file, states, delimiter=",", header=head, comments="", fmt="%.17g")
    command = [dyngen, "eval", arm, "--function", "inverse_dynamics", "--states", file, "--values", values]
    output = run(command)[0]
    try:
        expected = torques(path, joints, states)
    except ValueError:
        return None
    if output is None:
        return None
    found = np.array([line.split(",") for line in output.decode().split()[1:]], dtype=float)
    return np.abs(found - expected).max() / max(np.abs(expected).max(), 1e-300)


def row(dyngen, path, folder):
    chain = longest_chain(path)
    if chain is None:
        return None
    joints, tip = chain
    arm = folder / "arm.toml"
    if run([dyngen, "import", path, "--tip", tip, "--force", "-o", arm])[0] is None:
        return (path.stem, len(joints), None)
    output, seconds, memory = run([dyngen, "describe", arm, "--json"])
    if output is None:
        return (path.stem, len(joints), None)
    sets = json.loads(output)["sets"]
    return (path.stem, len(joints), (sets["minimal"]["count"], seconds, memory, error(dyngen, path, joints, tip, folder)))


def files(folders):
    """URDF files by a name of their own; equal files once."""
    seen, named = set(), {}
    for path in sorted(path for folder in folders for path in folder.rglob("*.urdf")):
        digest = hashlib.sha256(path.read_bytes()).digest()
        if digest not in seen:
            seen.add(digest)
            name, above = path.stem, path.parent
            while name in named:
                name, above = f"{above.name}__{name}", above.parent
            named[name] = path
    return named


def is_loaded(path):
    """Whether Pinocchio reads the file."""
    try:
        pin.buildModelFromUrdf(str(path))
    except ValueError:
        return False
    return True


def largest(values):
    return max(values, default=0.0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dyngen", required=True, help="the program")
    parser.add_argument("--urdf", required=True, nargs="+", type=pathlib.Path, help="folders of URDF files")
    parser.add_argument("--joints", type=int, default=1, help="the table: only chains of at least this many joints")
    options = parser.parse_args()
    rows, loaded = [], []
    with tempfile.TemporaryDirectory() as folder:
        for name, path in files(options.urdf).items():
            if longest_chain(path) is not None:
                rows.append((name, *row(options.dyngen, path, pathlib.Path(folder))[1:]))
                loaded.append(is_loaded(path))
                print(rows[-1], loaded[-1], file=sys.stderr)
    theirs = [found for (_, _, found), reads in zip(rows, loaded) if reads]
    done = [found for found in theirs if found]
    errors = [wrong for *_, wrong in done if wrong is not None]
    print("# Arms of public URDFs\n")
    print("```sh\npython3 benches/arms.py --dyngen target/release/dyngen --urdf FOLDER... --joints 6 > docs/results/arms.md\n```\n")
    print("The files are those of `example-robot-data`, `pybullet` and `rtb-data` from PyPI, and others of public repositories. Of the")
    print(f"{len(theirs)} of them that Pinocchio reads and that hold a serial chain {len(done)} are imported, derived and proven, each in at most")
    print(f"{largest(s for _, s, _, _ in done):.1f} s and {largest(m for _, _, m, _ in done):.0f} MB. {len(errors)} have inertias; their torques differ from Pinocchio's by at most {largest(errors):.0e}.\n")
    print(f"The table has the chains of at least {options.joints} joints, of files that Pinocchio does not read too. It is written by")
    print("`benches/arms.py`, which says what it needs and how each column is measured: time and memory are those of one")
    print("`dyngen describe` process, the processor's time. No error stands where a file has no inertia, or Pinocchio does not read it.\n")
    print("| file | joints | minimal set | time [s] | memory [MB] | error against Pinocchio |")
    print("|---|---|---|---|---|---|")
    for name, joints, found in rows:
        if joints < options.joints:
            continue
        if found is None:
            print(f"| {name} | {joints} | not an arm | | | |")
            continue
        count, seconds, memory, wrong = found
        text = "" if wrong is None else f"{wrong:.0e}"
        print(f"| {name} | {joints} | {count} | {seconds:.1f} | {memory:.0f} | {text} |")


if __name__ == "__main__":
    main()
