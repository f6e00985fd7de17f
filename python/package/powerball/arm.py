"""An arm: where everything starts."""

from __future__ import annotations

import html
import json
import os
from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Mapping, Optional, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from ._arrays import Array, PathLike, Values, named, states
from ._errors import InputError
from .functions import Functions

Lock = Mapping[str, float]


@dataclass(frozen=True)
class Limits:
    """What an arm file states about its joints; NaN where it states nothing."""

    #: Lower and upper position limit, (n, 2), rad or m.
    position: Array
    #: Largest velocity, (n,), rad/s or m/s.
    velocity: Array
    #: Largest acceleration, (n,), rad/s² or m/s².
    acceleration: Array
    #: Largest torque, (n,), N·m or N.
    torque: Array


@dataclass(frozen=True)
class SetParameter:
    """One parameter of a set: a sum of the arm's parameters."""

    name: str
    #: Coefficient of each of the arm's parameters in the sum.
    terms: Dict[str, float]
    #: The coefficients as exact text.
    exact_terms: Dict[str, str]


@dataclass(frozen=True)
class ParameterSet:
    """A parameter set of an arm."""

    #: "minimal", "symbolic", "published" or "full".
    kind: str
    #: The set's parameters in the order of arrays of values and of the regressor's columns.
    parameters: List[SetParameter]
    #: Rank of its columns for the numbers in the file.
    rank: int
    #: Whether the torque stays the same when all parameters are replaced by the set's sums.
    exact: bool
    #: Linear relations that still hold among its columns, in words.
    relations: List[str]

    @property
    def names(self) -> List[str]:
        """The parameters' names in order."""
        return [parameter.name for parameter in self.parameters]

    def __len__(self) -> int:
        return len(self.parameters)


@dataclass(frozen=True)
class Check:
    """Whether a real arm can have parameter values."""

    possible: bool
    #: Why not, one sentence each.
    reasons: List[str]
    #: The pose, (n,), at which the mass matrix is worst, rad or m.
    pose: Array
    #: The smallest eigenvalue of the mass matrix there, kg·m².
    min_eigenvalue: float


def _text(source: Union[PathLike, str], mark: str, read: Callable[[str], str]) -> Tuple[str, str]:
    """The text of a file, or the text that was given in place of one, and a name for errors."""
    if isinstance(source, str) and (mark in source or "\n" in source):
        return source, "text"
    path = os.fspath(source)
    return read(path), path


def _read(path: str) -> str:
    """The text of an arm file."""
    try:
        with open(path, encoding="utf-8") as file:
            return file.read()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {error}") from None


class Arm(Functions):
    """A serial arm with its model, which is derived and proven when it is first needed.

    Made by :meth:`from_toml`, :meth:`from_urdf` or :meth:`from_mjcf`.
    """

    def __init__(
        self, core: _core.Arm, made: Tuple[str, Tuple[Any, ...]], frame: Optional[str] = None
    ) -> None:
        self._core = core
        # By which function of the compiled part and of what, and at which frame: copies in other processes
        # are made anew.
        self._made = made
        self._frame = frame
        self._sets: Optional[Dict[str, ParameterSet]] = None
        self._own_values: Dict[str, Array] = {}

    @classmethod
    def from_toml(cls, source: PathLike) -> Arm:
        """An arm from an arm file: its path, or its text.

        Raises: ``InputError`` with every error of the file at once, each with line and column.
        """
        text, file = _text(source, "=", _read)
        # Its masses may be next to it, wherever the program works then.
        place = os.path.abspath(file) if text is not source else None
        return _made("parse", (text, file, place))

    @classmethod
    def from_urdf(
        cls,
        source: PathLike,
        *,
        base: Optional[str] = None,
        tip: Optional[str] = None,
        lock: Optional[Lock] = None,
        exact: bool = False,
        convention: str = "modified",
        angle_tolerance: float = 1e-9,
    ) -> Arm:
        """The serial chain of a URDF, with its values: a path, or the text.

        ``base`` and ``tip`` are the links where the chain begins and ends; ``lock`` holds joints at positions
        (``{"finger": 0.02}``, rad or m); ``exact`` keeps every digit, else rounded numbers such as 1.5708 are
        taken for what they were rounded from, which ``notes`` say. Joint positions keep their meaning.
        """
        return cls._imported(source, False, base, tip, lock, exact, convention, angle_tolerance)

    @classmethod
    def from_mjcf(
        cls,
        source: PathLike,
        *,
        base: Optional[str] = None,
        tip: Optional[str] = None,
        lock: Optional[Lock] = None,
        exact: bool = False,
        convention: str = "modified",
        angle_tolerance: float = 1e-9,
    ) -> Arm:
        """The serial chain of a MuJoCo model, with its values. Arguments as :meth:`from_urdf`.

        Files that the model includes are read with it, where ``source`` is a path.
        """
        return cls._imported(source, True, base, tip, lock, exact, convention, angle_tolerance)

    @classmethod
    def _imported(
        cls,
        source: PathLike,
        mjcf: bool,
        base: Optional[str],
        tip: Optional[str],
        lock: Optional[Lock],
        exact: bool,
        convention: str,
        angle_tolerance: float,
    ) -> Arm:
        text, file = _text(source, "<", _core.description)
        locked = [(joint, float(at)) for joint, at in (lock or {}).items()]
        made = (text, file, mjcf, base, tip, locked, exact, convention, angle_tolerance)
        return _made("import_from", made)

    @property
    def name(self) -> str:
        """The arm's name."""
        return self._core.name

    @property
    def dof(self) -> int:
        """The number of joints, n."""
        return self._core.dof

    @property
    def joint_names(self) -> List[str]:
        """The joints' names from the base outwards; where the file gives none, their numbers from "1"."""
        return self._core.joint_names

    @property
    def joint_kinds(self) -> List[str]:
        """ "revolute" or "prismatic", by joint."""
        return self._core.joint_kinds

    @property
    def limits(self) -> Limits:
        """What the file states about the joints' limits."""
        rows = self._core.limits
        nan = float("nan")
        position = [row[0] or [nan, nan] for row in rows]
        of = [[nan if row[k] is None else row[k] for row in rows] for k in (1, 2, 3)]
        return Limits(np.array(position, dtype=float), *(np.array(x, dtype=float) for x in of))

    @property
    def gravity_vector(self) -> Array:
        """Gravity in frame 0, (3,), m/s²."""
        return np.array(self._core.gravity_vector)

    @property
    def base(self) -> Array:
        """Frame 0 in the root link of the URDF or MuJoCo model, (4, 4); the identity for an arm file."""
        base = self._core.base
        return np.eye(4) if base is None else np.array(base)

    @property
    def parameters(self) -> List[str]:
        """The inertial parameters that declared symmetries leave, in order: ``m1 mx1 … Im1 m2 …``."""
        return self._core.parameters

    @property
    def values(self) -> Dict[str, float]:
        """Parameter values, SI units, as the URDF or MuJoCo model gives them; empty for an arm file."""
        return dict(self._core.values)

    @property
    def notes(self) -> List[str]:
        """What was left out of the file, taken as meant, or may surprise."""
        return self._core.notes

    @property
    def text(self) -> str:
        """The arm file (TOML)."""
        return self._core.text

    def save(self, path: PathLike) -> None:
        """Writes the arm file (TOML), for the commands."""
        with open(path, "w", encoding="utf-8") as file:
            file.write(self.text)

    @property
    def frames(self) -> List[str]:
        """The names of the ``[[frame]]`` tables of the arm file."""
        return self._core.frames

    def at_frame(self, name: str) -> Arm:
        """This arm with its tool at one of its frames: ``arm.at_frame("wrist").jacobian(q)``.

        Raises: ``ValueError`` where the arm has no such frame.
        """
        return _made(*self._made, name)

    def describe(self) -> Dict[str, Any]:
        """What ``dyngen describe --json`` prints: sets, classes of parameters, operation counts."""
        described: Dict[str, Any] = json.loads(self._core.describe())
        return described

    @property
    def sets(self) -> Dict[str, ParameterSet]:
        """The parameter sets: "full", "minimal", "symbolic", and "published" where the file has one."""
        if self._sets is None:
            self._sets = {kind: _set(kind, parsed) for kind, parsed in json.loads(self._core.sets()).items()}
        return self._sets

    def set_values(self, values: Optional[Values] = None, *, parameters: str = "minimal") -> Array:
        """The values of a set's parameters, (p,), in order, from values by name: what to pass in a loop."""
        if values is None:
            if parameters not in self._own_values:
                own = self.values
                if not own:
                    raise ValueError("values are needed: this arm was read from an arm file, which has none")
                self._own_values[parameters] = self._core.set_values(parameters, None, own)
            return self._own_values[parameters]
        given = named(values)
        if given is not None:
            return self._core.set_values(parameters, *given)
        array = states("values", values)  # type: ignore[arg-type]
        if array.ndim != 1:
            raise ValueError(f"values must be one-dimensional, it has shape {array.shape}")
        return array

    def check(self, values: Optional[Values] = None) -> Check:
        """Whether a real arm can have parameter values given by name: what ``dyngen check`` says."""
        given = (None, self.values) if values is None else named(values)
        if given is None:
            raise ValueError("values must be given by name: a dict, a JSON file or a result")
        possible, reasons, pose, least = self._core.check(*given)
        return Check(possible, reasons, np.array(pose), least)

    def _evaluate(
        self, name: str, parameters: str, values: Optional[Values], states_by_name: Dict[str, ArrayLike]
    ) -> Array:
        given = [(argument, states(argument, array)) for argument, array in states_by_name.items()]
        takes_values = name in _TAKES_VALUES
        array = self.set_values(values, parameters=parameters) if takes_values else None
        return self._core.evaluate(name, parameters, given, array)

    def __reduce__(self) -> Tuple[Any, ...]:
        return _made, (*self._made, self._frame)

    def __repr__(self) -> str:
        return f"<Arm {self.name}: {self.dof} joints, {len(self.parameters)} parameters>"

    def _repr_html_(self) -> str:
        """A table of the joints, for notebooks: name, kind and limits."""
        limits = self.limits
        head = ("joint", "kind", "position", "velocity", "torque")

        def row(j: int) -> Tuple[str, ...]:
            linear = self.joint_kinds[j] == "prismatic"
            low, high = limits.position[j]
            return (
                self.joint_names[j],
                self.joint_kinds[j],
                f"{_shown(low)} to {_shown(high)} {'m' if linear else 'rad'}",
                f"{_shown(limits.velocity[j])} {'m/s' if linear else 'rad/s'}",
                f"{_shown(limits.torque[j])} {'N' if linear else 'N·m'}",
            )

        def line(cells: Tuple[str, ...], tag: str) -> str:
            return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

        rows = "".join(line(row(j), "td") for j in range(self.dof))
        title = f"{self.name}: {self.dof} joints, {len(self.parameters)} parameters"
        return f"<table><caption>{html.escape(title)}</caption>{line(head, 'th')}{rows}</table>"


def _made(function: str, arguments: Tuple[Any, ...], frame: Optional[str] = None) -> Arm:
    core = getattr(_core.Arm, function)(*arguments)
    return Arm(core if frame is None else core.at_frame(frame), (function, arguments), frame)


def _shown(value: float) -> str:
    return "–" if np.isnan(value) else f"{value:.4g}"


_TAKES_VALUES = {name for name, arguments, _, _ in _core.functions() if "parameters" in arguments}


def _set(kind: str, parsed: Dict[str, Any]) -> ParameterSet:
    def parameter(entry: Dict[str, Any]) -> SetParameter:
        terms = {term["parameter"]: term["value"] for term in entry["terms"]}
        exact = {term["parameter"]: term["coefficient"] for term in entry["terms"]}
        return SetParameter(entry["name"], terms, exact)

    parameters = [parameter(entry) for entry in parsed["parameters"]]
    return ParameterSet(kind, parameters, parsed["rank"], parsed["exact"], parsed["relations"])
