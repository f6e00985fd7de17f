"""Torque models of robot arms: exact dynamics, identification from logs, and the name of what a model lacks.

import powerball as pb

arm = pb.Arm.from_urdf("panda.urdf", tip="panda_link8")
tau = arm.inverse_dynamics(q, dq, ddq)               # (n,) or (N, n), proven equal to the Lagrangian
"""

from ._errors import Error, InputError, RefusedError
from .arm import Arm, Check, Limits, ParameterSet, SetParameter

__all__ = [
    "Arm",
    "Check",
    "Error",
    "InputError",
    "Limits",
    "ParameterSet",
    "RefusedError",
    "SetParameter",
]
