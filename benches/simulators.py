#!/usr/bin/env python3
"""What `powerball export` writes for simulators, against their own libraries: what `.ci/arms` runs.

    pip install pin usd-core fmpy numpy
    cargo build --release --bin powerball --bin dyngen
    python3 benches/simulators.py --powerball target/release/powerball --dyngen target/release/dyngen

Arms of dyngen/tests/urdf, whose values are written as a result of `powerball identify`, are exported. Then

1. sdf: inverse dynamics by Pinocchio of the model as it is read from the XML is that of `dyngen eval`, and that by Drake
   (pip install drake), which reads SDF by its own library, where it is there; friction, damping and limits are the result's;
2. usd: the stage opens in usd-core without a complaint, and inverse dynamics of what UsdPhysics reads in it is the same, with
   armature and friction in the units of PhysX;
3. fmu: fmpy finds no fault, the functions are those of the standard's headers, and what it simulates goes, with steps of half
   the length twice as near, to where a Runge-Kutta method with Pinocchio's forward dynamics goes.

The exit code is 1 where a difference is too large.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

import fmpy
import fmpy.validation
import numpy as np
import pinocchio as pin
from pxr import Usd, UsdGeom, UsdPhysics

URDF = pathlib.Path(__file__).resolve().parent.parent / "dyngen" / "tests" / "urdf"
ARMS = ["puma", "slider"]
WORST = {}


def note(what, difference, limit):
    WORST[what] = max(WORST.get(what, (0.0, limit)), (float(difference), limit))


class Arm:
    """An arm of the tests with a result of `identify`, whose friction and rotors are made up."""

    def __init__(self, name, options, folder):
        self.folder, self.powerball, self.dyngen = folder, options.powerball.resolve(), options.dyngen.resolve()
        self.file, values = folder / f"{name}.toml", folder / f"{name}.values.json"
        urdf = folder / f"{name}.urdf"
        # The column of slider.urdf has an inertia that no body has.
        urdf.write_text((URDF / urdf.name).read_text().replace('iyy="0.3"', 'iyy="0.25"'))
        self.call(self.dyngen, "import", urdf, "--exact", "-o", self.file)
        self.values = {k: v for k, v in json.loads(values.read_text()).items() if not k.startswith("Im")}
        described = json.loads(self.call(self.dyngen, "describe", self.file, "--json"))
        self.names = [line.split('"')[1] for line in self.file.read_text().splitlines() if line.startswith("name")][1:]
        self.n = len(self.names)
        random = np.random.default_rng(len(name))
        # A light joint with the friction of a heavy one would be too stiff for Runge and Kutta.
        self.inertia = np.diag(self.eval("mass_matrix", np.zeros((1, self.n))).reshape(self.n, self.n))
        self.gamma = random.uniform([3, 15, 1, 2, 1], [9, 30, 3, 5, 4], (self.n, 5))
        self.gamma[:, [0, 2, 4]] *= self.inertia[:, None]
        value = lambda p: sum(t["value"] * self.values.get(t["parameter"], 0.0) for t in p["terms"])
        self.result = {
            "arm": described["arm"],
            "parameters": [{"name": p["name"], "value": value(p)} for p in described["sets"]["minimal"]["parameters"]],
            "friction": [{"joint": j + 1, **{f"gamma{k + 1}": g for k, g in enumerate(row)}} for j, row in enumerate(self.gamma)],
            "consistent": {"parameters": self.values},
        }

    def call(self, *command):
        done = subprocess.run(command, capture_output=True)
        assert done.returncode == 0, f"{command}: {done.stderr.decode()}"
        return done.stdout.decode()

    def exported(self, form, result, name="identified.json"):
        """The file of a form, and what it cannot hold."""
        source, new = self.folder / name, self.folder / f"arm.{form}"
        source.write_text(json.dumps(result))
        new.unlink(missing_ok=True)
        said = self.call(self.powerball, "export", "--for", form, "--arm", self.file, source, "-o", new, "--json")
        return new, json.loads(said)["notes"]

    def eval(self, function, states):
        """By `dyngen eval`; states are q, and then dq and ddq where there are more columns."""
        file, values = self.folder / "states.csv", self.folder / "all.json"
        head = [f"{x}{i + 1}" for x in ("q", "dq", "ddq") for i in range(self.n)][: states.shape[1]]
        np.savetxt(file, states, delimiter=",", header=",".join(head), comments="", fmt="%.17g")
        values.write_text(json.dumps(self.values))
        lines = self.call(self.dyngen, "eval", self.file, "--function", function, "--states", file, "--values", values)
        return np.array([line.split(",") for line in lines.split()[1:]], dtype=float)


def chain(joints, gravity):
    """A model of Pinocchio: of each joint kind, placement, mass, centre and inertia about it."""
    model, last = pin.Model(), 0
    for name, kind, placement, mass, centre, inertia in joints:
        joint = {"revolute": pin.JointModelRZ, "prismatic": pin.JointModelPZ}[kind]()
        last = model.addJoint(last, joint, placement, name)
        model.appendBodyToJoint(last, pin.Inertia(mass, np.array(centre), np.array(inertia)), pin.SE3.Identity())
    model.gravity.linear = np.array(gravity)
    return model


def inverse(model, states):
    data = model.createData()
    return np.array([pin.rnea(model, data, *np.split(state, 3)) for state in states])


def apart(found, expected):
    return np.abs(found - expected).max() / np.abs(expected).max()


def sdf(arm, states, expected):
    file, notes = arm.exported("sdf", arm.result)
    text = file.read_text()
    assert all(note in text.replace("- -", "--") for note in notes), "notes stand in the file"
    model = ElementTree.fromstring(text).find("model")
    numbers = lambda element: np.array(element.text.split(), dtype=float)

    def pose(element):
        x, y, z, *rpy = numbers(element)
        return pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array([x, y, z]))

    joints, links = [], {link.get("name"): link for link in model.iter("link")}
    for j, joint in enumerate(x for x in model.iter("joint") if x.get("type") != "fixed"):
        link = links[joint.find("child").text]
        assert link.find("pose").get("relative_to") == joint.find("parent").text
        inertial = link.find("inertial")
        xx, xy, xz, yy, yz, zz = (float(e.text) for e in inertial.find("inertia"))
        inertia = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
        centre = pose(inertial.find("pose"))
        mass = float(inertial.find("mass").text)
        joints.append((joint.get("name"), joint.get("type"), pose(link.find("pose")), mass, centre.translation, inertia))
        dynamics = joint.find("axis/dynamics")
        pair = [float(dynamics.find(key).text) for key in ("friction", "damping")]
        note("sdf: friction", apart(np.array(pair), arm.gamma[j] @ [[1, 0], [0, 0], [1, 0], [0, 0], [0, 1]]), 1e-12)
    # What the note says of gravity.
    said = next(line for line in notes if line.startswith("gravity"))
    gravity = [float(x) for x in said.split("(")[1].split(")")[0].split(",")]
    note("sdf: torque by Pinocchio", apart(inverse(chain(joints, gravity), states), expected), 1e-9)
    try:
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import MultibodyPlant
        from pydrake.multibody.tree import MultibodyForces
    except ImportError:
        return
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(file))
    plant.mutable_gravity_field().set_gravity_vector(np.array(gravity))
    plant.Finalize()
    context, found = plant.CreateDefaultContext(), []
    for state in states:
        q, v, a = np.split(state, 3)
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        forces = MultibodyForces(plant)
        forces.SetZero()
        plant.CalcForceElementsContribution(context, forces)
        damping = arm.gamma[:, 4] * v
        found.append(plant.CalcInverseDynamics(context, a, forces) - damping)
    note("sdf: torque by Drake, its damping taken off", apart(np.array(found), expected), 1e-9)


def usd(arm, states, expected):
    rotor = dict(arm.values, Im1=2e-5)
    with_rotor = arm.file.with_name("rotor.toml")
    with_rotor.write_text(arm.file.read_text().replace("[[joint]]", "[[joint]]\nrotor_ratio = 100", 1))
    plain, arm.file = arm.file, with_rotor
    described = json.loads(arm.call(arm.dyngen, "describe", with_rotor, "--json"))
    value = lambda p: sum(t["value"] * rotor.get(t["parameter"], 0.0) for t in p["terms"])
    parameters = [{"name": p["name"], "value": value(p)} for p in described["sets"]["minimal"]["parameters"]]
    file, notes = arm.exported("usd", dict(arm.result, parameters=parameters, consistent={"parameters": rotor}))
    arm.file = plain
    assert any("armature" in line for line in notes), notes
    stage = Usd.Stage.Open(str(file))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1 and UsdPhysics.GetStageKilogramsPerUnit(stage) == 1
    scene = UsdPhysics.Scene(next(p for p in stage.Traverse() if p.IsA(UsdPhysics.Scene)))
    gravity = np.array(scene.GetGravityDirectionAttr().Get()) * scene.GetGravityMagnitudeAttr().Get()
    root = stage.GetDefaultPrim()
    assert root.HasAPI(UsdPhysics.ArticulationRootAPI)
    turn = lambda q: pin.Quaternion(q.GetReal(), *q.GetImaginary()).normalized().toRotationMatrix()
    world, joints = UsdGeom.XformCache(), []
    moving = [p for p in stage.Traverse() if p.IsA(UsdPhysics.RevoluteJoint) or p.IsA(UsdPhysics.PrismaticJoint)]
    for j, prim in enumerate(moving):
        revolute = prim.IsA(UsdPhysics.RevoluteJoint)
        joint = (UsdPhysics.RevoluteJoint if revolute else UsdPhysics.PrismaticJoint)(prim)
        before, behind = (stage.GetPrimAtPath(r.GetTargets()[0]) for r in (joint.GetBody0Rel(), joint.GetBody1Rel()))
        assert joint.GetAxisAttr().Get() == "Z" and behind.HasAPI(UsdPhysics.RigidBodyAPI)
        placement = pin.SE3(turn(joint.GetLocalRot0Attr().Get()), np.array(joint.GetLocalPos0Attr().Get(), dtype=float))
        # Rows are axes in USD.
        poses = [np.array(world.GetLocalToWorldTransform(p)).T for p in (before, behind)]
        note("usd: bodies where the joints put them", np.abs(poses[0] @ placement.homogeneous - poses[1]).max(), 1e-6)
        mass = UsdPhysics.MassAPI(behind)
        axes = turn(mass.GetPrincipalAxesAttr().Get())
        inertia = axes @ np.diag(mass.GetDiagonalInertiaAttr().Get()) @ axes.T
        kind = "revolute" if revolute else "prismatic"
        centre = np.array(mass.GetCenterOfMassAttr().Get(), dtype=float)
        joints.append((prim.GetName(), kind, placement, mass.GetMassAttr().Get(), centre, inertia))
        instance, degree = ("angular", 180 / np.pi) if revolute else ("linear", 1.0)
        physx = lambda key: prim.GetAttribute(f"physxJointAxis:{instance}:{key}").Get()
        pair = [physx("dynamicFrictionEffort"), degree * physx("viscousFrictionCoefficient")]
        note("usd: friction", apart(np.array(pair), arm.gamma[j] @ [[1, 0], [0, 0], [1, 0], [0, 0], [0, 1]]), 1e-6)
        assert (physx("armature") is None) == (j > 0)
        drive = UsdPhysics.DriveAPI.Get(prim, instance)
        assert drive.GetDampingAttr().Get() == 0 and drive.GetStiffnessAttr().Get() == 0
    first = moving[0].IsA(UsdPhysics.RevoluteJoint)
    armature = moving[0].GetAttribute(f"physxJointAxis:{'angular' if first else 'linear'}:armature").Get()
    note("usd: armature", abs(armature / 0.2 - 1), 1e-6)
    # Numbers of UsdPhysics are single.
    note("usd: torque", apart(inverse(chain(joints, gravity), states), expected), 1e-5)
    # What UsdPhysics finds: every body and joint, and one articulation.
    load = getattr(UsdPhysics, "UsdPhysicsLoadStageFromPrimRange", None) or UsdPhysics.LoadUsdPhysicsFromRange
    found = load(stage, ["/"])
    counts = {str(kind).rsplit(".", 1)[-1]: len(objects[0]) for kind, objects in found.items()}
    assert counts.get("Articulation") == 1 and counts.get("RigidBody") == len(joints) + 1, counts
    return chain(joints, gravity)


def fmu(arm, model):
    sizes = arm.inertia[:3] * [3, 2, 1.5]
    terms = [
        {"effect": "spring", "joint": 1, "coefficient": sizes[0], "law": "position"},
        {"effect": "position_ripple", "joint": 2, "coefficient": sizes[1], "law": "cosine", "order": 6.0},
        {"effect": "stribeck", "joint": 3, "coefficient": sizes[2], "law": "stribeck", "steepness": 20.0, "velocity": 0.2},
    ]
    del arm.result["consistent"]
    file, notes = arm.exported("fmu", dict(arm.result, terms=terms), "model.json")
    assert not any("library" in line for line in notes), notes
    assert not fmpy.validation.validate_fmu(str(file)), fmpy.validation.validate_fmu(str(file))
    unpacked = fmpy.extract(str(file))
    sources = pathlib.Path(unpacked) / "sources"
    headers = pathlib.Path(fmpy.__file__).parent / "c-code"
    check_prototypes(sources, headers)
    names, n, data = arm.names, arm.n, model.createData()
    start, stop, step = np.linspace(0.1, 0.5, n), 0.4, 0.002
    # Of the pose where it begins: it moves, and does not run away.
    weight = pin.computeGeneralizedGravity(model, data, start)
    torque = lambda t: weight + 30 * arm.inertia * np.sin(9 * t + np.arange(n))
    held = lambda t: torque(step * np.floor(t / step + 1e-6))

    def derivative(t, q, v):
        g = arm.gamma.T
        friction = g[0] * np.tanh(g[1] * v) + g[2] * np.tanh(g[3] * v) + g[4] * v
        effects = np.zeros(n)
        effects[:3] = sizes * [q[0], np.cos(6 * q[1]), np.tanh(20 * v[2]) * np.exp(-((v[2] / 0.2) ** 2))]
        return v, pin.aba(model, data, q, v, held(t) - friction - effects)

    q, v, h = start.copy(), np.zeros(n), step / 40
    for k in range(round(stop / h)):
        t = step * (k // 40)
        k1 = derivative(t, q, v)
        k2 = derivative(t, q + h / 2 * k1[0], v + h / 2 * k1[1])
        k3 = derivative(t, q + h / 2 * k2[0], v + h / 2 * k2[1])
        k4 = derivative(t, q + h * k3[0], v + h * k3[1])
        q, v = (x + h / 6 * (a + 2 * b + 2 * c + d) for x, a, b, c, d in zip((q, v), k1, k2, k3, k4))
    errors = []
    for longest in (1e-4, 5e-5):
        input_type = [("time", float)] + [(f"tau.{name}", float) for name in names]
        times = step * np.arange(round(stop / step) + 1)
        given = np.array([(t, *torque(t)) for t in times], dtype=input_type)
        # Torques are held over a step.
        result = fmpy.simulate_fmu(
            unpacked,
            stop_time=stop,
            step_size=step,
            output_interval=step,
            start_values={"max_step": longest, **{f"q.{name}": x for name, x in zip(names, start)}},
            input=given,
            output=[f"q.{name}" for name in names],
        )
        errors.append(np.array([result[f"q.{name}"][-1] for name in names]) - q)
    moved = np.abs(q - start).max()
    assert moved > 0.1, moved
    note("fmu: path", np.abs(errors[1]).max() / moved, 1e-3)
    # What is in proportion to the step cancels.
    left = np.abs(2 * errors[1] - errors[0]).max() / np.abs(errors[1]).max()
    note("fmu: share of the path's error that is not in proportion to the step", left, 0.1)


def check_prototypes(sources, headers):
    """Each function has the type that the standard's headers give it: both in one file, which a compiler refuses otherwise."""
    text = (sources / "fmi3.c").read_text()
    first, last = text.index("typedef enum"), text.index("/* Value references")
    (sources / "declared.c").write_text(
        text[:first] + f'#include "{headers / "fmi3Functions.h"}"\n' + text[last:]
    )
    done = subprocess.run(["cc", "-std=c99", "-fsyntax-only", "declared.c"], cwd=sources, capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    declared = (headers / "fmi3Functions.h").read_text()
    functions = {word for word in declared.replace(";", " ").split() if word.startswith("fmi3") and not word.endswith("TYPE")}
    library = next((sources.parent / "binaries").glob("*/*"))
    symbols = set(subprocess.run(["nm", "-D", library], check=True, capture_output=True).stdout.decode().split())
    missing = {f for f in functions if f"{f}TYPE" in declared and f not in symbols}
    assert not missing and "motion_step" not in symbols, missing


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--powerball", required=True, type=pathlib.Path, help="the program")
    parser.add_argument("--dyngen", required=True, type=pathlib.Path, help="the program")
    options = parser.parse_args()
    for name in ARMS:
        with tempfile.TemporaryDirectory() as folder:
            arm = Arm(name, options, pathlib.Path(folder))
            states = np.random.default_rng(1).uniform(-1.5, 1.5, (50, 3 * arm.n))
            expected = arm.eval("inverse_dynamics", states)
            sdf(arm, states, expected)
            fmu(arm, usd(arm, states, expected))
    for what, (difference, limit) in WORST.items():
        print(f"{what}: {difference:.2e} (limit {limit:.0e})")
    return int(any(not difference <= limit for difference, limit in WORST.values()))


if __name__ == "__main__":
    sys.exit(main())
