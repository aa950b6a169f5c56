"""What commands find in a clone of the project alone: its benchmarks, which the wheel leaves out."""

import importlib
from importlib.util import find_spec
from typing import Any

from config.errors import InputError


def benchmark(name: str, command: str) -> Any:
    """Return a module of the benchmarks, imported.

    Raises:
        InputError: the project is installed without its sources.
    """
    if find_spec("benchmarks") is None:
        raise InputError(
            command, f"runs in a clone of the project, where benchmarks/{name} is; the wheel has no benchmarks"
        )
    return importlib.import_module(f"benchmarks.{name}.__main__")
