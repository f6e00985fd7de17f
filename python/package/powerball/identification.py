"""From logs to a model: ``identify``, ``verify`` and ``compare``."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Sequence, Union

import numpy as np

from . import _core
from ._arrays import Array, PathLike, Values
from ._logs import LogLike, Logs, given
from ._model import Model, model_text, optional_model
from ._progress import Progress, listener
from ._result import OfLogs, Result, Spread, error_rows, numbers, paragraph, spread, table
from .arm import Arm
from .servos import IdentifiedServos, masses

#: How columns are read: a TOML file, lines of one such as 'tau.sign = -1', or several of both.
Map = Union[str, PathLike, Sequence[str]]


def said(map: Optional[Map]) -> List[str]:
    """A map as the commands' ``--map`` takes it."""
    if map is None:
        return []
    return [os.fspath(map)] if isinstance(map, (str, os.PathLike)) else [os.fspath(line) for line in map]


@dataclass(frozen=True)
class ParameterEstimate:
    """One parameter of the minimal set."""

    name: str
    #: SI units.
    value: float
    #: Standard error; ``None`` where the logs do not determine the parameter.
    std: Optional[float]
    relative_std: Optional[float]


@dataclass(frozen=True)
class JointFriction:
    """Friction of a joint: γ1·tanh(γ2·q̇) + γ3·tanh(γ4·q̇) + γ5·q̇, and a constant where that was asked for."""

    #: From 1.
    joint: int
    #: γ1 to γ5, (5,).
    gamma: Array
    #: Standard errors of γ1 to γ5, (5,); NaN where the logs do not determine them.
    std: Array
    #: A constant torque, N·m or N.
    offset: Optional[float]
    #: Standard error of γ1 + γ3, which logs determine better than either.
    coulomb_std: Optional[float] = None


class Identified(OfLogs):
    """A model with its errors: the minimal inertial set and the friction of every joint."""

    @property
    def parameters(self) -> List[ParameterEstimate]:
        """The minimal set's values with their standard errors."""
        keys = ("name", "value", "std", "relative_std")
        return [ParameterEstimate(*(entry.get(key) for key in keys)) for entry in self._json["parameters"]]

    @property
    def values(self) -> Dict[str, float]:
        """The minimal set's values by name, for the functions of an arm: ``arm.gravity(q, identified)``."""
        return {entry["name"]: entry["value"] for entry in self._json["parameters"]}

    @property
    def friction(self) -> List[JointFriction]:
        """Friction, joint by joint."""

        def of(entry: Dict[str, Any]) -> JointFriction:
            gamma = np.array([entry[f"gamma{k}"] for k in range(1, 6)])
            std = numbers(entry["std"])
            return JointFriction(entry["joint"], gamma, std, entry.get("offset"), entry.get("coulomb_std"))

        return [of(entry) for entry in self._json["friction"]]

    @property
    def fit(self) -> Spread:
        """What the fit leaves of its own logs."""
        found = spread(self._json["fit"])
        assert found is not None
        return found

    @property
    def validate(self) -> Optional[Spread]:
        """What the model leaves of the validation logs, where there are any."""
        return spread(self._json["validate"])

    @property
    def physically_consistent(self) -> bool:
        """Whether a real arm can have these values."""
        return bool(self._json["physically_consistent"])

    @property
    def consistent(self) -> Dict[str, float]:
        """The nearest values that a real arm can have, by the names of the arm's parameters."""
        return dict(self._json["consistent"]["parameters"])

    def model_json(self) -> str:
        """identified.json."""
        return str(self._core.json())

    def __repr__(self) -> str:
        judged = self.validate or self.fit
        errors = ", ".join(f"{100 * share:.1f} %" for share in judged.relative)
        what = "on validation logs" if self.validate else "on its own logs"
        return f"<Identified {self._json['arm']}: error {errors} of the torque {what}>"

    def _repr_html_(self) -> str:
        head = ["joint", "fit", "validation"] if self.validate else ["joint", "fit"]
        possible = "" if self.physically_consistent else " No real arm can have these values."
        return (
            self._repr_unusable()
            + paragraph(f"{self._json['arm']}: {len(self.parameters)} parameters.{possible}", strong=True)
            + table(head, error_rows([self.fit, self.validate]))
            + "".join(paragraph(warning) for warning in self.warnings)
        )


def identify(
    arm: Arm,
    log: Logs,
    validate: Optional[Logs] = None,
    *,
    map: Optional[Map] = None,
    model: Optional[Model] = None,
    values: Optional[Values] = None,
    friction: str = "symmetric",
    estimator: str = "weighted",
    progress: Progress = False,
) -> Union[Identified, IdentifiedServos]:
    """Fits the minimal inertial set and the friction of every joint (Eq. 16) to logs.

    ``log`` and ``validate`` are one log or several: files that the command reads, dicts or frames with the
    columns ``t``, ``q1`` …, ``tau1`` … or ``i1`` …, ``Log`` objects, or ``Mounted`` ones. ``friction`` is
    "symmetric" or "asymmetric"; ``estimator`` is "weighted", "robust" or "instrumental"; ``model`` is what is
    known already.

    Logs of position servos (columns ``goal1`` … and no torque) give ``IdentifiedServos``: the closed loop of
    each joint. ``values`` are then the arm's masses: those of all its parameters, by name or as a JSON file;
    where they are not given, those of the robot description or of ``ARM.values.json`` next to the arm file.

    Raises: ``InputError`` where logs cannot be used, ``RefusedError`` where they have no answer.
    """
    with listener(progress) as tell:
        core = _core.identify(
            arm._core,
            given(log, "log"),
            given(validate, "validate"),
            said(map),
            optional_model(model),
            masses(values),
            friction,
            estimator,
            tell,
        )
    return IdentifiedServos(core) if isinstance(core, _core.Written) else Identified(core)


@dataclass(frozen=True)
class JointVerdict:
    """How a model does on a joint."""

    #: From 1.
    joint: int
    #: rms of the error, N·m or N.
    rms: float
    #: 95 % interval of the rms.
    interval: Array
    #: rms of the error over rms of the torque.
    relative: float
    #: What white noise alone would leave.
    noise_floor: float
    #: Whether the error is within the tolerance; ``None`` for a joint that rests.
    within: Optional[bool]


class Verified(Result):
    """How a model does on logs that it has not seen."""

    @property
    def joints(self) -> List[JointVerdict]:
        """Joint by joint."""

        def of(entry: Dict[str, Any]) -> JointVerdict:
            return JointVerdict(**{**entry, "interval": numbers(entry["interval"])})

        return [of(entry) for entry in self._json["joints"]]

    @property
    def within_tolerance(self) -> bool:
        """Whether no joint's error may be beyond the tolerance."""
        return bool(self._json["within_tolerance"])

    @property
    def tolerance(self) -> float:
        """As it was asked for."""
        return float(self._json["tolerance"])

    def _repr_html_(self) -> str:
        rows = [
            [
                j.joint,
                f"{j.rms:.4f} ({j.interval[0]:.4f} to {j.interval[1]:.4f}) N·m",
                f"{100 * j.relative:.1f} %",
            ]
            for j in self.joints
        ]
        word = "Every joint is" if self.within_tolerance else "Not every joint is"
        lead = paragraph(f"{word} within {100 * self.tolerance:g} % of its torque.", strong=True)
        return lead + table(["joint", "error", "of the torque"], rows)


def verify(
    arm: Arm,
    model: Model,
    log: Logs,
    *,
    map: Optional[Map] = None,
    tolerance: float = 0.1,
    progress: Progress = False,
) -> Verified:
    """Judges a model on logs that it has not seen: errors with intervals, against the noise floor.

    ``tolerance`` is the largest error of a joint as a share of the rms of its torque.
    """
    with listener(progress) as tell:
        logs = given(log, "log")
        return Verified(_core.verify(arm._core, model_text(model), logs, said(map), tolerance, tell))


class Compared(Result):
    """Two fits side by side; differences are b less a, and intervals hold all at once."""

    @property
    def differ(self) -> bool:
        """Whether they differ beyond what their errors explain."""
        return bool(self._json["differ"])

    @property
    def sentence(self) -> str:
        """All of it in words."""
        return str(self._json["sentence"])

    @property
    def parameters(self) -> List[Dict[str, Any]]:
        """The minimal set, as far as both determine it."""
        return list(self._json["parameters"])

    @property
    def friction(self) -> List[Dict[str, Any]]:
        """Friction curves, joint by joint."""
        return list(self._json["friction"])

    @property
    def torque_difference(self) -> List[Dict[str, Any]]:
        """What all of it means in torque along the logs of a, joint by joint."""
        return list(self._json["torque_difference"])

    def _repr_html_(self) -> str:
        rows = [
            [t["joint"], f"{t['rms']:.4f} N·m", f"{100 * t['relative']:.1f} %", f"{t['expected']:.4f} N·m"]
            for t in self.torque_difference
        ]
        head = ["joint", "difference", "of the torque", "errors alone"]
        return paragraph(self.sentence, strong=True) + table(head, rows)


def compare(
    a: Union[Identified, LogLike],
    b: Union[Identified, LogLike],
    *,
    arm: Optional[Arm] = None,
    map: Optional[Map] = None,
    level: float = 0.01,
    progress: Progress = False,
) -> Compared:
    """Compares two fits: what truly differs, what that means in torque, and why.

    ``a`` and ``b`` are results of ``identify``, their folders or JSON files; or, with ``arm``, logs, which
    are fitted first. Equal arms are called different in the share ``level`` of comparisons.
    """
    sides = [_side(side, name, arm, map, progress) for side, name in ((a, "a"), (b, "b"))]
    return Compared(_core.compare(sides[0], sides[1], level))


def _side(
    side: Any, name: str, arm: Optional[Arm], map: Optional[Map], progress: Progress
) -> _core.ComparedSide:
    if isinstance(side, IdentifiedServos):
        raise ValueError(f"{name} is of position servos: fits of torques are compared")
    if isinstance(side, Identified):
        own: _core.ComparedSide = side._core.side(name)
        return own
    if isinstance(side, (str, os.PathLike)):
        path = os.fspath(side)
        if os.path.isdir(path) or path.endswith(".json"):
            return _core.ComparedSide.read(path)
        name = path
    if arm is None:
        raise ValueError(f"{name} is no result of identify; for a log or a summary give its arm as arm=")
    found = identify(arm, side, map=map, progress=progress)
    return _side(found, name, None, None, False)
