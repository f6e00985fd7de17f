#!/usr/bin/env python3
"""Kernels of generated CUDA on a GPU: their results against the C, and how many states a second they take.

    pip install numpy cupy-cuda12x        # or cupy-cuda13x
    cargo build --release -p dyngen
    python3 examples/gpu/bench.py --dyngen target/release/dyngen --arm tests/arms/ur5e.toml --states 4000000

CuPy compiles the file with NVRTC. Without contraction (--fmad=false) results must have the bits of the C;
with it they may differ by rounding, and the time of both is printed. The share of bandwidth counts every
input and result once, against a copy within the GPU's memory in the same run.
"""

import argparse
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from generated import InC, random_inputs

FUNCTIONS = [
    "inverse_dynamics",
    "gravity",
    "mass_matrix",
    "forward_dynamics",
    "jacobian",
    "regressor",
]
# Threads of a block.
BLOCK = 128
# States whose results are compared.
COMPARED = 2000


def seconds(cupy, call, times=20):
    """The time of a call on the GPU, the shortest of some."""
    begin, end = cupy.cuda.Event(), cupy.cuda.Event()
    found = []
    call()
    for _ in range(times):
        begin.record()
        call()
        end.record()
        end.synchronize()
        found.append(cupy.cuda.get_elapsed_time(begin, end) / 1e3)
    return min(found)


def bandwidth(cupy):
    """Bytes a second that a copy within the GPU's memory reads and writes."""
    source = cupy.zeros(1 << 28, cupy.uint8)
    target = cupy.empty_like(source)
    return 2 * source.nbytes / seconds(cupy, lambda: cupy.copyto(target, source))


def measured(cupy, c, function, code, inputs, count):
    """The seconds and bytes of a kernel, and its first results."""
    kernel = code.get_function(function.name + "_batch")
    arrays = [inputs[name] for name in function.arguments]
    result = cupy.empty((function.entries, count), c.kind)
    passed = (np.uint64(count), *arrays, result)
    grid = (-(-count // BLOCK),)
    time = seconds(cupy, lambda: kernel(grid, (BLOCK,), passed))
    moved = sum(array.nbytes for array in arrays) + result.nbytes
    return time, moved, cupy.asnumpy(result[:, :COMPARED])


def compared(found, expected, exact):
    """Says how results differ from the C's; refuses what is more than rounding."""
    same = (found == expected).mean()
    scale = np.abs(expected).max()
    error = float(np.abs(found - expected).max() / scale)
    if exact and same < 1:
        sys.exit(f"results differ from the C's: {100 * same:.3f} % are the same, {error:.1e} of the largest")
    # A matrix that is nearly singular takes many digits.
    if not exact and np.median(np.abs(found - expected)) > 1e3 * np.finfo(found.dtype).eps * scale:
        sys.exit(f"results differ from the C's by more than rounding: {error:.1e} of the largest")
    return (
        "the bits of the C"
        if exact
        else f"{100 * same:.0f} % with the bits of the C, the rest within {error:.0e}"
    )


def main():
    """Generates, checks and measures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--dyngen", default="target/release/dyngen", help="the command")
    parser.add_argument("--arm", default="tests/arms/ur5e.toml", help="the arm file")
    parser.add_argument("--states", type=int, default=4_000_000, help="how many at once")
    args = parser.parse_args()
    try:
        import cupy
    except ImportError:
        sys.exit("CuPy is not there: pip install cupy-cuda12x, on a machine with a GPU of NVIDIA")
    peak = bandwidth(cupy)
    name = cupy.cuda.runtime.getDeviceProperties(0)["name"].decode()
    print(f"{name}: a copy moves {peak / 1e9:.0f} GB/s; {args.states} states of {args.arm}")
    with tempfile.TemporaryDirectory() as folder:
        arm = pathlib.Path(folder) / "arm.c"
        for language, file in [("c", arm), ("cuda", arm.with_suffix(".cu"))]:
            options = ["--language", language, "--functions", ",".join(FUNCTIONS), "-o", file]
            subprocess.run([args.dyngen, "generate", args.arm, *options], check=True)
        source = arm.with_suffix(".cu").read_text()
        for kind in [np.float64, np.float32]:
            c = InC(arm, kind)
            drawn = random_inputs(c.functions, args.states, 3, {"q": 3.0})
            drawn = {name: np.ascontiguousarray(values, kind) for name, values in drawn.items()}
            few = {name: v if v.ndim == 1 else v[:, :COMPARED] for name, v in drawn.items()}
            inputs = {name: cupy.asarray(values) for name, values in drawn.items()}
            for exact in [True, False]:
                options = ["--fmad=false" if exact else "--fmad=true"]
                options += [c.define] if kind == np.float32 else []
                code = cupy.RawModule(code=source, options=tuple(options), backend="nvrtc")
                for f in c.functions:
                    time, moved, found = measured(cupy, c, f, code, inputs, args.states)
                    words = compared(found, c.of(f, few), exact)
                    print(
                        f"{c.kind} {options[0]} {f.name}: {args.states / time / 1e6:.0f} M states/s, "
                        f"{100 * moved / time / peak:.0f} % of a copy's bandwidth; {words}"
                    )


if __name__ == "__main__":
    main()
