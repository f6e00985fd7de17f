"""Arms on position servos: what ``identify`` and ``explain`` give of logs with set-points and no torque."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Tuple

from ._arrays import Array, Values, named
from ._result import Judged, evidence, figures, joints_in_words, numbers, paragraph, table


def masses(values: Optional[Values]) -> Optional[Tuple[Optional[str], Dict[str, float]]]:
    """Masses of an arm as the compiled part takes them."""
    if values is None:
        return None
    given = named(values)
    if given is None:
        raise ValueError("values must be given by name: a dict, a JSON file or a result")
    return given


@dataclass(frozen=True)
class PositionErrors:
    """How far simulated positions are from measured ones."""

    #: rms by joint, (n,), rad.
    position_error: Array
    #: That of the logged goal with its best delay, (n,), rad; NaN where the drive was always switched off.
    goal_error: Array
    #: Samples they are of.
    samples: int


def _errors(parsed: Dict[str, Any]) -> PositionErrors:
    return PositionErrors(
        numbers(parsed["position_error"]), numbers(parsed["goal_error"]), int(parsed["samples"])
    )


@dataclass(frozen=True)
class ServoConstant:
    """A constant of a servo, or an inertial parameter that was fitted with it."""

    #: As docs/servos.md lists them.
    name: str
    value: float
    #: Standard error; ``None`` where the arm file gives the value or the logs do not show it.
    std: Optional[float]
    #: Of both.
    unit: str
    #: Whether the arm file gives it.
    known: bool


@dataclass(frozen=True)
class JointServo:
    """The drive of a joint."""

    #: From 1.
    joint: int
    #: Whether torques are in N·m; else they are shares of the torque at full duty.
    absolute: bool
    #: Constants by name: those that were fitted, and those of the arm file.
    constants: Dict[str, ServoConstant]


@dataclass(frozen=True)
class ServoFriction:
    """Friction of a joint: coulomb + load·½·|motor's torque + body's torque|, and viscous·q̇."""

    #: From 1.
    joint: int
    #: N·m, or a share of the torque at full duty.
    coulomb: float
    #: N·m·s/rad, likewise.
    viscous: float
    #: N·m for each N·m.
    load: float


class IdentifiedServos(Judged):
    """The closed loop of every joint, fitted to positions."""

    @property
    def servo(self) -> List[JointServo]:
        """Drives, joint by joint."""

        def of(entry: Dict[str, Any]) -> JointServo:
            constants = {constant["name"]: ServoConstant(**constant) for constant in entry["parameters"]}
            return JointServo(entry["joint"], entry["absolute"], constants)

        return [of(entry) for entry in self._json["servo"]]

    @property
    def friction(self) -> List[ServoFriction]:
        """Friction, joint by joint."""
        return [ServoFriction(**entry) for entry in self._json["friction"]]

    @property
    def parameters(self) -> List[ServoConstant]:
        """Inertial parameters that were fitted; empty where they are known."""
        return [ServoConstant(**entry) for entry in self._json["parameters"]]

    @property
    def fit(self) -> PositionErrors:
        """What the simulation leaves of the logs to fit."""
        return _errors(self._json["fit"])

    @property
    def validate(self) -> Optional[PositionErrors]:
        """What the simulation leaves of the validation logs, where there are any."""
        parsed = self._json["validate"]
        return None if parsed is None else _errors(parsed)

    def model_json(self) -> str:
        """identified.json, for ``export`` into a MuJoCo model."""
        return str(self._core.json())

    def __repr__(self) -> str:
        judged = self.validate or self.fit
        errors = ", ".join(f"{error:.4f} rad" for error in judged.position_error)
        what = "on validation logs" if self.validate else "on its own logs"
        return f"<IdentifiedServos {self._json['arm']}: position error {errors} {what}>"

    def _repr_html_(self) -> str:
        judged = self.validate or self.fit
        rows = [
            [servo.joint, f"{fit:.4f} rad", f"{error:.4f} rad", f"{goal:.4f} rad"]
            for servo, fit, error, goal in zip(
                self.servo, self.fit.position_error, judged.position_error, judged.goal_error
            )
        ]
        constants = [
            [servo.joint, c.name, f"{c.value:.4g}", "" if c.std is None else f"{c.std:.2g}", c.unit]
            for servo in self.servo
            for c in servo.constants.values()
        ]
        return (
            self._repr_unusable()
            + paragraph(f"{self._json['arm']}: position servos", strong=True)
            + table(["joint", "fit", "validation" if self.validate else "judged on the fit", "goal"], rows)
            + table(["joint", "constant", "value", "standard error", "unit"], constants)
            + "".join(paragraph(warning) for warning in self.warnings)
        )


@dataclass(frozen=True)
class ServoEffect:
    """An effect that the model of a servo lacks, with its evidence."""

    #: The effect's name, as docs/servos.md lists them.
    effect: str
    #: The joints it acts on, from 1.
    joints: List[int]
    #: The physical values, SI units.
    parameters: Dict[str, Any]
    #: Position error without it and with it, rms by joint, rad: on the validation logs, or on the logs that
    #: have it.
    rms_before: Array
    rms_after: Array
    #: Probability of this change of the error by chance.
    p_value: float
    #: 1 less that: that the error changes, and not how often such a name is right.
    probability: float
    #: Logs it is in, where it is in some only.
    logs: List[str]
    #: Share of the squared error that stays.
    leftover: float
    #: Names that were considered and not given, and why.
    rivals: List[Tuple[str, str]]


@dataclass(frozen=True)
class ServoVerdict:
    """How well a joint's position is predicted on the validation logs."""

    #: From 1.
    joint: int
    #: "predicted", "improved", "not predicted" or "not judged".
    state: str
    #: The position error over that of the goal with its best delay; NaN where it is not judged.
    left: float
    #: What to do; empty where little is left.
    advice: str


class ExplainedServos(Judged):
    """What the model of position servos lacks, judged by positions of other logs."""

    @property
    def verdict(self) -> List[ServoVerdict]:
        """How well each joint is predicted."""

        def of(entry: Dict[str, Any]) -> ServoVerdict:
            left = math.nan if entry["left"] is None else entry["left"]
            return ServoVerdict(entry["joint"], entry["state"], left, entry["advice"])

        return [of(entry) for entry in self._json["verdict"]]

    @property
    def effects(self) -> List[ServoEffect]:
        """Named effects in the order in which they were found; empty where the model lacks nothing."""
        return [ServoEffect(**evidence(entry)) for entry in self._json["effects"]]

    @property
    def logs(self) -> List[Dict[str, Any]]:
        """Log by log, the fitted ones first: ``like_the_others``, ``error_ratio`` and what ``differs``."""
        parsed: List[Dict[str, Any]] = self._json["logs"]
        return parsed

    @property
    def before(self) -> Array:
        """Position error of the base model on the validation logs, rms by joint, (n,), rad."""
        return numbers(self._json["before"]["validate"]["position_error"])

    @property
    def after(self) -> Array:
        """Position error with all effects on the validation logs, rms by joint, (n,), rad."""
        return numbers(self._json["after"]["validate"]["position_error"])

    @property
    def goal_error(self) -> Array:
        """Position error of the logged goal with its best delay, (n,), rad; NaN where the drive was off."""
        return numbers(self._json["goal_error"])

    def __repr__(self) -> str:
        named = ", ".join(f"{e.effect} on {joints_in_words(e.joints)}" for e in self.effects) or "no effect"
        return f"<ExplainedServos {self._json['arm']}: {named}>"

    def _repr_html_(self) -> str:
        effects = [
            [e.effect, joints_in_words(e.joints), figures(e.parameters), len(e.logs) or "all"]
            for e in self.effects
        ]
        named = table(["effect", "joints", "parameters", "logs"], effects) if effects else ""
        rows = [
            [v.joint, v.state, f"{b:.4f} rad", f"{a:.4f} rad", v.advice]
            for v, b, a in zip(self.verdict, self.before, self.after)
        ]
        lead = paragraph(named and "What the servos' model lacks" or "No effect was named.", strong=True)
        head = ["joint", "verdict", "base model", "with effects", "advice"]
        return self._repr_unusable() + lead + named + table(head, rows)
