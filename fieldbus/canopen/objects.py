"""What our CANopen device's words mean, and how one sample is put into PDOs.

What a device says of one sample travels in PDOs of at most 8 bytes, packed first fit, all sent by one SYNC.

Control and status words are those of CiA 408 (proportional valves), with three bits of each saying the same:

    bit 0 enabled, bit 1 hold left, bit 2 active; control bit 3: reset on its rising edge; status bit 3: no fault
"""

from collections.abc import Mapping
from enum import IntEnum, IntFlag

DEVICE_MODE = 0x6042  # object of CiA 408
PDO_BYTES = 8
MOST_PDOS = 4
"""By the predefined connection set, of each direction."""


class Control(IntFlag):
    """Bits of the control word."""

    ENABLE = 1
    LEAVE_HOLD = 2
    ACTIVATE = 4
    RESET = 8


ACTIVATE = Control.ENABLE | Control.LEAVE_HOLD | Control.ACTIVATE


class NodeState(IntEnum):
    """The low four bits of the status word. Only ACTIVE obeys a set point."""

    FAULT_DISABLED = 0b0001
    FAULT_HOLD = 0b0011
    INIT = 0b1000
    DISABLED = 0b1001
    HOLD = 0b1011
    ACTIVE = 0b1111


HOLDING = (NodeState.HOLD, NodeState.FAULT_HOLD)
"""States in which a node goes on with what it did, whatever its set point."""
STATE_BITS = 0b1111  # of the status word, CiA 408
NO_FAULT = 0b1000  # bit 3: no fault, CiA 408
LOCAL = 1 << 4
"""Of the status word: it is operated locally and ignores the bus."""


class DeviceMode(IntEnum):
    """Where the set point comes from."""

    BUS = 1
    LOCAL = 2


def inactive_because(status_word: int) -> str | None:
    """Return why a node is no actuator; None if it is one."""
    if status_word & LOCAL:
        return "it is operated locally"
    state = status_word & STATE_BITS
    if state == NodeState.ACTIVE:
        return None
    known = state in NodeState.__members__.values()
    return f"it is in state {NodeState(state).name}" if known else f"its status word {status_word:#06x} is no state"


def first_fit(sizes: Mapping[str, int]) -> list[list[str]]:
    """Return the names in PDOs, each put into the first with room for its bytes."""
    groups: list[list[str]] = []
    for name, size in sizes.items():
        for group in groups:
            if sum(sizes[each] for each in group) + size <= PDO_BYTES:
                group.append(name)
                break
        else:
            groups.append([name])
    return groups
