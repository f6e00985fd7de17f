"""What is in log files: ``inspect`` and ``read_log``."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any, Dict, List, Optional

from . import _core
from ._arrays import Array, PathLike
from ._logs import LogLike, given
from .arm import Arm
from .identification import Map, said


@dataclass(frozen=True)
class Recording:
    """A log as the fits read it: its faults taken out, in SI units. It is a log for them, too."""

    #: Rising times, (N,), s.
    t: Array
    #: Positions, (N, n), rad or m, without wraps.
    q: Array
    #: Torques, (N, n), N·m or N, positive in the direction of q.
    tau: Array
    #: Temperatures, (N, n), °C, where they were logged.
    temp: Optional[Array]
    #: What is odd about the log, and what was done about it.
    findings: List[str]


def read_log(arm: Arm, log: LogLike, *, map: Optional[Map] = None) -> Recording:
    """Reads a log of an arm with all the checks of the fits.

    Raises: ``InputError`` with every reason why it cannot be used.
    """
    (one,) = given(log, "log")
    return Recording(*_core.read_log(arm._core, one, said(map)))


def inspect(file: PathLike, *, arm: Optional[Arm] = None, map: Optional[Map] = None) -> Dict[str, Any]:
    """What ``powerball log --json`` reports about a file: topics, columns, units, rates, gaps, warnings.

    With ``arm`` also the log that ``identify`` would read, or why it is none.
    """
    parsed: Dict[str, Any] = json.loads(
        _core.inspect(os.fspath(file), said(map), None if arm is None else arm._core)
    )
    return parsed
