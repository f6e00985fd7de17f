"""Controllers in simulation: ``simulate``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Callable, Optional, Sequence, Tuple, Union

import numpy as np

from . import _core
from ._arrays import Array
from ._model import Model, model_text
from ._result import table
from .arm import Arm
from .explanation import Trajectory

#: ``(t, q, dq, q_path, dq_path, ddq_path) -> n torques``: s, rad, rad/s, then the path's; N·m.
Controller = Callable[[float, Array, Array, Array, Array, Array], Sequence[float]]

#: A trajectory, or ``(t, q)`` or ``(t, q, dq, ddq)`` with arrays (N,) and (N, n) at even times.
Path = Union[Trajectory, Tuple[Array, Array], Tuple[Array, Array, Array, Array]]


@dataclass(frozen=True)
class Simulated:
    """A path as a simulated arm followed it."""

    #: (N,), s.
    t: Array
    #: Positions and velocities (N, n), rad and rad/s.
    q: Array
    dq: Array
    #: Torques of the motors (N, n), N·m.
    tau: Array
    #: The path (N, n), rad.
    q_path: Array

    @property
    def rms(self) -> Array:
        """Position less path, root mean square by joint, rad."""
        rms: Array = np.sqrt(np.mean((self.q - self.q_path) ** 2, axis=0))
        return rms

    def __repr__(self) -> str:
        errors = ", ".join(f"{1e3 * error:.3f}" for error in self.rms)
        return f"<Simulated: {self.t[-1]:.2f} s, off by {errors} mrad rms>"

    def _repr_html_(self) -> str:
        rows = [[j + 1, f"{1e3 * error:.3f} mrad"] for j, error in enumerate(self.rms)]
        return table(["joint", "rms off the path"], rows)


def simulate(
    arm: Arm,
    model: Model,
    controller: Union[str, Controller],
    path: Path,
    *,
    plant: Optional[Model] = None,
    bandwidth: Optional[float] = None,
    damping: float = 1.0,
) -> Simulated:
    """Moves a simulated arm along a path, from rest where the path begins; torques are held for a sample.

    ``controller`` knows ``model``: "gravity", "computed_torque" (default bandwidth 0.1/cycle rad/s) or
    "impedance" (8 rad/s), the latter two with the model's friction and effects fed forward, or a function,
    which gets what it sees and returns n torques in N·m. The arm moves as ``plant`` says, by default the
    model itself: give ``explain``'s model as the plant and ``identify``'s as the model to see what an effect
    costs that a controller does not know. Arms have 1 to 7 joints.
    """
    t, q, dq, ddq = _samples(path)
    period = _period(t)
    motion = [q.tolist(), dq.tolist(), ddq.tolist()]
    truth = model_text(model if plant is None else plant)
    if callable(controller):
        moved = _core.simulate_function(arm._core, truth, controller, period, motion)
    else:
        if bandwidth is None:
            bandwidth = 8.0 if controller == "impedance" else 0.1 / period
        known = model_text(model)
        moved = _core.simulate(
            arm._core, truth, known, controller, float(bandwidth), float(damping), period, motion
        )
    return Simulated(t, moved[0], moved[1], moved[2], q)


def _samples(path: Path) -> Tuple[Array, Array, Array, Array]:
    parts = (path.t, path.q, path.dq, path.ddq) if isinstance(path, Trajectory) else path
    arrays = [np.asarray(part, dtype=float) for part in parts]
    if len(arrays) not in (2, 4) or arrays[0].ndim != 1 or any(a.ndim != 2 for a in arrays[1:]):
        raise ValueError("path must be a Trajectory, (t, q) or (t, q, dq, ddq) with t (N,) and q (N, n)")
    t = arrays[0]
    if len(t) < 2 or any(len(a) != len(t) or a.shape != arrays[1].shape for a in arrays[1:]):
        raise ValueError(
            f"path: t has {len(t)} times; q, dq and ddq must be (N, n) with the same N, 2 at least"
        )
    if not all(np.all(np.isfinite(a)) for a in arrays):
        raise ValueError("path: NaN or infinity")
    if len(arrays) == 2:
        dq = np.gradient(arrays[1], t, axis=0)
        arrays += [dq, np.gradient(dq, t, axis=0)]
    return arrays[0], arrays[1], arrays[2], arrays[3]


def _period(t: Array) -> float:
    period = float(t[-1] - t[0]) / (len(t) - 1)
    if not period > 0 or np.max(np.abs(np.diff(t) - period)) > 1e-3 * period:
        raise ValueError("path: times must rise evenly")
    return period
