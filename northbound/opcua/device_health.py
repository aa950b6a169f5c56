"""NE 107 in the numbers of DI's DeviceHealthEnumeration (OPC 10000-100, 4.5.4).

Ours grow with how bad it is, DI's do not: maintenance is 1 here and 4 there, failure 4 here and 1 there.
"""

from enum import IntEnum

from config.codes import Ne107Status


class DeviceHealth(IntEnum):
    """DI's numbers."""

    NORMAL = 0
    FAILURE = 1
    CHECK_FUNCTION = 2
    OFF_SPEC = 3
    MAINTENANCE_REQUIRED = 4


OF_NE107 = {
    Ne107Status.GOOD: DeviceHealth.NORMAL,
    Ne107Status.MAINTENANCE_REQUIRED: DeviceHealth.MAINTENANCE_REQUIRED,
    Ne107Status.OUT_OF_SPECIFICATION: DeviceHealth.OFF_SPEC,
    Ne107Status.FUNCTION_CHECK: DeviceHealth.CHECK_FUNCTION,
    Ne107Status.FAILURE: DeviceHealth.FAILURE,
}

SEVERITY = {
    Ne107Status.GOOD: 100,
    Ne107Status.MAINTENANCE_REQUIRED: 300,
    Ne107Status.FUNCTION_CHECK: 400,
    Ne107Status.OUT_OF_SPECIFICATION: 600,
    Ne107Status.FAILURE: 900,
}
"""Of an event, 1 to 1000."""


def device_health(ne107: float) -> DeviceHealth | None:
    """Return DI's number for ours, None of one that is not known.

    >>> device_health(1), device_health(4), device_health(9)
    (<DeviceHealth.MAINTENANCE_REQUIRED: 4>, <DeviceHealth.FAILURE: 1>, None)
    """
    return OF_NE107[Ne107Status(int(ne107))] if ne107 in list(Ne107Status) else None
