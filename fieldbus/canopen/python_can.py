"""python-can without its readers of log files.

These load asammdf where `positioner[mdf]` is installed, and with it pandas and sympy: two seconds of a processor before
a slave or a daemon on CANopen says anything, for what a bus never asks.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def _left_out(module: str) -> Iterator[None]:
    """Let a module count as not installed meanwhile, unless it is loaded already."""
    if module in sys.modules:
        yield
        return
    sys.modules[module] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules[module]


with _left_out("asammdf"):
    import can

__all__ = ["can"]
