#!/usr/bin/env python3
"""Generated C of two generators in one process: dyngen's, and CasADi's of Pinocchio's algorithms.

    pip install pin casadi cmeel-eigen numpy
    cargo build --release -p dyngen
    python3 benches/generators.py --dyngen target/release/dyngen --write docs/results/performance.md \\
        --arm "LWA 4P" dyngen/tests/urdf/lwa4p.urdf \\
        --arm Panda panda.urdf panda_finger_joint1,panda_finger_joint2

--arm is a name, a URDF and the joints that are held at zero. Both generators get the same arm with its
numbers baked in, and the same compiler and flags (--flags). PyPI's Pinocchio has no symbols of CasADi in
Python, so a C++ program over its headers (support/pinocchio_casadi.cpp) writes CasADi's code. g++ takes
minutes for it, so it is kept (--program): remove it where Pinocchio or CasADi is another. Two things make
CasADi's code shorter: entries of joint rotations within 1e-9 of 0 and of ±1 are taken for these, as dyngen
takes angles within 1e-9 rad of a right one, and common subexpressions are merged (CasADi's `cse`).

Results have to agree to 1e-9 of the largest one at 256 random states; of regressors Y·π is compared, as
their columns differ. Then the functions are timed in turn: each figure is the least of many rounds over
these states. Operations are multiplications, additions and divisions in the code; changes of sign, sines
and cosines are not among them. Derivatives are Pinocchio's algorithms for them and, in a second row, CasADi's
Jacobians of τ and q̈; dyngen's are the same functions in both rows.
"""

import argparse
import ctypes
import pathlib
import platform
import re
import subprocess
import sys
import tempfile

import casadi
import numpy as np
import pinocchio as pin

SUPPORT = pathlib.Path(__file__).parent / "support"
STATES, AGREE, SNAP = 256, 1e-9, 1e-9
# Those of Pinocchio's own build.
MACROS = (
    "BOOST_MPL_LIMIT_LIST_SIZE=30",
    "BOOST_MPL_LIMIT_VECTOR_SIZE=30",
    "BOOST_MPL_CFG_NO_PREPROCESSED_HEADERS",
    "BOOST_FUSION_INVOKE_MAX_ARITY=12",
)

BY_TORQUE = ("torque_by_position", "torque_by_velocity")
BY_ACCELERATION = ("acceleration_by_position", "acceleration_by_velocity")
# Name, CasADi's function, dyngen's functions (they share sines), how many of (q, dq, last) these take.
FUNCTIONS = (
    ("sines and cosines", "trigonometry", (), 1),
    ("τ", "inverse_dynamics", ("inverse_dynamics",), 3),
    ("Y", "regressor", ("regressor",), 3),
    ("B", "mass_matrix", ("mass_matrix",), 1),
    ("C", "coriolis_matrix", ("coriolis_matrix",), 2),
    ("C·q̇", "coriolis_times_velocity", ("coriolis_times_velocity",), 2),
    ("g", "gravity", ("gravity",), 1),
    ("∂τ/∂q, ∂τ/∂q̇", "torque_derivatives", BY_TORQUE, 3),
    ("the same; CasADi's Jacobians", "torque_jacobians", BY_TORQUE, 3),
    ("q̈", "forward_dynamics", ("forward_dynamics",), 3),
    ("∂q̈/∂q, ∂q̈/∂q̇", "acceleration_derivatives", BY_ACCELERATION, 3),
    ("the same; CasADi's Jacobians", "acceleration_jacobians", BY_ACCELERATION, 3),
)

# Every function as f(q, dq, last, result), so that one loop times all.
ROUND = """
#include <time.h>
typedef void function(const double *q, const double *dq, const double *last, double *result);
double seconds(function *f, long n, long states,
               const double *q, const double *dq, const double *last, double *result)
{
    struct timespec from, to;
    clock_gettime(CLOCK_MONOTONIC, &from);
    for (long k = 0; k < states; ++k) f(q + k * n, dq + k * n, last + k * n, result);
    clock_gettime(CLOCK_MONOTONIC, &to);
    return (double)(to.tv_sec - from.tv_sec) + 1e-9 * (double)(to.tv_nsec - from.tv_nsec);
}
"""
HEAD = "void run_{name}(const double *q, const double *dq, const double *last, double *result)\n{{\n"


def run(command):
    """Output of a process; what it complains about is shown, and the program ends, where it fails."""
    found = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if found.returncode != 0:
        sys.exit(f"{command[0]} failed:\n{found.stderr[-2000:]}")
    return found.stdout


class Code:
    """The functions of one generator, compiled: what they cost, and how to call them."""

    def __init__(self, source, calls, operations, flags):
        folder = source.parent
        item, adaptor, library = (folder / f"{source.stem}{end}" for end in (".o", "_run.c", ".so"))
        adaptor.write_text(calls)
        run(["gcc", *flags, "-fPIC", "-c", source, "-o", item])
        run(["gcc", *flags, "-fPIC", "-shared", adaptor, item, "-o", library, "-lm"])
        self.bytes = item.stat().st_size
        self.text = int(run(["size", item]).splitlines()[1].split()[0])
        self.operations = operations
        self.angles = 0
        self.library = ctypes.CDLL(str(library))

    def function(self, name):
        return ctypes.cast(getattr(self.library, f"run_{name}"), ctypes.c_void_p)


def chain_of(path, held):
    """Pinocchio's model of the arm, with rotations that are nearly right made right."""
    model = pin.buildModelFromUrdf(str(path))
    model = pin.buildReducedModel(model, [model.getJointId(name) for name in held], pin.neutral(model))
    for placement in model.jointPlacements:
        rotation = placement.rotation.copy()
        near = np.abs(rotation - np.round(rotation)) < SNAP
        rotation[near] = np.round(rotation[near])
        placement.rotation = rotation
    return model


def casadi_code(generator, model, folder, flags):
    """CasADi's code of Pinocchio's algorithms, and how many values each function returns."""
    lines = []
    for k in range(1, model.njoints):
        axis = "XYZ".index(model.joints[k].shortname().removeprefix("JointModelR"))
        place, body = model.jointPlacements[k], model.inertias[k]
        inertia = body.inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
        numbers = (*place.rotation.ravel(), *place.translation, body.mass, *body.lever, *inertia)
        lines.append(" ".join([str(axis), *(repr(float(number)) for number in numbers)]))
    chain = folder / "chain.txt"
    chain.write_text("\n".join(lines) + "\n")
    operations, lengths, instructions = {}, {}, {}
    for line in run([generator, chain, folder]).splitlines():
        name, *counts = line.split()
        lengths[name], sums, divisions, instructions[name] = map(int, counts)
        operations[name] = sums + divisions
    text = "#include <stddef.h>\n"
    for name, work in instructions.items():
        text += f"int {name}(const double **, double **, long long *, double *, int);\n"
        text += HEAD.format(name=name) + f"    static double work[{work}];\n"
        text += "    const double *in[] = {q, dq, last};\n"
        text += f"    double *out[] = {{result}};\n    {name}(in, out, NULL, work, 0);\n}}\n"
    return Code(folder / "casadi.c", text, operations, flags), lengths


def dyngen_code(dyngen, path, held, folder, flags):
    """dyngen's code, and the values of its parameters."""
    arm, source = folder / "arm.toml", folder / "dyngen.c"
    locked = [part for name in held for part in ("--lock", f"{name}=0")]
    run([dyngen, "import", path, "--exact", "--force", *locked, "-o", arm])
    names = ",".join(dict.fromkeys(name for _, _, ours, _ in FUNCTIONS for name in ours))
    values = folder / "arm.values.json"
    run([dyngen, "generate", arm, "--language", "c", "-o", source, "--values", values, "--functions", names])
    header = source.with_suffix(".h").read_text()
    prefix = re.search(r"void (\w+)_trig_of\(", header)[1]
    size = int(re.search(r"_PARAMETERS (\d+)", header)[1])
    joints = int(re.search(r"_JOINTS (\d+)", header)[1])
    operations, text = {"trigonometry": 0}, '#include "dyngen.h"\n'
    for _, name, ours, count in FUNCTIONS:
        text += HEAD.format(name=name)
        arguments = ("q", "dq", "last")[:count]
        if len(ours) == 1:
            text += f"    {prefix}_{ours[0]}({', '.join(arguments)}, (void *)result);\n}}\n"
        elif ours:
            shared = ", ".join(("&trig", *arguments[1:]))
            text += f"    {prefix}_trig trig;\n    {prefix}_trig_of(q, &trig);\n"
            for k, function in enumerate(ours):
                text += f"    {prefix}_{function}_with({shared}, (void *)(result + {k * joints**2}));\n"
            text += "}\n"
        else:
            text += f"    {prefix}_trig_of(q, ({prefix}_trig *)(void *)result);\n}}\n"
        for function in ours:
            found = re.search(rf"Operations: ([^/]*?)\*/\s*void {prefix}_{function}\(", header)[1]
            counts = re.findall(r"(\d+) (?:multiplication|addition|division)", found)
            operations[name] = operations.get(name, 0) + sum(map(int, counts))
    code = Code(source, text, operations, flags)
    code.angles = int(re.search(r"_ANGLES (\d+)", header)[1])
    constants = (ctypes.c_double * size).in_dll(code.library, f"{prefix}_parameter_values")
    return code, np.array(constants)


def pointer(values):
    return values.ctypes.data_as(ctypes.c_void_p)


def room(length, n, parameters):
    """How many numbers either result may have: dyngen's sines have more angles, its Y other columns."""
    return max(length, n * len(parameters), 10 * n)


def values_of(function, seconds, states, length):
    """The function's results at every state."""
    n = states[0].shape[1]
    found = np.zeros((STATES, length))
    for k in range(STATES):
        seconds(function, n, 1, *(pointer(part[k]) for part in states), pointer(found[k]))
    return found


def difference(name, ours, theirs, states, parameters, full, seconds, length):
    """The largest between the two, relative to the largest value."""
    n = states[0].shape[1]
    expected = values_of(theirs.function(name), seconds, states, length)
    found = values_of(ours.function(name), seconds, states, room(length, n, parameters))
    if name == "trigonometry":
        # dyngen's has the angles that are sums after those of the joints.
        found = np.hstack([found[:, :n], found[:, ours.angles : ours.angles + n]])
    if name == "regressor":
        found = found[:, : n * len(parameters)].reshape(STATES, n, -1) @ parameters
        expected = expected.reshape(STATES, n, -1) @ full
    found = found[:, : expected.shape[1]]
    return np.abs(found - expected).max() / np.abs(expected).max()


def timed(name, codes, states, rounds, seconds, width):
    """The least time of a call of each code's function, ns, in turn."""
    result, n = np.zeros(width), states[0].shape[1]
    functions = [code.function(name) for code in codes]
    arguments = [*(pointer(part) for part in states), pointer(result)]
    least = [np.inf] * len(codes)
    for _ in range(rounds):
        for k, function in enumerate(functions):
            least[k] = min(least[k], seconds(function, n, STATES, *arguments))
    return [1e9 * time / STATES for time in least]


def table(name, path, held, options, generator, seconds, folder):
    """The rows of one arm; ends the program where results differ."""
    folder.mkdir()
    model = chain_of(path, held)
    flags = options.flags.split()
    theirs, lengths = casadi_code(generator, model, folder, flags)
    ours, parameters = dyngen_code(options.dyngen, path, held, folder, flags)
    full = np.concatenate([body.toDynamicParameters() for body in list(model.inertias)[1:]])
    random = np.random.default_rng(1)
    states = [random.uniform(-limit, limit, (STATES, model.nv)) for limit in (3.0, 2.0, 5.0)]
    rows, worst = [], 0.0
    for title, function, _, _ in FUNCTIONS:
        wrong = difference(function, ours, theirs, states, parameters, full, seconds, lengths[function])
        if not wrong < AGREE:
            sys.exit(f"{name}: {function}: results differ by {wrong:.1e} of the largest; nothing is written")
        worst = max(worst, wrong)
        width = room(lengths[function], model.nv, parameters)
        times = timed(function, (ours, theirs), states, options.rounds, seconds, width)
        counts = [code.operations[function] or "" for code in (ours, theirs)]
        cells = [title, *(f"{time:.0f}" for time in times), f"{times[1] / times[0]:.1f}", *counts]
        rows.append(f"| {' | '.join(map(str, cells))} |")
        print(name, rows[-1], f"{wrong:.0e}", file=sys.stderr)
    sizes = f"{ours.text} B with dyngen, {theirs.text} B with CasADi"
    head = (
        f"{name}: {model.nv} joints, {len(parameters)} parameters; results differ by at most",
        f"{worst:.0e} of the largest. Code and constants of all functions: {sizes}",
        f"(object files: {ours.bytes} B and {theirs.bytes} B), where CasADi's has both forms of the",
        "derivatives.\n",
        "| function | dyngen, ns | CasADi, ns | CasADi / dyngen | operations: dyngen | CasADi |",
        "|---|---|---|---|---|---|",
    )
    return "\n".join([*head, *rows])


def compiled_generator(program):
    """The C++ program that writes CasADi's code, built where it is not there yet."""
    if program.exists():
        return program
    prefix = next(parent for parent in pathlib.Path(pin.__file__).parents if parent.name == "cmeel.prefix")
    home = pathlib.Path(casadi.__file__).parent
    library = next(home.glob("libcasadi.so.*"), home / "libcasadi.so")
    includes = [f"-I{path}" for path in (prefix / "include", prefix / "include/eigen3", home / "include")]
    libraries = (library, f"-L{prefix / 'lib'}", f"-Wl,-rpath,{home},-rpath,{prefix / 'lib'}")
    options = ("-std=c++17", "-O0", "-w", *(f"-D{macro}" for macro in MACROS))
    program.parent.mkdir(parents=True, exist_ok=True)
    run(["g++", *options, *includes, SUPPORT / "pinocchio_casadi.cpp", *libraries, "-o", program])
    return program


def processor():
    """The processor's name where Linux tells it."""
    file = pathlib.Path("/proc/cpuinfo")
    found = re.search(r"model name\s*: (.*)", file.read_text()) if file.exists() else None
    return found[1] if found else platform.machine()


def written(page, text):
    """The page with the text between its marks."""
    begin, end = "<!-- generators -->", "<!-- end of generators -->"
    before, rest = page.split(begin)
    return f"{before}{begin}\n{text}\n{end}{rest.split(end)[1]}"


def main():
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=form)
    path = pathlib.Path
    parser.add_argument("--dyngen", required=True, help="the program")
    parser.add_argument("--arm", required=True, action="append", nargs="+", help="NAME URDF [JOINT,JOINT…]")
    parser.add_argument("--flags", default="-O3 -march=native", help="the compiler's, for both")
    parser.add_argument("--rounds", type=int, default=2000, help="over the states; the least time counts")
    parser.add_argument("--program", type=path, default="target/pinocchio_casadi", help="built if missing")
    parser.add_argument("--write", type=path, help="a page whose table is replaced; else it is printed")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = pathlib.Path(place)
        generator = compiled_generator(options.program)
        (folder / "round.c").write_text(ROUND)
        run(["gcc", "-O2", "-fPIC", "-shared", folder / "round.c", "-o", folder / "round.so"])
        seconds = ctypes.CDLL(str(folder / "round.so")).seconds
        seconds.restype = ctypes.c_double
        seconds.argtypes = [ctypes.c_void_p, ctypes.c_long, ctypes.c_long, *[ctypes.c_void_p] * 4]
        parts = []
        for k, (name, path, *held) in enumerate(options.arm):
            joints = held[0].split(",") if held else []
            parts.append(table(name, path, joints, options, generator, seconds, folder / str(k)))
    compiler = run(["gcc", "--version"]).splitlines()[0]
    versions = f"Pinocchio {pin.__version__}, CasADi {casadi.__version__}; {compiler}"
    parts.append(
        f"{run([options.dyngen, '--version']).strip()}; {versions}, `{options.flags}`, {processor()}."
    )
    text = "\n\n".join(parts)
    if options.write:
        options.write.write_text(written(options.write.read_text(), text))
    else:
        print(text)


if __name__ == "__main__":
    main()
