"""What the error code of an emergency (EMCY) means, by CiA 301, 7.2.7."""

COMMAND_OUT_OF_RANGE = 0x6320  # of a set point that the node does not take
EMERGENCIES = {
    0x1000: "generic error",
    0x2000: "current",
    0x3000: "voltage",
    0x4000: "temperature",
    0x5000: "device hardware",
    0x6000: "device software",
    0x6300: "data set",
    COMMAND_OUT_OF_RANGE: "a parameter is out of its range",
    0x7000: "additional modules",
    0x8000: "monitoring",
    0x8100: "communication",
    0x8110: "CAN overrun, frames were lost",
    0x8120: "CAN in error passive mode",
    0x8130: "life guard or heartbeat error",
    0x8140: "recovered from bus off",
    0x8150: "collision of CAN identifiers",
    0x8200: "protocol error",
    0x8210: "PDO not processed due to its length",
    0x8220: "PDO longer than mapped",
    0x8240: "unexpected length of SYNC",
    0x8250: "no RPDO within the communication time-out",
    0x9000: "external error",
    0xF000: "additional functions",
    0xFF00: "specific to the device",
}
"""Error codes; a class ends in 00 or 000."""
OF_THE_DEVICE = (0x2000, 0x3000, 0x5000, 0x6000, 0x7000)
"""Classes by their first digit."""
OF_A_PARAMETER = 0x6300  # a class of the software whose device measures and obeys all the same


def cause_of(code: int) -> str:
    """Return what an emergency's error code means.

    >>> cause_of(0x2310), cause_of(0x0300)
    ('current', 'not in CiA 301')
    """
    classes = (code, code & 0xFF00, code & 0xF000)
    return next((EMERGENCIES[each] for each in classes if each in EMERGENCIES), "not in CiA 301")


def is_of_the_device(code: int) -> bool:
    """Return whether an emergency is of what measures and obeys."""
    return code & 0xF000 in OF_THE_DEVICE and code & 0xFF00 != OF_A_PARAMETER
