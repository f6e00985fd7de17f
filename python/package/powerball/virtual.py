"""The virtual arm: logs of which the truth is known, to try everything on."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import List, Optional

from . import _core
from ._arrays import PathLike
from ._progress import Progress, listener


@dataclass(frozen=True)
class Truth:
    """What is in a virtual arm and not in its model."""

    #: The effect's name, as ``Effect.effect`` gives it.
    effect: str
    #: The effect's joints, from 1; empty where it is the whole arm's.
    joints: List[int]
    #: The effect's figures in words.
    figures: str


@dataclass(frozen=True)
class Session:
    """A recording session on the virtual LWA 4P."""

    #: The arm file as the model knows it.
    arm_file: str
    #: Logs to fit.
    log: List[str]
    #: Logs of other paths.
    validate: List[str]
    #: What the model does not know.
    truth: Truth


def virtual_effects() -> List[str]:
    """The effects that a virtual arm may have."""
    return _core.virtual_effects()


def virtual_session(
    directory: PathLike, *, seed: int = 1, effect: Optional[str] = None, progress: Progress = False
) -> Session:
    """Drives the virtual LWA 4P along exciting paths over a CAN bus in memory; writes its logs into a folder.

    The arm has an effect that its model does not know about: the one named, or one that ``seed`` draws.
    """
    with listener(progress) as tell:
        arm, fit, held_out, truth = _core.virtual_session(os.fspath(directory), seed, effect, tell)
    return Session(str(arm), [str(file) for file in fit], [str(file) for file in held_out], Truth(*truth))
