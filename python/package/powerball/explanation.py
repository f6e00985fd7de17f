"""From what a model leaves to named effects: ``explain``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Tuple, Union

from . import _core
from ._arrays import Array, Values
from ._logs import Logs, given
from ._model import Model, optional_model
from ._progress import Progress, listener
from ._result import OfLogs, Spread, evidence, figures, joints_in_words, numbers, paragraph, spread, table
from .arm import Arm
from .identification import Map, said
from .rule import Rule, rule_text
from .servos import ExplainedServos, masses


@dataclass(frozen=True)
class Effect:
    """An effect that the model lacks, with its evidence."""

    #: The effect's name, as docs/explain.md lists them.
    effect: str
    #: The joints it acts on, from 1.
    joints: List[int]
    #: The physical values, SI units.
    parameters: Dict[str, Any]
    #: The standard error of its size on each joint, a share of it; None where it is not of the fit.
    relative_std: List[Optional[float]]
    #: Held-out error of its joints without and with it, N·m.
    rms_before: Array
    rms_after: Array
    #: Probability of as much by chance, over all joints and candidates tried.
    p_value: float
    #: How often such a name is right.
    probability: float
    #: The name's gain over that of the next best name.
    margin: float
    #: Share of the residual's excess over the noise floor that stays on its joints.
    leftover: float
    #: Logs it is in, where it is in some only.
    logs: List[str]
    #: Names that were considered and not given, and why.
    rivals: List[Tuple[str, str]]


@dataclass(frozen=True)
class Verdict:
    """How well a joint's torque is predicted on the validation logs."""

    #: From 1.
    joint: int
    #: "at the noise floor", "predicted", "improved" or "not predicted".
    state: str
    #: Share of the torque's rms on the validation logs that is left; NaN where the joint does not move.
    left: float
    #: What to think of and to do.
    advice: str


@dataclass(frozen=True)
class Coefficient:
    """A coefficient of a law."""

    name: str
    value: float
    #: Standard error.
    std: float
    unit: str


@dataclass(frozen=True)
class Law:
    """A torque without a name, as a formula."""

    #: As text: ``tau2 = c1·q2·q3 + …``, N·m.
    formula: str
    latex: str
    joints: List[int]
    coefficients: List[Coefficient]
    #: Change of the rms error on the validation logs by it, by joint: with it over without it, less 1.
    held_out_change: Array
    #: 1 less the probability of as much by chance.
    probability: float
    #: The named effect that came nearest.
    nearest: Optional[str]


@dataclass(frozen=True)
class Trajectory:
    """Samples of a motion from rest to rest."""

    #: (N,), s.
    t: Array
    #: (N, n), rad or m; and its derivatives.
    q: Array
    dq: Array
    ddq: Array
    #: As the commands read it: t, q1 …, dq1 …, ddq1 ….
    csv: str

    def save(self, path: Any) -> None:
        """Writes it as CSV for ``powerball record``."""
        _core.write_whole(path, self.csv.encode())


def trajectory(core: _core.Trajectory) -> Trajectory:
    """A trajectory of the compiled part's."""
    return Trajectory(*core.arrays(), core.csv())


class Explained(OfLogs):
    """What a model lacks on logs, judged on logs of another path."""

    @property
    def verdict(self) -> List[Verdict]:
        """How far each joint's torque is explained: the first thing to read."""

        def of(entry: Dict[str, Any]) -> Verdict:
            left = math.nan if entry["left"] is None else entry["left"]
            return Verdict(entry["joint"], entry["state"], left, entry["advice"])

        return [of(entry) for entry in self._json["verdict"]]

    @property
    def logs(self) -> List[Dict[str, Any]]:
        """Log by log, those that were fitted first: ``log``, ``like_the_others`` and what ``differs``."""
        parsed: List[Dict[str, Any]] = self._json["logs"]
        return parsed

    @property
    def effects(self) -> List[Effect]:
        """Named effects in the order in which they were added; empty where the model lacks nothing."""

        def of(entry: Dict[str, Any]) -> Effect:
            more = {key: entry[key] for key in ("margin", "relative_std")}
            return Effect(**evidence(entry), **more)

        return [of(entry) for entry in self._json["effects"]]

    @property
    def laws(self) -> List[Law]:
        """What is there without a name, as formulas."""

        def of(entry: Dict[str, Any]) -> Law:
            return Law(
                formula=entry["formula"],
                latex=entry["latex"],
                joints=list(entry["joints"]),
                coefficients=[Coefficient(**coefficient) for coefficient in entry["coefficients"]],
                held_out_change=numbers(entry["held_out_change"]),
                probability=entry["probability"],
                nearest=entry["nearest"],
            )

        return [of(entry) for entry in self._json["laws"]]

    @property
    def before(self) -> Spread:
        """Errors of the base model on the validation logs."""
        return self._spread("before", "validate")

    @property
    def after(self) -> Spread:
        """Errors with all effects on the validation logs."""
        return self._spread("after", "validate")

    def _spread(self, when: str, of: str) -> Spread:
        found = spread(self._json[when][of])
        assert found is not None
        return found

    @property
    def noise_floor(self) -> Array:
        """What white measurement noise alone would leave, (n,), N·m."""
        return numbers(self._json["noise_floor"])

    @property
    def explainable(self) -> Array:
        """The share of the squared error on the validation set that a smooth law would take away."""
        return numbers(self._json["explainable"])

    @property
    def unattributed(self) -> Optional[Dict[str, Any]]:
        """What stays without a name, and the signals that it depends on."""
        parsed: Optional[Dict[str, Any]] = self._json["unattributed"]
        return parsed

    @property
    def next_experiment(self) -> Optional[Dict[str, Any]]:
        """What to record to tell names apart that these logs leave open."""
        parsed: Optional[Dict[str, Any]] = self._json["next_experiment"]
        return parsed

    @property
    def next_trajectory(self) -> Optional[Trajectory]:
        """The path to record for it."""
        core = self._core.trajectory()
        return None if core is None else trajectory(core)

    def model_json(self) -> str:
        """model.json: the model with everything that was named, for ``verify`` and ``generate``."""
        return str(self._core.model_json())

    def __repr__(self) -> str:
        named = ", ".join(f"{e.effect} on {joints_in_words(e.joints)}" for e in self.effects) or "no effect"
        return f"<Explained {self._json['arm']}: {named}>"

    def _repr_html_(self) -> str:
        effects = [
            [e.effect, joints_in_words(e.joints), figures(e.parameters), f"{100 * e.probability:.0f} %"]
            for e in self.effects
        ]
        named = table(["effect", "joints", "parameters", "probability"], effects) if effects else ""
        rows = [
            [v.joint, v.state, f"{b:.4f} N·m", f"{a:.4f} N·m", v.advice]
            for v, b, a in zip(self.verdict, self.before.rms, self.after.rms)
        ]
        lead = paragraph(named and "What the model lacks" or "No effect was named.", strong=True)
        formulas = "".join(paragraph(f"Without a name: {law.formula}") for law in self.laws)
        return (
            self._repr_unusable()
            + lead
            + named
            + formulas
            + table(["joint", "verdict", "base model", "with effects", "advice"], rows)
        )


def explain(
    arm: Arm,
    log: Logs,
    validate: Logs,
    *,
    map: Optional[Map] = None,
    model: Optional[Model] = None,
    values: Optional[Values] = None,
    rule: Optional[Rule] = None,
    progress: Progress = False,
) -> Union[Explained, ExplainedServos]:
    """Finds, names and adds what the model lacks on logs; every addition is judged on logs of another path.

    Logs as for :func:`identify`, in the order in which they were recorded. ``model`` is what is known
    already: it is taken out of the logs as it stands, and what is found comes to it. ``rule`` has every
    threshold by which this is decided.

    Logs of position servos (columns ``goal1`` … and no torque) give ``ExplainedServos``. ``values`` are then
    the arm's masses, as :func:`identify` takes them.

    Raises: ``InputError`` where logs or the rule cannot be used, ``RefusedError`` where they hold too little.
    """
    with listener(progress) as tell:
        core = _core.explain(
            arm._core,
            given(log, "log"),
            given(validate, "validate"),
            said(map),
            optional_model(model),
            masses(values),
            rule_text(rule or Rule()),
            tell,
        )
    return ExplainedServos(core) if isinstance(core, _core.Written) else Explained(core)
