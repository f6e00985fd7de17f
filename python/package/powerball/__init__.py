"""Torque models of robot arms: exact dynamics, identification from logs, and the name of what a model lacks.

import powerball as pb

arm = pb.Arm.from_urdf("arm.urdf", tip="tool0")
tau = arm.inverse_dynamics(q, dq, ddq)                    # (n,) or (N, n), proven equal to the Lagrangian
model = pb.identify(arm, ["a.csv", "b.mcap"], ["c.csv"])  # files, frames, dicts of arrays
why = pb.explain(arm, ["a.csv", "b.mcap"], ["c.csv"])     # what the model lacks, by name
"""

from ._core import __version__
from ._errors import Error, InputError, RefusedError
from ._logs import Log, Mounted
from ._result import Spread
from .arm import Arm, Check, Limits, ParameterSet, SetParameter
from .excitation import Excited, excite
from .explanation import Coefficient, Effect, Explained, Law, Trajectory, Verdict, explain
from .identification import (
    Compared,
    Identified,
    JointFriction,
    JointVerdict,
    ParameterEstimate,
    Verified,
    compare,
    identify,
    verify,
)
from .reading import Recording, inspect, read_log
from .rule import Rule
from .servos import (
    ExplainedServos,
    IdentifiedServos,
    JointServo,
    PositionErrors,
    ServoConstant,
    ServoEffect,
    ServoFriction,
    ServoVerdict,
)
from .simulation import Simulated, simulate
from .source import export, generate
from .summary import Summary, summarize
from .virtual import Session, Truth, virtual_effects, virtual_session

__all__ = [
    "Arm",
    "Check",
    "Coefficient",
    "Compared",
    "Effect",
    "Error",
    "Excited",
    "Explained",
    "ExplainedServos",
    "Identified",
    "IdentifiedServos",
    "InputError",
    "JointFriction",
    "JointServo",
    "JointVerdict",
    "Law",
    "Limits",
    "Log",
    "Mounted",
    "ParameterEstimate",
    "ParameterSet",
    "PositionErrors",
    "Recording",
    "RefusedError",
    "Rule",
    "ServoConstant",
    "ServoEffect",
    "ServoFriction",
    "ServoVerdict",
    "Session",
    "SetParameter",
    "Simulated",
    "Spread",
    "Summary",
    "Trajectory",
    "Truth",
    "Verdict",
    "Verified",
    "__version__",
    "compare",
    "excite",
    "explain",
    "export",
    "generate",
    "identify",
    "inspect",
    "read_log",
    "simulate",
    "summarize",
    "verify",
    "virtual_effects",
    "virtual_session",
]
