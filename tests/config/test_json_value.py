"""What is written as JSON holds no NaN, however deep it lies."""

import json
from dataclasses import dataclass, field
from math import inf, nan

import numpy as np

from config.json_value import json_value


@dataclass(frozen=True)
class Interval:
    lower_m: float
    upper_m: float = field(metadata={"json": "most_m"})


def test_what_is_no_finite_number_is_null() -> None:
    result = {"open": Interval(0.5, inf), "error_m": np.array([[1.0, nan]]), "times_s": (np.float64(nan), 2), 3: "kept"}
    assert json.loads(json.dumps(json_value(result), allow_nan=False)) == {
        "open": {"lower_m": 0.5, "most_m": None},
        "error_m": [[1.0, None]],
        "times_s": [None, 2],
        "3": "kept",
    }
