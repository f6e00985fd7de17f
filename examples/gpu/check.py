#!/usr/bin/env python3
"""Generated CUDA and WGSL against generated C: what `.ci/gpu` runs. No GPU is needed.

    pip install numpy nvidia-cuda-nvrtc-cu12 wgpu
    cargo build --release -p dyngen
    python3 examples/gpu/check.py --dyngen target/release/dyngen

1. Each file is what `dyngen verify` proves.
2. NVRTC compiles the CUDA for a GPU without a word, in both precisions, and contracts nothing unless it
   was generated with --contract.
3. Kernels in CUDA, compiled by g++ without their qualifiers and called thread by thread, give the bits of
   the C.
4. Entry points in WGSL give the results of the C in double precision up to rounding, on whatever device
   there is for Vulkan: Mesa's lavapipe is one without a GPU. `dyngen describe` bounds the rounding of
   floats with sines and cosines within one unit; a compiler that reorders sums may make that two, so twice
   the bound is allowed. Where there is none, because of a division, which WGSL rounds up to five times as
   far as C does, the median error may be five times that of the C in floats.
"""

import argparse
import ctypes
import glob
import json
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np
from generated import InC, random_inputs

ROOT = pathlib.Path(__file__).resolve().parents[2]
# One has a joint that slides; with the options for `generate`.
ARMS = [
    ("tests/arms/ur5e.toml", []),
    ("tests/arms/stanford.toml", []),
    ("tests/arms/stanford.toml", ["--contract"]),
]
FUNCTIONS = [
    "inverse_dynamics",
    "regressor",
    "slotine_li_regressor",
    "mass_matrix",
    "coriolis_matrix",
    "gravity",
    "forward_dynamics",
    "forward_kinematics",
    "jacobian",
    "kinetic_energy",
    "potential_energy_regressor",
    "torque_by_position",
    "torque_hessian_times",
    "inverse_dynamics_with_payload",
]
# Within these `describe` bounds the rounding.
LIMITS = "position = [-3, 3]\nvelocity = 2\nacceleration = 5\ntorque = 10\n"
SCALE = {"q": 3.0, "dq": 2.0, "dqr": 2.0, "ddq": 5.0, "ddqr": 5.0, "tau": 10.0}
# A kernel's surroundings, without a GPU.
SHIM = """
#define __device__
#define __global__
struct index { unsigned x; };
extern "C" { index blockIdx, blockDim, threadIdx; }
"""


class Files:
    """The files of an arm in a folder."""

    def __init__(self, dyngen, arm, options, folder):
        self.contracted = "--contract" in options
        text = (ROOT / arm).read_text().replace("[[joint]]\n", "[[joint]]\n" + LIMITS)
        self.arm = folder / pathlib.Path(arm).name
        self.arm.write_text(text)
        self.folder = folder
        for language, end in [("c", ".c"), ("cuda", ".cu"), ("wgsl", ".wgsl")]:
            file = self.arm.with_suffix(end)
            asked = ["--language", language, "--functions", ",".join(FUNCTIONS), "-o", file, *options]
            subprocess.run([dyngen, "generate", self.arm, *asked], check=True)
            proven = subprocess.run(
                [dyngen, "verify", file, self.arm], check=True, capture_output=True, text=True
            ).stdout
            kernels = 0 if language == "c" else len(FUNCTIONS)
            assert proven.count("_batch\n") == kernels, f"{file.name}: {proven}"
        described = subprocess.run(
            [dyngen, "describe", self.arm, "--json"], check=True, capture_output=True
        ).stdout
        self.rounding = json.loads(described)["rounding"]
        self.cuda = self.arm.with_suffix(".cu").read_text()
        self.wgsl = self.arm.with_suffix(".wgsl").read_text()
        self.double = InC(self.arm.with_suffix(".c"), np.float64)
        self.single = InC(self.arm.with_suffix(".c"), np.float32)


class Nvrtc:
    """NVIDIA's compiler as a library, from PyPI."""

    def __init__(self):
        found = [p for path in sys.path for p in glob.glob(path + "/nvidia/**/libnvrtc.so.*", recursive=True)]
        if not found:
            sys.exit("NVRTC is not there: pip install nvidia-cuda-nvrtc-cu12")
        self.library = ctypes.CDLL(found[0])

    def text(self, program, what):
        """A text of a program: its Log or PTX."""
        size = ctypes.c_size_t()
        getattr(self.library, f"nvrtcGet{what}Size")(program, ctypes.byref(size))
        text = ctypes.create_string_buffer(size.value)
        getattr(self.library, f"nvrtcGet{what}")(program, text)
        return text.value.decode()

    def compiled(self, source, options):
        """The code for a GPU, nothing where the source is refused, and what the compiler says."""
        program = ctypes.c_void_p()
        self.library.nvrtcCreateProgram(ctypes.byref(program), source.encode(), b"arm.cu", 0, None, None)
        passed = (ctypes.c_char_p * len(options))(*[option.encode() for option in options])
        failed = self.library.nvrtcCompileProgram(program, len(options), passed)
        log = self.text(program, "ProgramLog")
        return (None if failed else self.text(program, "PTX")), log


def check_compiled(files, nvrtc):
    """The CUDA as it is compiled for a GPU."""
    for c in [files.double, files.single]:
        options = ["--gpu-architecture=compute_75", "--fmad=false"]
        options += [c.define] if c.kind == np.float32 else []
        code, log = nvrtc.compiled(files.cuda, options)
        assert code and not log.strip("\0\n "), f"{files.arm.name} {c.kind}: {log}"
        assert code.count(".entry") == len(FUNCTIONS), code.count(".entry")
        # The library's sine of large doubles asks for them by name.
        fused = "fma." in code
        assert c.kind == np.float64 or fused == files.contracted, f"{files.arm.name}: contracted: {fused}"
    code, log = nvrtc.compiled(files.cuda, ["--use_fast_math"])
    assert code is None and "without --use_fast_math" in log, log
    print(f"{files.arm.stem}: NVRTC compiles {len(FUNCTIONS)} kernels in both precisions")


def check_bits(files, count=300, threads=64):
    """Kernels in CUDA, thread by thread, against the C."""
    shim = files.folder / "shim.hpp"
    shim.write_text(SHIM)
    for c in [files.double, files.single]:
        library = files.folder / f"{files.arm.stem}.cu.{c.kind}.so"
        defines = [c.define] if c.kind == np.float32 else []
        flags = ["-std=c++17", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
        source = files.arm.with_suffix(".cu")
        subprocess.run(
            ["g++", *flags, *defines, "-include", shim, "-x", "c++", source, "-o", library], check=True
        )
        kernels = ctypes.CDLL(str(library))
        index = {name: ctypes.c_uint.in_dll(kernels, name) for name in ["blockIdx", "blockDim", "threadIdx"]}
        inputs = random_inputs(c.functions, count, 1, SCALE)
        # Angles of many turns, and what is no number.
        inputs["q"][:, :50] *= 1e4
        inputs["q"][0, 50] = np.inf
        inputs = {name: np.ascontiguousarray(values, c.kind) for name, values in inputs.items()}
        for f in c.functions:
            # What stands behind the results must stay.
            found = np.full(f.entries * count + 100, 7.5, c.kind)
            kernel = getattr(kernels, f.name + "_batch")
            passed = [ctypes.c_size_t(count)]
            passed += [ctypes.c_void_p(inputs[name].ctypes.data) for name in f.arguments]
            passed += [ctypes.c_void_p(found.ctypes.data)]
            index["blockDim"].value = threads
            for thread in range(-(-count // threads) * threads):
                index["blockIdx"].value, index["threadIdx"].value = divmod(thread, threads)
                kernel(*passed)
            assert (found[f.entries * count :] == 7.5).all(), f"{f.name} writes beyond its result"
            found = found[: f.entries * count].reshape(f.entries, count)
            expected = c.of(f, inputs)
            # To the sign of a zero; what is no number has no bits of its own.
            same = (found == expected) & (np.signbit(found) == np.signbit(expected))
            same |= np.isnan(found) & np.isnan(expected)
            assert same.all(), f"{files.arm.stem} {f.name} {c.kind}: {np.sum(~same)} differ"
            assert np.isfinite(found).mean() > 0.9
    print(f"{files.arm.stem}: kernels called thread by thread give the bits of the C, {count} states")


def device():
    """A device for Vulkan; nothing where there is none."""
    try:
        import wgpu

        adapters = wgpu.gpu.enumerate_adapters_sync()
    except (ImportError, OSError, RuntimeError) as error:
        print(f"wgpu: {error}")
        return None
    adapters = [adapter for adapter in adapters if adapter.info["backend_type"] == "Vulkan"]
    if not adapters:
        return None
    print(f"WGSL runs on {adapters[0].info['device']}")
    return adapters[0].request_device_sync()


def run(device, module, files, function, inputs, count):
    """The results of an entry point."""
    import wgpu

    name = function.name + "_batch"
    said = re.search(rf"// {function.name} of many states. Bindings: (.*)\.\n", files.wgsl)[1]
    places = {name: int(place) for place, name in (pair.split(" ") for pair in said.split(", "))}
    storage = wgpu.BufferUsage.STORAGE
    buffers = {
        name: device.create_buffer_with_data(data=inputs[name].astype(np.float32), usage=storage)
        for name in function.arguments
    }
    buffers["count"] = device.create_buffer_with_data(
        data=np.array([count], np.uint32), usage=wgpu.BufferUsage.UNIFORM
    )
    buffers["result"] = device.create_buffer(
        size=4 * function.entries * count, usage=storage | wgpu.BufferUsage.COPY_SRC
    )
    pipeline = device.create_compute_pipeline(layout="auto", compute={"module": module, "entry_point": name})
    entries = [{"binding": places[name], "resource": {"buffer": buffer}} for name, buffer in buffers.items()]
    group = device.create_bind_group(layout=pipeline.get_bind_group_layout(0), entries=entries)
    encoder = device.create_command_encoder()
    work = encoder.begin_compute_pass()
    work.set_pipeline(pipeline)
    work.set_bind_group(0, group)
    # Two dimensions, as more than four million states need, and more invocations than states.
    work.dispatch_workgroups(5, -(-count // (5 * 64)))
    work.end()
    device.queue.submit([encoder.finish()])
    result = np.frombuffer(device.queue.read_buffer(buffers["result"]), np.float32)
    return result.reshape(function.entries, count).astype(np.float64)


def check_wgsl(files, device, count=1000):
    """Entry points in WGSL against the C."""
    module = device.create_shader_module(code=files.wgsl)
    inputs = random_inputs(files.single.functions, count, 2, SCALE)
    # What all three take is the same number.
    inputs = {name: values.astype(np.float32).astype(np.float64) for name, values in inputs.items()}
    bounded, worst = 0, 0.0
    for f in files.single.functions:
        exact = files.double.of(f, inputs)
        wgsl = np.abs(run(device, module, files, f, inputs, count) - exact)
        short = next(name for name in sorted(FUNCTIONS, key=len, reverse=True) if f.name.endswith(name))
        bounds = files.rounding[short]["f32"]
        # No bound, as of q̈ without the values of the arm: the C in single precision is the measure.
        if bounds is None or None in bounds:
            single = np.abs(files.single.of(f, inputs) - exact)
            allowed = 5 * np.median(single)
            assert np.median(wgsl) <= allowed, f"{f.name}: {np.median(wgsl)} and not {allowed}"
            continue
        bounded += 1
        allowed = 2 * np.array(bounds)[:, None]
        beyond = (wgsl > allowed).any(axis=1)
        assert not beyond.any(), f"{f.name}: entries {np.flatnonzero(beyond)} are beyond their bound"
        worst = max(worst, float(np.max(wgsl / np.where(allowed > 0, allowed, 1))))
    assert bounded > len(FUNCTIONS) / 2
    print(
        f"{files.arm.stem}: {len(FUNCTIONS)} entry points in WGSL, at most {worst:.2f} of the allowed error"
    )


def main():
    """The files of each arm, in turn."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--dyngen", default="target/release/dyngen", help="the command")
    args = parser.parse_args()
    nvrtc, gpu = Nvrtc(), device()
    for arm, options in ARMS:
        with tempfile.TemporaryDirectory() as folder:
            files = Files(pathlib.Path(args.dyngen).resolve(), arm, options, pathlib.Path(folder))
            check_compiled(files, nvrtc)
            check_bits(files)
            if gpu:
                check_wgsl(files, gpu)
    if not gpu:
        print("skipped: the WGSL, for which no device is there (apt-get install mesa-vulkan-drivers)")


if __name__ == "__main__":
    main()
