"""Exciting trajectories: ``excite``."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Sequence, Tuple, Union

from . import _core
from ._arrays import PathLike
from ._model import Model, optional_model
from ._progress import Progress, listener
from ._result import paragraph, table
from .arm import Arm
from .explanation import Trajectory, trajectory


@dataclass(frozen=True)
class _Asked:
    parameters: str
    period: float
    harmonics: int
    periods: int
    ramp: float
    margin: float
    objective: str
    weight: float
    mounting: List[str]
    floor: Union[None, float, str]
    radius: Optional[float]
    clearance: Optional[float]
    no_collision: bool
    values: Optional[Tuple[str, str]]
    no_torque: bool
    from_: Optional[List[float]]
    evaluations: int
    rate: float
    seed: int


class Excited:
    """Exciting trajectories with the figures of their search."""

    def __init__(self, core: _core.Excited) -> None:
        self._core = core
        self._json: Dict[str, Any] = json.loads(core.json())

    @property
    def trajectories(self) -> List[Trajectory]:
        """One for each mounting."""
        return [trajectory(core) for core in self._core.trajectories()]

    @property
    def trajectory(self) -> Trajectory:
        """The first one."""
        return self.trajectories[0]

    @property
    def condition(self) -> float:
        """Condition number of the regressor along them, columns normalised."""
        return float(self._json["conditions"]["normalised"])

    @property
    def assumed(self) -> List[str]:
        """What had to be assumed."""
        return list(self._json["assumed"])

    def to_dict(self) -> Dict[str, Any]:
        """The result as ``powerball excite --json`` prints it, without the names of files."""
        parsed: Dict[str, Any] = json.loads(self._core.json())
        return parsed

    def save(self, path: PathLike, report: Optional[PathLike] = None) -> None:
        """Writes the first trajectory as CSV, and a page with figures where ``report`` names one."""
        self.trajectory.save(path)
        if report is not None:
            _core.write_whole(report, self._core.page().encode())

    def __repr__(self) -> str:
        return f"<Excited: condition number {self.condition:.2f}, {self.trajectory.t[-1]:.1f} s>"

    def _repr_html_(self) -> str:
        joints = self._json.get("joints") or self._json["trajectories"][0]["joints"]
        rows = []
        for j, joint in enumerate(joints):
            low, high = joint["position"]
            rows.append([j + 1, f"{low:.2f} to {high:.2f}", f"{joint['velocity']:.2f}"])
        lead = paragraph(f"Condition number {self.condition:.2f} with normalised columns.", strong=True)
        head = ["joint", "position [rad]", "velocity [rad/s]"]
        return lead + table(head, rows) + "".join(paragraph(line) for line in self.assumed)


def excite(
    arm: Arm,
    *,
    parameters: str = "minimal",
    period: float = 10.0,
    harmonics: int = 4,
    periods: int = 2,
    ramp: float = 1.0,
    margin: float = 0.05,
    objective: str = "condition",
    weight: float = 1.0,
    mounting: Sequence[str] = (),
    floor: Union[None, float, str] = None,
    radius: Optional[float] = None,
    clearance: Optional[float] = None,
    no_collision: bool = False,
    values: Optional[Model] = None,
    no_torque: bool = False,
    from_: Optional[Sequence[float]] = None,
    evaluations: int = 72_000,
    rate: float = 200.0,
    seed: int = 0,
    progress: Progress = False,
) -> Excited:
    """Searches exciting Fourier trajectories (Eq. 17 to 20) within an arm's limits and surroundings.

    Arguments are the flags of ``powerball excite``: times in s, lengths in m, ``rate`` in samples a second;
    ``floor`` is a height or "none"; ``from_`` is the pose before the trajectory, rad; the same ``seed`` finds
    the same path. Every joint needs ``position``, ``velocity`` and ``acceleration`` in the arm file.
    """
    asked = _Asked(
        parameters,
        float(period),
        harmonics,
        periods,
        float(ramp),
        float(margin),
        objective,
        float(weight),
        list(mounting),
        floor,
        radius,
        clearance,
        no_collision,
        optional_model(values),
        no_torque,
        None if from_ is None else [float(q) for q in from_],
        evaluations,
        float(rate),
        seed,
    )
    with listener(progress) as tell:
        return Excited(_core.excite(arm._core, asked, tell))
