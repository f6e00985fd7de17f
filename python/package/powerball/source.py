"""Code and robot descriptions from models: ``generate`` and ``export``."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from typing import Optional, Sequence, Union

from . import _core
from ._arrays import PathLike, Values
from ._model import Model, model_text
from .arm import Arm
from .explanation import Explained
from .identification import Identified
from .servos import IdentifiedServos


def generate(
    arm: Arm,
    *,
    parameters: str = "minimal",
    functions: Optional[Sequence[str]] = None,
    values: Optional[Values] = None,
    friction: Sequence[str] = (),
    batch: bool = False,
    tests: bool = False,
    contract: bool = False,
    model: Optional[Model] = None,
    scalar: str = "f64",
) -> str:
    """Rust source of an arm's functions, or of a whole torque model for a controller.

    Without ``model`` it is what ``dyngen generate`` writes: ``functions`` of the set ``parameters``, with
    ``values`` baked in where they are given, columns for ``friction`` ("viscous", "coulomb", "tanh:SHAPE"),
    the module ``batch`` and the arm's own ``tests``; with ``contract`` products are formed within sums (fused
    multiply-add), for processors that have it. With ``model``, a result of ``identify`` or ``explain``,
    it is what ``powerball generate`` writes: rigid arm, friction and every effect, for the ``scalar`` "f32"
    or "f64"; what a controller cannot make up for is reported as a warning.
    """
    names = None if functions is None else list(functions)
    if model is None:
        baked = None if values is None else arm.set_values(values, parameters=parameters)
        return _core.generate(arm._core, parameters, names, baked, list(friction), batch, tests, contract)
    source, notes = _core.generate_model(arm._core, model_text(model), scalar, names)
    _warn(notes)
    return source


def export(
    arm: Arm,
    values: Union[Identified, PathLike, Mapping[str, float]],
    *,
    friction: Union[None, bool, Identified, IdentifiedServos, Explained, PathLike] = None,
    uncertain: bool = False,
    output: Optional[PathLike] = None,
) -> str:
    """The URDF or MuJoCo model that the arm was imported from, with identified values.

    Written to ``output`` too, where that is given. ``values`` are a result of ``identify``, of which the
    nearest real arm is taken, or values of all parameters. ``friction`` is where damping and friction are
    from; a result brings its own, unless it is ``False``. That of ``explain`` has effects, of which a MuJoCo
    model gets ripple, presliding and Stribeck's friction. That of position servos has drives, which a MuJoCo
    model gets as ``<position>`` actuators. Damping that is not larger than its own standard error stays as it
    was, unless ``uncertain`` asks for it. What is to be reported about the new file is given as a warning.
    """
    if isinstance(values, Mapping):
        text = (json.dumps(dict(values)), "values")
    else:
        text = model_text(values)
    if friction is None or friction is True:
        of = text if isinstance(values, Identified) else None
    else:
        of = None if friction is False else model_text(friction)
    exported, notes = _core.export_imported(arm._core, text, of, uncertain)
    _warn(notes)
    if output is not None:
        _core.write_whole(output, exported.encode())
    return exported


def _warn(notes: Sequence[str]) -> None:
    for note in notes:
        warnings.warn(note, stacklevel=3)
