#!/usr/bin/env python3
"""Arms there and back, against Pinocchio and MuJoCo: what `.ci/arms` runs.

    pip install pin mujoco numpy
    cargo build --release -p dyngen
    python3 benches/round_trip.py --dyngen target/release/dyngen --urdf FOLDER [--sample 12 --seed 1]

Of a seeded sample of the folder's URDFs (all of them without --sample):

1. imported (--exact), `dyngen eval` gives the torque that Pinocchio gives for the file;
2. `dyngen generate --values`, compiled (all arms as one crate, under target/), gives the same;
3. other values, exported into the URDF: Pinocchio and MuJoCo load the new file and give the torque of those values.

Differences are those of inverse dynamics over 20 random states, relative to the largest torque there. The exit code is 1 where
one is above 1e-9, where a command fails, or where fewer than three arms could be compared.
"""

import argparse
import json
import pathlib
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ET

import numpy as np
from arms import STATES, longest_chain, run
from arms import torques as by_pinocchio
from mjcf import torques as by_mujoco

LIMIT = 1e-9
ROOT = pathlib.Path(__file__).resolve().parent.parent
CARGO = """[package]
name = "round-trip"
version = "0.0.0"
edition = "2024"
publish = false
[dependencies]
nalgebra = { version = "0.35", default-features = false, features = ["libm"] }
[workspace]
"""


def apart(found, expected):
    return float(np.abs(found - expected).max() / max(np.abs(expected).max(), 1e-300))


def bare(path, file):
    """A URDF without shapes, as MuJoCo takes it."""
    root = ET.parse(path).getroot()
    for link in root.findall("link"):
        for shape in link.findall("visual") + link.findall("collision"):
            link.remove(shape)
    for kind in ("material", "gazebo", "transmission", "mujoco"):
        for node in root.findall(kind):
            root.remove(node)
    compiler = dict(fusestatic="false", balanceinertia="false", discardvisual="true", boundmass="0", boundinertia="0")
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", compiler)
    file.write_text(ET.tostring(root, encoding="unicode"))


class Arm:
    """One URDF with what dyngen makes of it."""

    def __init__(self, dyngen, path, folder):
        self.dyngen, self.path, self.folder = dyngen, path, folder
        folder.mkdir()
        self.followers = ()
        (self.joints, self.tip) = longest_chain(path) or self.coupled_chain()
        self.arm, self.values, self.states_file = folder / "arm.toml", folder / "arm.values.json", folder / "states.csv"
        n = len(self.joints)
        self.states = np.random.default_rng(1).uniform(-1.5, 1.5, (STATES, 3 * n))
        head = ",".join(f"{x}{i + 1}" for x in ("q", "dq", "ddq") for i in range(n))
        np.savetxt(self.states_file, self.states, delimiter=",", header=head, comments="", fmt="%.17g")

    def coupled_chain(self):
        """The joints of a file that is one chain, in which some follow others."""
        joints = [j for j in ET.parse(self.path).getroot().findall("joint") if j.get("type") != "fixed"]
        self.followers = [j.get("name") for j in joints if j.find("mimic") is not None]
        return [j.get("name") for j in joints if j.find("mimic") is None], None

    def options(self):
        return ["--tip", self.tip] if self.tip else []

    def command(self, *arguments):
        output = run([self.dyngen, *arguments])[0]
        if output is None:
            raise RuntimeError(f"{self.path.stem}: dyngen {arguments[0]} failed")
        return output

    def line(self, found):
        return f"{self.path.stem}, {len(self.joints)} joints: " + ", ".join(f"{k} {v:.0e}" for k, v in found.items())

    def imported(self):
        self.command("import", self.path, *self.options(), "--exact", "--force", "-o", self.arm)
        return self.values.exists()

    def evaluated(self):
        output = self.command(
            "eval", self.arm, "--function", "inverse_dynamics", "--states", self.states_file, "--values", self.values
        )
        return np.array([line.split(",") for line in output.decode().split()[1:]], dtype=float)

    def real(self):
        """Whether each link's parameters are those of a body."""
        return run([self.dyngen, "check", self.arm, "--values", self.values])[0] is not None

    def generated(self, file):
        self.command("generate", self.arm, "--values", self.values, "--functions", "inverse_dynamics", "-o", file)

    def exported(self):
        """The new file, with other values; `evaluated` is then the torque of those."""
        scaled = json.loads(self.values.read_text())
        for name in scaled:
            scaled[name] *= 1 + int(re.sub(r"\D", "", name)) / 32
        self.values.write_text(json.dumps(scaled))
        new = self.folder / "new.urdf"
        files = ["--arm", self.arm, "--values", self.values]
        self.command("export", self.path, *files, "--to", "urdf", *self.options(), "-o", new)
        return new


def compiled(arms, folder):
    """Torques of all arms by their generated code."""
    source = folder / "src"
    source.mkdir(parents=True)
    (folder / "Cargo.toml").write_text(CARGO)
    shutil.copy(ROOT / "Cargo.lock", folder / "Cargo.lock")
    main, calls = ["#![allow(dead_code)]"], []
    for k, arm in enumerate(arms):
        arm.generated(source / f"arm{k}.rs")
        main.append(f"mod arm{k};")
        n = len(arm.joints)
        rows = ",".join("[" + ",".join(f"{x!r}f64" for x in state.tolist()) + "]" for state in arm.states)
        calls.append(f"""    for s in [{rows}] {{
        let part = |k: usize| nalgebra::SVector::<f64, {n}>::from_fn(|i, _| s[k * {n} + i]);
        let torque = arm{k}::inverse_dynamics(&part(0), &part(1), &part(2));
        println!("{{}}", torque.iter().map(|x| format!("{{x:e}}")).collect::<Vec<_>>().join(" "));
    }}""")
    (source / "main.rs").write_text("\n".join(main + ["fn main() {"] + calls + ["}"]))
    command = ["cargo", "run", "--release", "--quiet", "--manifest-path", str(folder / "Cargo.toml")]
    output = subprocess.run(command, capture_output=True, text=True)
    if output.returncode != 0:
        raise RuntimeError(f"the generated code does not compile:\n{output.stderr[-3000:]}")
    lines = output.stdout.split("\n")
    return [np.array([line.split() for line in lines[k * STATES : (k + 1) * STATES]], float) for k in range(len(arms))]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dyngen", required=True, type=pathlib.Path, help="the program")
    parser.add_argument("--urdf", required=True, type=pathlib.Path, help="a folder of URDF files")
    parser.add_argument("--sample", type=int, help="how many of them")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--coupled", type=pathlib.Path, help="a folder of URDFs of one chain, in which joints follow others")
    parser.add_argument("--joints", type=int, default=1, help="only chains of at least this many joints")
    options = parser.parse_args()
    start = time.monotonic()
    chains = ((path, longest_chain(path)) for path in sorted(options.urdf.glob("*.urdf")))
    paths = [path for path, chain in chains if chain and len(chain[0]) >= options.joints]
    # A xacro that was not expanded is another robot, which import says.
    paths = [path for path in paths if "<xacro:" not in path.read_text(errors="replace")]
    if options.sample:
        random.Random(options.seed).shuffle(paths)
    coupled = sorted(options.coupled.glob("*.urdf")) if options.coupled else []
    worst, arms, expected = 0.0, [], []
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for path in coupled + paths:
            if options.sample and len(arms) == options.sample + len(coupled):
                break
            try:
                arm = Arm(options.dyngen.resolve(), path, folder / path.stem)
                reference = by_pinocchio(path, arm.joints, arm.states, arm.followers)
            except ValueError:
                print(f"{path.stem}: Pinocchio does not load it")
                continue
            if not np.isfinite(reference).all() or np.abs(reference).max() < 1e-6 or not arm.imported():
                print(f"{path.stem}: it has no inertia")
                continue
            arms.append(arm)
            expected.append(reference)
        code = compiled(arms, folder / "crate")
        for arm, reference, torque in zip(arms, expected, code):
            found = {"eval": apart(arm.evaluated(), reference), "compiled": apart(torque, reference)}
            if not arm.real():
                print(f"{arm.path.stem}: no body has the inertia of one of its links, which export refuses")
                worst = max(worst, *found.values())
                continue
            new = arm.exported()
            torque = arm.evaluated()
            found["export, Pinocchio"] = apart(
                by_pinocchio(new, arm.joints, arm.states, arm.followers), torque
            )
            bare(new, arm.folder / "bare.urdf")
            if arm.followers:
                # MuJoCo makes springs of them.
                worst = max(worst, *found.values())
                print(arm.line(found))
                continue
            try:
                found["export, MuJoCo"] = apart(by_mujoco(arm.folder / "bare.urdf", arm.joints, arm.states), torque)
            except ValueError as e:
                # Not of this file alone: MuJoCo refuses the original too.
                bare(arm.path, arm.folder / "bare.urdf")
                try:
                    by_mujoco(arm.folder / "bare.urdf", arm.joints, arm.states)
                except ValueError:
                    print(f"{arm.path.stem}: MuJoCo does not load the original: {str(e).splitlines()[0]}")
                else:
                    raise
            worst = max(worst, *found.values())
            print(arm.line(found))
    print(f"{len(arms)} arms in {time.monotonic() - start:.0f} s, worst {worst:.1e}")
    sys.exit(0 if worst < LIMIT and len(arms) >= 3 else 1)


if __name__ == "__main__":
    main()
