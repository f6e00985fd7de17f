"""Models as text: what results, dicts and files hold."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Optional, Tuple, Union

from ._arrays import PathLike
from ._errors import InputError

if TYPE_CHECKING:
    from .explanation import Explained
    from .identification import Identified
    from .servos import IdentifiedServos

#: A torque model: a result of ``identify`` or ``explain``, its JSON file, or its dict.
Model = Union["Identified", "Explained", PathLike, Mapping[str, Any]]


def model_text(model: Union[Model, IdentifiedServos]) -> Tuple[str, str]:
    """The model as JSON, and the name that errors give it."""
    if isinstance(model, Mapping):
        return json.dumps(model), "the model"
    if isinstance(model, (str, os.PathLike)):
        path = os.fspath(model)
        try:
            with open(path, encoding="utf-8") as file:
                return file.read(), path
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"{path}: cannot be read: {error}") from None
    if hasattr(model, "model_json"):
        return model.model_json(), "the model"
    raise TypeError(f"model must be a result, a JSON file or a dict, not {type(model).__name__}")


def optional_model(model: Optional[Model]) -> Optional[Tuple[str, str]]:
    """As ``model_text``, where there may be no model."""
    return None if model is None else model_text(model)
