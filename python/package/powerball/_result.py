"""What all results share: their JSON, a table for notebooks, their files."""

from __future__ import annotations

import html
import json
import os
from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Sequence

import numpy as np

from ._arrays import Array, PathLike


@dataclass(frozen=True)
class Spread:
    """Errors of a model on logs, joint by joint."""

    #: rms, (n,), N·m or N.
    rms: Array
    #: rms of the error over rms of the measured torque, (n,).
    relative: Array
    #: The end of the band in which the errors are, from 0, (n,), Hz.
    band: Array
    #: Samples they are of.
    samples: int


def spread(parsed: Optional[Dict[str, Any]]) -> Optional[Spread]:
    """A spread of its JSON."""
    if parsed is None:
        return None
    return Spread(
        numbers(parsed["rms"]), numbers(parsed["relative"]), numbers(parsed["band"]), int(parsed["samples"])
    )


def numbers(values: Sequence[Optional[float]]) -> Array:
    """An array of a JSON list; NaN where it has no number."""
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)


def evidence(entry: Dict[str, Any]) -> Dict[str, Any]:
    """What every named effect has, of torques or of positions."""
    return {
        "effect": entry["effect"],
        "joints": list(entry["joints"]),
        "parameters": entry["parameters"],
        "rms_before": numbers(entry["rms_before"]),
        "rms_after": numbers(entry["rms_after"]),
        "p_value": entry["p_value"],
        "probability": entry["probability"],
        "logs": entry.get("logs", []),
        "leftover": entry["leftover"],
        "rivals": [(rival["effect"], rival["why_not"]) for rival in entry["rivals"]],
    }


class Result:
    """A result: attributes for what is asked most, ``to_dict()`` for all of it."""

    def __init__(self, core: Any) -> None:
        self._core = core
        self._json: Dict[str, Any] = json.loads(core.json())

    def to_dict(self) -> Dict[str, Any]:
        """The result as the command's ``--json`` prints it."""
        parsed: Dict[str, Any] = json.loads(self._core.json())
        return parsed

    def save(self, directory: PathLike) -> None:
        """Writes the files that the command writes into its ``--out``, a folder that is made if missing."""
        self._core.save(os.fspath(directory))

    @property
    def warnings(self) -> List[str]:
        """What is to be reported about the logs, the arm file and the fit."""
        return list(self._json.get("warnings", []))


class Judged(Result):
    """A result that says whether it should be used."""

    @property
    def unusable(self) -> List[str]:
        """Why this result should not be used (exit 3 of the command); empty where it can be."""
        return list(self._json.get("unusable", []))

    def _repr_unusable(self) -> str:
        reasons = (f"Do not use this result: {reason}." for reason in self.unusable)
        return "".join(paragraph(reason, strong=True) for reason in reasons)


class OfLogs(Judged):
    """A result that says what the columns of its logs are."""

    @property
    def conventions(self) -> Optional[Dict[str, Any]]:
        """What the columns of the logs are: signs, units, gravity, delay; and the map that corrects them."""
        parsed: Optional[Dict[str, Any]] = self._json.get("conventions")
        return parsed


def table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A table in HTML."""

    def cells(row: Sequence[Any], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(str(cell))}</{tag}>" for cell in row) + "</tr>"

    return f"<table>{cells(head, 'th')}{''.join(cells(row, 'td') for row in rows)}</table>"


def paragraph(text: str, strong: bool = False) -> str:
    """A paragraph in HTML."""
    inner = html.escape(text)
    return f"<p><b>{inner}</b></p>" if strong else f"<p>{inner}</p>"


def error_rows(columns: Sequence[Optional[Spread]]) -> List[List[str]]:
    """One row a joint: error and share of the torque for each spread that is there."""
    there = [column for column in columns if column is not None]
    rows = []
    for j in range(len(there[0].rms) if there else 0):
        cells = [f"{s.rms[j]:.4f} N·m, {100 * s.relative[j]:.1f} %" for s in there]
        rows.append([str(j + 1), *cells])
    return rows


def joints_in_words(joints: Sequence[int]) -> str:
    """Joints by their numbers; none are the whole arm."""
    return "joint " + ", ".join(map(str, joints)) if joints else "the arm"


def figures(parameters: Dict[str, Any]) -> str:
    """Parameters of an effect in one line."""

    def short(value: Any) -> str:
        if isinstance(value, float):
            return f"{value:.4g}"
        return "[" + ", ".join(map(short, value)) + "]" if isinstance(value, list) else str(value)

    return ", ".join(f"{name} {short(value)}" for name, value in parameters.items())
