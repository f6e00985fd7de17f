"""A fit as its two files, the numbers in it, and what a spread between fits makes of its errors."""

from __future__ import annotations

import json
import math
import os
import tempfile
from dataclasses import dataclass
from typing import Any, Dict, Mapping, Optional, Tuple

import numpy as np

from .. import _core
from .._arrays import Array
from ..identification import Identified
from ._store import Row

Json = Dict[str, Any]

#: Friction is followed as a line between these shares of the rms velocity: two of those that compare takes.
SLOW, FAST = 0.3, 1.2

#: By joint, from 1: the two velocities, rad/s or m/s.
Speeds = Mapping[int, Tuple[float, float]]


@dataclass(frozen=True)
class Number:
    """An estimate with its variance."""

    value: float
    variance: float


@dataclass(frozen=True)
class Extra:
    """A variance that comes to that of a fit, and its degrees of freedom."""

    variance: float
    freedom: float


@dataclass(frozen=True)
class Fit:
    """A result of ``identify``."""

    #: identified.json.
    identified: Json
    #: covariance.json.
    covariance: Json

    @classmethod
    def of(cls, model: Identified) -> Fit:
        """A result as its files."""
        return cls(model.to_dict(), json.loads(model._core.covariance()))

    @classmethod
    def of_row(cls, row: Row) -> Fit:
        """The fit of a log of the store."""
        flat, size = row["covariance"], len(row["freedom"])
        covariance = {
            "parameters": row["parameters"],
            "joints": len(row["friction"]),
            "covariance": [flat[k * (k + 1) // 2 : (k + 1) * (k + 2) // 2] for k in range(size)],
            "freedom": row["freedom"],
            "path": json.loads(row["path"]),
        }
        return cls(json.loads(row["identified"]), covariance)

    def columns(self) -> Row:
        """What a row of the store has of it."""
        entries, friction = self.identified["parameters"], self.identified["friction"]
        return {
            "verdict": "should not be used" if self.identified["unusable"] else "usable",
            "reasons": self.identified["unusable"],
            "warnings": self.identified["warnings"],
            "parameters": self.covariance["parameters"],
            "values": [entry["value"] for entry in entries],
            "std": [entry["std"] for entry in entries],
            "friction": [[joint[f"gamma{k}"] for k in range(1, 6)] for joint in friction],
            "covariance": [x for row in self.covariance["covariance"] for x in row],
            "freedom": self.covariance["freedom"],
            "identified": json.dumps(self.identified),
            "path": json.dumps(self.covariance["path"]),
        }

    def velocity(self, joint: int) -> Optional[float]:
        """The rms velocity of a joint in the fitted logs, rad/s or m/s."""
        path, column = self.covariance["path"][joint - 1], self._first(joint) + 2
        if column not in path["columns"]:
            return None
        at = path["columns"].index(column)
        return math.sqrt(path["products"][at][at])

    def numbers(self, speeds: Speeds) -> Dict[str, Number]:
        """What is followed over logs and units, as far as the logs determine it.

        The minimal set; and of each joint the line through its friction at two velocities, of which Coulomb
        friction is the height at rest, viscous friction the slope. The coefficients of Eq. 16 make up for
        each other and say nothing one by one.
        """
        freedom, covariance = self.covariance["freedom"], self.covariance["covariance"]
        found = {
            entry["name"]: Number(entry["value"], covariance[k][k])
            for k, entry in enumerate(self.identified["parameters"])
            if freedom[k] > 0
        }
        for joint, entry in enumerate(self.identified["friction"], 1):
            first = self._first(joint)
            if joint in speeds and any(f > 0 for f in freedom[first : first + 5]):
                gamma = np.array([entry["gamma1"], entry["gamma3"], entry["gamma5"], 0.0, 0.0])
                own = self._block(joint)
                for name, row in zip(friction_names(joint), self._line(joint, speeds)):
                    found[name] = Number(float(row @ gamma), max(0.0, float(row @ own @ row)))
        return {name: number for name, number in found.items() if number.variance > 0.0}

    def widened(self, extra: Mapping[str, Extra], speeds: Speeds) -> Fit:
        """The same values with larger errors: variances come to those of the numbers of these names."""
        covariance = [list(row) for row in self.covariance["covariance"]]
        freedom = list(self.covariance["freedom"])
        for k, name in enumerate(self.covariance["parameters"]):
            if name in extra:
                freedom[k] = _satterthwaite(Extra(covariance[k][k], freedom[k]), extra[name])
                covariance[k][k] += extra[name].variance
        numbers = self.numbers(speeds)
        for joint, (slow, fast) in speeds.items():
            first = self._first(joint)
            for name, change in zip(friction_names(joint), self._changes(joint, slow, fast)):
                if name not in extra:
                    continue
                # compare takes the least of a joint's.
                least = min((f for f in freedom[first : first + 5] if f > 0), default=0.0)
                own = numbers[name].variance if name in numbers else 0.0
                sure = _satterthwaite(Extra(own, least), extra[name])
                for a in range(3):
                    for b in range(a + 1):
                        covariance[first + a][first + b] += extra[name].variance * change[a] * change[b]
                    if change[a] and freedom[first + a] > 0:
                        freedom[first + a] = min(freedom[first + a], sure)
        return Fit(self.identified, {**self.covariance, "covariance": covariance, "freedom": freedom})

    def side(self, name: str) -> Side:
        """As one of two that are compared; ``name`` is what messages call it."""
        with tempfile.TemporaryDirectory() as folder:
            for file, parsed in (("identified", self.identified), ("covariance", self.covariance)):
                with open(os.path.join(folder, f"{file}.json"), "w", encoding="utf-8") as opened:
                    json.dump(parsed, opened)
            return Side(name, folder, _core.ComparedSide.read(folder))

    def _first(self, joint: int) -> int:
        """The first of a joint's five columns: two levels, the slope, two steepnesses."""
        return len(self.covariance["parameters"]) + 5 * (joint - 1)

    def _block(self, joint: int) -> Array:
        """The covariance of a joint's friction coefficients, (5, 5)."""
        first, rows = self._first(joint), self.covariance["covariance"]
        return np.array(
            [[rows[first + max(a, b)][first + min(a, b)] for b in range(5)] for a in range(5)], dtype=float
        )

    def _rows(self, joint: int, velocities: Tuple[float, float]) -> Tuple[Array, Array]:
        """What a joint's friction coefficients are multiplied with at two velocities."""
        entry = self.identified["friction"][joint - 1]
        slow, fast = (np.array(_core.friction_row(entry["gamma2"], entry["gamma4"], v)) for v in velocities)
        return slow, fast

    def _line(self, joint: int, speeds: Speeds) -> Tuple[Array, Array]:
        """The same for the height at rest and the slope of the line through both."""
        (low, high), (slow, fast) = self._rows(joint, speeds[joint]), speeds[joint]
        slope = (high - low) / (fast - slow)
        return low - slow * slope, slope

    def _changes(self, joint: int, slow: float, fast: float) -> Tuple[Array, Array]:
        """What of both levels and the slope makes the line higher by one, and steeper by one.

        The level that saturates first makes it higher, with as much of the slope as it bends by.
        """
        low, high = self._rows(joint, (slow, fast))
        level = int(np.argmax(low[:2]))
        bends = low[level] * fast - high[level] * slow
        higher, steeper = np.zeros(3), np.array([0.0, 0.0, 1.0])
        if bends > 1e-6 * fast:
            higher[level] = (fast - slow) / bends
            higher[2] = (low[level] - high[level]) / bends
        else:
            higher[level] = 1.0
        return higher, steeper


@dataclass(frozen=True)
class Side:
    """One of two fits that are compared."""

    name: str
    #: Where it was read from.
    folder: str
    core: _core.ComparedSide


@dataclass(frozen=True)
class Variation:
    """What varies from log to log of a unit, by number."""

    extra: Mapping[str, Extra]
    #: The velocities of the friction numbers.
    speeds: Speeds

    def of_mean(self, count: int) -> Dict[str, Extra]:
        """The same in a fit of several logs."""
        return {name: Extra(more.variance / count, more.freedom) for name, more in self.extra.items()}

    def side(self, fit: Fit, count: int, name: str) -> Side:
        """A fit of some logs of a unit as one of two that are compared."""
        return fit.widened(self.of_mean(count), self.speeds).side(name)

    def numbers(self, fit: Fit, count: int) -> Dict[str, Number]:
        """The numbers of a fit of some logs of a unit, with what varies in their variances."""
        more = self.of_mean(count)
        return {
            name: Number(n.value, n.variance + (more[name].variance if name in more else 0.0))
            for name, n in fit.numbers(self.speeds).items()
        }


def compare(a: Side, b: Side, level: float) -> Json:
    """What ``powerball compare`` says of two fits: comparison.json."""
    text = _core.compare(a.core, b.core, level).json()
    for side in (a, b):
        text = text.replace(json.dumps(side.folder)[1:-1], side.name)
    parsed: Json = json.loads(text)
    return parsed


def friction_names(joint: int) -> Tuple[str, str]:
    """The names of a joint's Coulomb and viscous friction."""
    return f"Coulomb friction of joint {joint}", f"viscous friction of joint {joint}"


def unit_of_number(name: str) -> str:
    """What friction is measured in; a parameter of the minimal set says it by its terms."""
    return {"C": "N·m", "v": "N·m·s/rad"}.get(name[0], "") if " friction of joint " in name else ""


def _satterthwaite(own: Extra, more: Extra) -> float:
    """Degrees of freedom of a sum of two variances; 0 where the first one is not determined."""
    if own.freedom <= 0.0:
        return 0.0
    doubt = own.variance**2 / own.freedom + (more.variance**2 / more.freedom if more.freedom > 0 else 0.0)
    freedom = (own.variance + more.variance) ** 2 / doubt if doubt > 0 else own.freedom
    return freedom if math.isfinite(freedom) else own.freedom
