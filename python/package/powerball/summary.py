"""Logs as the sufficient statistics of their fit: ``summarize``.

A summary holds all that ``identify`` needs of its logs, and summaries can be joined in any order and on any
machine: thousands of logs reduce one by one, wherever they are.
"""

from __future__ import annotations

import os
from typing import List, Optional, Tuple, Union

from . import _core
from ._arrays import PathLike
from ._logs import Logs, given
from ._progress import Progress, listener
from .arm import Arm
from .identification import Map, said


class Summary:
    """Logs of one arm, reduced. ``identify`` and ``summarize`` take it in place of its logs.

    It can be pickled, so that Dask, Ray or joblib pass it between machines.
    """

    def __init__(self, core: _core.Summary) -> None:
        self._core = core

    @classmethod
    def from_bytes(cls, data: bytes) -> Summary:
        """A summary from the bytes of its file. Raises: ``InputError`` where they are none, or damaged."""
        return cls(_core.Summary.from_bytes(data))

    @classmethod
    def read(cls, file: PathLike) -> Summary:
        """A summary from its file, of ``powerball summarize`` or ``save``."""
        with open(file, "rb") as opened:
            return cls.from_bytes(opened.read())

    def to_bytes(self) -> bytes:
        """The bytes of its file."""
        return self._core.to_bytes()

    def save(self, file: PathLike) -> None:
        """Writes it as a file, as a whole or not at all."""
        _core.write_whole(os.fspath(file), self.to_bytes())

    @property
    def arm(self) -> str:
        """The arm's name."""
        return self._core.arm()

    @property
    def logs(self) -> List[Tuple[str, float]]:
        """The logs that went in, and the seconds of each."""
        return self._core.logs()

    @property
    def seconds(self) -> float:
        """The length of all logs together, s."""
        return sum(seconds for _, seconds in self.logs)

    @property
    def rows(self) -> List[int]:
        """How many rows of the fit there are, joint by joint."""
        return self._core.rows()

    @property
    def warnings(self) -> List[str]:
        """What is odd about the logs; not kept in a file."""
        return self._core.warnings()

    def __reduce__(self) -> Tuple[object, Tuple[bytes]]:
        return (Summary.from_bytes, (self.to_bytes(),))

    def __repr__(self) -> str:
        return f"<Summary {self.arm}: {len(self.logs)} logs, {self.seconds:.0f} s>"


def summarize(
    arm: Arm,
    log: Union[Logs, Summary],
    *,
    map: Optional[Map] = None,
    progress: Progress = False,
) -> Summary:
    """Reduces logs to their sufficient statistics, and joins summaries with them.

    ``log`` is what ``identify`` takes: one or several files, frames, ``Log`` objects, and summaries, in files
    or in memory. All are of one arm and of one mounting of its base.

    Raises: ``InputError`` where a log cannot be used, ``RefusedError`` where they have no answer.
    """
    with listener(progress) as tell:
        return Summary(_core.summarize(arm._core, given(log, "log"), said(map), tell))
