"""What goes wrong with a simulated device, by its file: it drops, freezes, jumps, drifts, restarts (`[[fault]]`).

A fault is in force from the first sample at or after `at_s` to the last before `at_s + over_s`, both in the time since
the device was switched on, which a restart does not set back.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from config.slave_file import DeviceFault


class FaultsInForce(NamedTuple):
    """What is wrong at a sample: nothing answered, measurements standing still, begun anew, position off by so much.

    `supply_pa` is the most that the supply gives.
    """

    drops: bool
    freezes: bool
    restarts: bool
    jump_m: float
    no_number: bool = False
    supply_pa: float = math.inf


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
        off_m = sum(each.by_m * _share(each, now_s) for each in in_force)
        supply_pa = min((each.to_pa for each in in_force if each.to_pa is not None), default=math.inf)
        return FaultsInForce("drop" in kinds, "freeze" in kinds, restarts, off_m, "nan" in kinds, supply_pa)


def _share(fault: DeviceFault, now_s: float) -> float:
    """Return how much of a fault there is: of a drift more and more."""
    return (now_s - fault.at_s) / fault.over_s if fault.kind == "drift" else 1.0
