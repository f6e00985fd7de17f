"""Arguments as the compiled part takes them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Dict, Optional, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from typing import Protocol

    class HasValues(Protocol):
        """A result that holds parameter values, such as ``Identified``."""

        @property
        def values(self) -> Dict[str, float]: ...


Array = NDArray[np.float64]
#: A file's path.
PathLike = Union[str, "os.PathLike[str]"]
#: Parameter values: a dict by name, a JSON file, an array in the order of the set, a result of ``identify``.
Values = Union[Mapping[str, float], PathLike, ArrayLike, "HasValues"]


def states(name: str, given: ArrayLike) -> Array:
    """A C-contiguous float64 array; ``name`` stands in errors."""
    try:
        return np.ascontiguousarray(np.asarray(given), dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be an array of numbers: {error}") from None


def named(values: Any) -> Optional[Tuple[Optional[str], Dict[str, float]]]:
    """Values as a file or by name; ``None`` where they are an array."""
    if isinstance(values, (str, os.PathLike)):
        return os.fspath(values), {}
    if not isinstance(values, Mapping) and hasattr(values, "values") and isinstance(values.values, Mapping):
        values = values.values
    if isinstance(values, Mapping):
        return None, {str(name): _number(name, value) for name, value in values.items()}
    return None


def _number(name: Any, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise ValueError(f"values must be finite numbers: '{name}' is {value!r}") from None
