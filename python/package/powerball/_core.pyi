"""The compiled part: plain values in and out. Use the package's own classes."""

from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple, Union, final

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]
_Limit = Optional[float]
_Limits = Tuple[Optional[List[float]], _Limit, _Limit, _Limit, _Limit]

__version__: str

__all__ = [
    "Arm",
    "ComparedSide",
    "Excited",
    "Explained",
    "Identified",
    "Summary",
    "Trajectory",
    "Written",
    "__version__",
    "compare",
    "description",
    "excite",
    "explain",
    "export_imported",
    "friction_row",
    "functions",
    "generate",
    "generate_model",
    "identify",
    "inspect",
    "read_log",
    "rule",
    "simulate",
    "simulate_function",
    "summarize",
    "verify",
    "virtual_effects",
    "virtual_session",
    "write_whole",
]

def functions() -> List[Tuple[str, List[str], str, str]]: ...

@final
class Arm:
    @staticmethod
    def parse(text: str, file: str, place: Optional[str]) -> Arm: ...
    @staticmethod
    def import_from(
        text: str,
        file: str,
        mjcf: bool,
        base: Optional[str],
        tip: Optional[str],
        lock: List[Tuple[str, float]],
        exact: bool,
        convention: str,
        angle_tolerance: float,
    ) -> Arm: ...
    @property
    def name(self) -> str: ...
    @property
    def dof(self) -> int: ...
    @property
    def joint_names(self) -> List[str]: ...
    @property
    def joint_kinds(self) -> List[str]: ...
    @property
    def limits(self) -> List[_Limits]: ...
    @property
    def gravity_vector(self) -> List[float]: ...
    @property
    def parameters(self) -> List[str]: ...
    @property
    def text(self) -> str: ...
    @property
    def notes(self) -> List[str]: ...
    @property
    def values(self) -> List[Tuple[str, float]]: ...
    @property
    def base(self) -> Optional[List[List[float]]]: ...
    @property
    def frames(self) -> List[str]: ...
    def at_frame(self, name: str) -> Arm: ...
    def describe(self) -> str: ...
    def sets(self) -> str: ...
    def set_values(self, set: str, file: Optional[str], named: Dict[str, float]) -> _Array: ...
    def check(
        self, file: Optional[str], named: Dict[str, float]
    ) -> Tuple[bool, List[str], List[float], float]: ...
    def evaluate(
        self, name: str, set: str, states: List[Tuple[str, _Array]], parameters: Optional[_Array]
    ) -> _Array: ...

_Tell = Optional[Callable[[str], object]]
_Text = Tuple[str, str]
_Masses = Tuple[Optional[str], Dict[str, float]]

@final
class Identified:
    def json(self) -> str: ...
    def covariance(self) -> str: ...
    def save(self, folder: str) -> None: ...
    def side(self, name: str) -> ComparedSide: ...

@final
class Summary:
    @staticmethod
    def from_bytes(bytes: bytes) -> Summary: ...
    def to_bytes(self) -> bytes: ...
    def arm(self) -> str: ...
    def logs(self) -> List[Tuple[str, float]]: ...
    def rows(self) -> List[int]: ...
    def warnings(self) -> List[str]: ...

@final
class Written:
    def json(self) -> str: ...
    def save(self, folder: str) -> None: ...

@final
class ComparedSide:
    @staticmethod
    def read(path: str) -> ComparedSide: ...

@final
class Explained:
    def json(self) -> str: ...
    def model_json(self) -> str: ...
    def trajectory(self) -> Optional[Trajectory]: ...
    def save(self, folder: str) -> None: ...

@final
class Trajectory:
    def arrays(self) -> Tuple[_Array, _Array, _Array, _Array]: ...
    def csv(self) -> str: ...

@final
class Excited:
    def json(self) -> str: ...
    def page(self) -> str: ...
    def trajectories(self) -> List[Trajectory]: ...

def identify(
    arm: Arm,
    log: Sequence[Any],
    validate: Sequence[Any],
    map: List[str],
    model: Optional[_Text],
    values: Optional[_Masses],
    friction: str,
    estimator: str,
    progress: _Tell,
) -> Union[Identified, Written]: ...
def friction_row(gamma2: float, gamma4: float, velocity: float) -> List[float]: ...
def verify(
    arm: Arm,
    model: _Text,
    log: Sequence[Any],
    map: List[str],
    tolerance: float,
    progress: _Tell,
) -> Written: ...
def summarize(arm: Arm, log: Sequence[Any], map: List[str], progress: _Tell) -> Summary: ...
def compare(a: ComparedSide, b: ComparedSide, level: float) -> Written: ...
def explain(
    arm: Arm,
    log: Sequence[Any],
    validate: Sequence[Any],
    map: List[str],
    model: Optional[_Text],
    values: Optional[_Masses],
    rule: str,
    progress: _Tell,
) -> Union[Explained, Written]: ...
def rule() -> str: ...
def read_log(
    arm: Arm, log: Any, map: List[str]
) -> Tuple[_Array, _Array, _Array, Optional[_Array], List[str]]: ...
def inspect(file: str, map: List[str], arm: Optional[Arm]) -> str: ...
def excite(arm: Arm, asked: Any, progress: _Tell) -> Excited: ...
def write_whole(path: Any, data: bytes) -> None: ...
def generate(
    arm: Arm,
    parameters: str,
    names: Optional[List[str]],
    values: Optional[_Array],
    friction: List[str],
    batch: bool,
    tests: bool,
    contract: bool,
) -> str: ...
def generate_model(
    arm: Arm, model: _Text, scalar: str, names: Optional[List[str]]
) -> Tuple[str, List[str]]: ...
def description(path: str) -> str: ...
def export_imported(
    arm: Arm, values: _Text, friction: Optional[_Text], uncertain: bool
) -> Tuple[str, List[str]]: ...
def simulate(
    arm: Arm,
    plant: _Text,
    model: _Text,
    controller: str,
    bandwidth: float,
    damping: float,
    period: float,
    path: Sequence[Any],
) -> List[_Array]: ...
def simulate_function(
    arm: Arm, plant: _Text, controller: Any, period: float, path: Sequence[Any]
) -> List[_Array]: ...
def virtual_effects() -> List[str]: ...
def virtual_session(
    folder: str, seed: int, effect: Optional[str], progress: _Tell
) -> Tuple[str, List[str], List[str], Tuple[str, List[int], str]]: ...
