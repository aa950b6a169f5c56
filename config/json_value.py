"""Results as JSON has them, which knows no NaN and no infinity: of what is no finite number there is nothing to say."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from math import isfinite
from typing import Any

import numpy as np


def json_value(value: Any) -> Any:
    """Return what JSON can say of a value: arrays as lists, results as objects, null for what is no finite number.

    A field whose key in JSON is another than its name says so in its metadata. What else JSON does not know stays.
    """
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(name): json_value(each) for name, each in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return {each.metadata.get("json", each.name): json_value(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, np.ndarray):
        return json_value(value.tolist())
    if isinstance(value, tuple | list):
        return [json_value(each) for each in value]
    return value
