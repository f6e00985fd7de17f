"""A file in C that dyngen has generated: what its functions take and give, and results over many states.

Arrays over states are those of the kernels in CUDA and of the entry points in WGSL: one row an entry, one
column a state.
"""

import ctypes
import dataclasses
import pathlib
import re
import subprocess

import numpy as np


@dataclasses.dataclass
class Function:
    """A function of a file."""

    name: str
    # The length of each argument by its name; parameters are the same for all states.
    arguments: dict
    # How many numbers the result has.
    entries: int
    # Whether the result is returned, as an energy is.
    is_number: bool

    @property
    def of_states(self):
        """The arguments of which each state has its own."""
        return [name for name in self.arguments if name != "parameters"]


def functions(header):
    """The functions of a header that take joint positions and parameters as they are."""
    sizes = dict(re.findall(r"#define (\w+) (\d+)", header))

    def length(text):
        product = 1
        for size in re.findall(r"\[(\w+)\]", text):
            product *= int(sizes.get(size, size))
        return product

    found = []
    for kind, name, text in re.findall(r"^(void|\w+_real) (\w+)\(\n([^)]*)\);", header, re.MULTILINE):
        if "*" in text or "friction" in name:
            continue
        arrays = {a.split("[")[0].split()[-1]: length(a) for a in text.split(",")}
        entries = arrays.pop("result", 1)
        found.append(Function(name, arrays, entries, kind != "void"))
    return found


class InC:
    """A file in C, compiled: `kind` is numpy.float64 or numpy.float32."""

    def __init__(self, source, kind):
        source = pathlib.Path(source)
        self.header = source.with_suffix(".h").read_text()
        self.functions = functions(self.header)
        self.kind = np.dtype(kind)
        # What makes the numbers floats, for the compiler.
        self.define = "-D" + re.search(r"#ifdef (\w+_FLOAT)", self.header)[1]
        defines = [self.define] if self.kind == np.float32 else []
        library = source.with_suffix(f".{self.kind.name}.so")
        # With --contract a function of the library does where this machine has no instruction.
        defines.append(self.define.replace("_FLOAT", "_FMA"))
        flags = ["-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC", *defines]
        subprocess.run(["cc", *flags, source, "-o", library, "-lm"], check=True)
        self.library = ctypes.CDLL(str(library.resolve()))

    def of(self, function, inputs):
        """The results over states of inputs by their names."""
        count = inputs["q"].shape[1]
        called = getattr(self.library, function.name)
        called.restype = np.ctypeslib.as_ctypes_type(self.kind) if function.is_number else None
        rows = {name: np.ascontiguousarray(inputs[name].T, self.kind) for name in function.of_states}
        parameters = np.ascontiguousarray(inputs["parameters"], self.kind)
        results = np.empty((count, function.entries), self.kind)

        def pointer(array, state):
            return ctypes.c_void_p(array.ctypes.data + state * array.strides[0])

        for state in range(count):
            passed = [
                ctypes.c_void_p(parameters.ctypes.data)
                if name == "parameters"
                else pointer(rows[name], state)
                for name in function.arguments
            ]
            if function.is_number:
                results[state] = called(*passed)
            else:
                called(*passed, pointer(results, state))
        return results.T


def random_inputs(functions, count, seed, scale):
    """Inputs of all functions: uniform within ± `scale` of each, 1 where it says nothing."""
    draws = np.random.default_rng(seed)
    lengths = {name: length for f in functions for name, length in f.arguments.items()}
    lengths.setdefault("parameters", 1)
    shape = {name: (n,) if name == "parameters" else (n, count) for name, n in lengths.items()}
    return {name: draws.uniform(-1, 1, shape[name]) * scale.get(name, 1.0) for name in sorted(lengths)}
