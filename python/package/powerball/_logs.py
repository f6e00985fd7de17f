"""Logs as the compiled part takes them: files, or columns with their names."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, List, Optional, Tuple, Union, cast

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from ._arrays import Array, PathLike


@dataclass(frozen=True)
class Log:
    """A log in memory.

    Quantities have shape (N, n): N samples of n joints. Torques count before currents, which need the arm
    file's torque constants. Velocities check positions and times; those of the fit are computed from
    positions. A log with ``goal`` and neither torques nor currents is one of position servos.
    """

    #: Times, (N,), s; they may start anywhere.
    t: ArrayLike
    #: Positions, rad or m.
    q: ArrayLike
    #: Torques, N·m or N, positive in the direction of q.
    tau: Optional[ArrayLike] = None
    #: Motor currents, A.
    i: Optional[ArrayLike] = None
    #: Velocities, rad/s or m/s.
    dq: Optional[ArrayLike] = None
    #: Temperatures, °C.
    temp: Optional[ArrayLike] = None
    #: Torques on the motors' side of the gears, in any unit.
    motor: Optional[ArrayLike] = None
    #: What messages call it.
    name: Optional[str] = None
    #: Set-points of position servos, rad.
    goal: Optional[ArrayLike] = None
    #: Voltages of the drives, V.
    volts: Optional[ArrayLike] = None
    #: Whether each drive is switched on, 0 or 1.
    torque_enable: Optional[ArrayLike] = None


@dataclass(frozen=True)
class Mounted:
    """A log that was recorded with the base mounted otherwise than the arm file says."""

    log: Any
    #: "ROLL,PITCH" in degrees, or gravity in the base frame as "X,Y,Z" in m/s².
    mounting: str


#: A log: a file, a dict or frame with columns ``t``, ``q1`` …, ``tau1`` …, a structured array, or a ``Log``.
LogLike = Union[PathLike, Mapping[str, ArrayLike], Log, Mounted, Any]
#: One log or several.
Logs = Union[LogLike, Iterable[LogLike]]


@dataclass(frozen=True)
class Given:
    """One log for the compiled part."""

    path: Optional[str]
    name: str
    columns: List[Tuple[str, Array]] = field(default_factory=list)
    mounting: Optional[str] = None
    #: A summary of the compiled part.
    summary: Any = None


def given(logs: Optional[Logs], argument: str) -> List[Given]:
    """All logs of an argument, one or several, in order."""
    if logs is None:
        return []
    one = isinstance(logs, (str, os.PathLike, Mapping, Mounted)) or _is_table(logs) or _is_samples(logs)
    one = one or _is_summary(logs)
    several: List[Any] = [logs] if one else list(cast(Iterable[Any], logs))
    return [_given(log, f"{argument}[{k}]", None) for k, log in enumerate(several)]


def _is_table(log: Any) -> bool:
    return (hasattr(log, "columns") and hasattr(log, "__getitem__")) or (
        isinstance(log, np.ndarray) and log.dtype.names is not None
    )


def _is_samples(log: Any) -> bool:
    """A ``Log``, or what has its attributes."""
    return all(hasattr(log, key) for key in ("t", "q", "tau"))


def _is_summary(log: Any) -> bool:
    return isinstance(getattr(log, "_core", None), _core.Summary)


def _given(log: Any, name: str, mounting: Optional[str]) -> Given:
    if isinstance(log, Mounted):
        return _given(log.log, name, log.mounting)
    if isinstance(log, (str, os.PathLike)):
        return Given(os.fspath(log), os.fspath(log), mounting=mounting)
    if _is_summary(log):
        return Given(None, name, mounting=mounting, summary=log._core)
    if _is_samples(log):
        kept = ("t", "q", "tau", "i", "dq", "temp", "motor", "goal", "volts", "torque_enable")
        quantities = {key: getattr(log, key) for key in kept if getattr(log, key, None) is not None}
        return Given(None, getattr(log, "name", None) or name, _columns(quantities, name), mounting)
    if isinstance(log, Mapping):
        return Given(None, name, _columns(log, name), mounting)
    if isinstance(log, np.ndarray) and log.dtype.names is not None:
        return Given(None, name, _columns({key: log[key] for key in log.dtype.names}, name), mounting)
    if _is_table(log):
        return Given(None, name, _columns({str(key): log[key] for key in log.columns}, name), mounting)
    raise TypeError(
        f"{name} must be a file, a dict or a frame with columns t, q1 …, tau1 …, a structured array, a Log, "
        f"a Mounted log or a summary, not {type(log).__name__}"
    )


def _columns(table: Mapping[str, Any], name: str) -> List[Tuple[str, Array]]:
    """Named columns; ``q`` of shape (N, n) becomes ``q1`` to ``qn``."""
    columns: List[Tuple[str, Array]] = []
    for key, column in table.items():
        values = _numbers(np.asarray(column))
        if values.ndim == 1:
            columns.append((str(key), np.ascontiguousarray(values)))
        elif values.ndim == 2 and key != "t":
            columns += [(f"{key}{j + 1}", np.ascontiguousarray(values[:, j])) for j in range(values.shape[1])]
        else:
            expected = "(N,)" if key == "t" else "(N,) or (N, n)"
            raise ValueError(f"{name}: {key} must have shape {expected}, it has {values.shape}")
    return columns


def _numbers(column: Any) -> Array:
    """Numbers as float64, time stamps in seconds; a column of anything else holds none."""
    if column.dtype.kind == "M":
        return np.asarray(column.astype("datetime64[ns]").astype(np.int64) * 1e-9)
    if column.dtype.kind == "m":
        return np.asarray(column / np.timedelta64(1, "s"), dtype=np.float64)
    try:
        return np.asarray(column, dtype=np.float64)
    except (TypeError, ValueError):
        return np.full(column.shape, np.nan)
