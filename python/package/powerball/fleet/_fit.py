"""A fit as its two files, the numbers in it, and what a spread between fits makes of its errors."""

from __future__ import annotations

import json
import math
import os
import tempfile
from dataclasses import dataclass
from typing import Any, Dict, List, Mapping, Optional, Tuple

from .. import _core
from ..identification import Identified
from ._store import Row

Json = Dict[str, Any]


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
        """The files that `powerball identify` writes of a result."""
        with tempfile.TemporaryDirectory() as folder:
            model.save(folder)
            files: List[Json] = []
            for name in ("identified.json", "covariance.json"):
                with open(os.path.join(folder, name), encoding="utf-8") as file:
                    files.append(json.load(file))
        return cls(*files)

    @classmethod
    def of_row(cls, row: Row) -> Fit:
        """The fit of a log of the store."""
        flat, identified = row["covariance"], json.loads(row["identified"])
        size = len(row["freedom"])
        triangle = [flat[k * (k + 1) // 2 : (k + 1) * (k + 2) // 2] for k in range(size)]
        covariance = {
            "parameters": row["parameters"],
            "joints": len(row["friction"]),
            "covariance": triangle,
            "freedom": row["freedom"],
            "path": json.loads(row["path"]),
        }
        return cls(identified, covariance)

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

    def numbers(self) -> Dict[str, Number]:
        """What is followed over logs and units, as far as the logs determine it.

        The minimal set, and of each joint Coulomb friction γ1 + γ3 and viscous friction γ5.
        """
        found: Dict[str, Tuple[float, Optional[float]]] = {}
        for entry in self.identified["parameters"]:
            found[entry["name"]] = (entry["value"], entry["std"])
        for joint in self.identified["friction"]:
            j = joint["joint"]
            found[coulomb(j)] = (joint["gamma1"] + joint["gamma3"], joint.get("coulomb_std"))
            found[viscous(j)] = (joint["gamma5"], joint["std"][4])
        return {name: Number(value, std * std) for name, (value, std) in found.items() if std}

    def widened(self, extra: Mapping[str, Extra]) -> Fit:
        """The same values with larger errors: variances come to those of the numbers of these names."""
        covariance = [list(row) for row in self.covariance["covariance"]]
        freedom = list(self.covariance["freedom"])
        for name, more in extra.items():
            for share, column in self._columns_of(name):
                freedom[column] = _satterthwaite(
                    (covariance[column][column], freedom[column]),
                    (share * share * more.variance, more.freedom),
                )
            # A Coulomb level is two columns that grow together.
            for share, a in self._columns_of(name):
                for other, b in self._columns_of(name):
                    if a >= b:
                        covariance[a][b] += share * other * more.variance
        return Fit(self.identified, {**self.covariance, "covariance": covariance, "freedom": freedom})

    def _columns_of(self, name: str) -> List[Tuple[float, int]]:
        """The columns of a number, each with its share of it."""
        names = self.covariance["parameters"]
        if name in names:
            return [(1.0, names.index(name))]
        for joint in self.identified["friction"]:
            first = len(names) + 5 * (joint["joint"] - 1)
            if name == viscous(joint["joint"]):
                return [(1.0, first + 2)]
            if name == coulomb(joint["joint"]):
                whole = joint["gamma1"] + joint["gamma3"]
                shares = [(joint[f"gamma{k}"] / whole, first + (k - 1) // 2) for k in (1, 3)] if whole else []
                return [(share, column) for share, column in shares if share]
        return []

    def side(self, name: str) -> Side:
        """As one of two that are compared; ``name`` is what messages call it."""
        with tempfile.TemporaryDirectory() as folder:
            for file, parsed in (("identified", self.identified), ("covariance", self.covariance)):
                with open(os.path.join(folder, f"{file}.json"), "w", encoding="utf-8") as opened:
                    json.dump(parsed, opened)
            return Side(name, folder, _core.ComparedSide.read(folder))


@dataclass(frozen=True)
class Side:
    """One of two fits that are compared."""

    name: str
    #: Where it was read from.
    folder: str
    core: _core.ComparedSide


def compare(a: Side, b: Side, level: float) -> Json:
    """What ``powerball compare`` says of two fits: comparison.json."""
    text = _core.compare(a.core, b.core, level).json()
    for side in (a, b):
        text = text.replace(json.dumps(side.folder)[1:-1], side.name)
    parsed: Json = json.loads(text)
    return parsed


def coulomb(joint: int) -> str:
    """The name of a joint's Coulomb friction."""
    return f"Coulomb friction of joint {joint}"


def viscous(joint: int) -> str:
    """The name of a joint's viscous friction."""
    return f"viscous friction of joint {joint}"


def unit_of_number(name: str) -> str:
    """What friction is measured in; a parameter of the minimal set says it by its terms."""
    return {"C": "N·m", "v": "N·m·s/rad"}.get(name[0], "") if " friction of joint " in name else ""


def _satterthwaite(a: Tuple[float, float], b: Tuple[float, float]) -> float:
    """Degrees of freedom of a sum of two variances; 0 where the first one is not determined."""
    if a[1] <= 0.0:
        return 0.0
    doubt = a[0] ** 2 / a[1] + (b[0] ** 2 / b[1] if b[1] > 0 else 0.0)
    total = (a[0] + b[0]) ** 2
    return total / doubt if doubt > 0 and math.isfinite(total / doubt) else a[1]
