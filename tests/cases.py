"""Cases of a parametrized test of which `make test` plays a few, and `make long` all others."""

from collections.abc import Sequence
from typing import Any

import pytest


def few_always(cases: Sequence[Any], few: int = 1) -> list[Any]:
    """Return cases as they are, those after the first few marked long."""
    rest = cases[few:]
    others = (pytest.param(*(each if isinstance(each, tuple) else (each,)), marks=pytest.mark.long) for each in rest)
    return [*cases[:few], *others]
