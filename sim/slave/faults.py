"""What goes wrong with a simulated device, by its file: it drops, freezes, jumps, restarts (tables `[[fault]]`).

A fault is in force from the first sample at or after `at_s` to the last before `at_s + over_s`, both in the time since
the device was switched on, which a restart does not set back.
"""

from collections.abc import Sequence
from typing import NamedTuple

from config.slave_file import DeviceFault


class FaultsInForce(NamedTuple):
    """What is wrong at a sample: nothing answered, measurements standing still, begun anew, position off by so much."""

    drops: bool
    freezes: bool
    restarts: bool
    jump_m: float


NONE = FaultsInForce(False, False, False, 0.0)


class Faults:
    """The faults of a slave file."""

    def __init__(self, faults: Sequence[DeviceFault]) -> None:
        self._faults = tuple(faults)

    def at(self, now_s: float, before_s: float) -> FaultsInForce:
        """Return what is wrong at a sample, its time and that of the sample before given, s."""
        if not self._faults:
            return NONE
        in_force = [each for each in self._faults if each.at_s <= now_s < each.at_s + each.over_s]
        kinds = {each.kind for each in in_force}
        restarts = any(each.kind == "restart" and before_s < each.at_s <= now_s for each in self._faults)
        return FaultsInForce("drop" in kinds, "freeze" in kinds, restarts, sum(each.by_m for each in in_force))
