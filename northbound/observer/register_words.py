"""What a valve's registers say, in words: the texts of `config.codes`, never others."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from config.codes import EventKind, Fault, cause_text
from config.quantities import DeviceStatus
from config.registers import BY_NAME, ESTIMATED, REGISTERS, STATISTICS
from fieldbus.canopen.emergencies import cause_of

CODES = {register.name: register.codes for register in REGISTERS if register.codes is not None}
"""The code that each register of one serves."""

CAUSE_BITS = {"ne107_causes": 0, "ne107_causes_high": 16} | dict.fromkeys(
    ("alarms_active", "alarms_unacknowledged", "alarms_shelved"), 0
)
"""Registers whose bit n - 1 is a cause of `ne107_cause`: n less the cause."""
COUNTED = {register.name: register.text for register in STATISTICS if register.type == "uint32"}
"""What each count is of."""
SWITCHES = {"eta_": ("on", "off"), "_valid": ("not valid", "valid")}
"""What 0 and 1 mean, of registers by a part of their name."""

IDENTIFIED = (*ESTIMATED, "breakaway", "static_slope", "static_up", "static_down")
"""All that has a value, a standard deviation and a reason."""

NORMAL_95 = 1.96
"""Standard deviations on either side of 95 % of a normal distribution."""


@dataclass(frozen=True, slots=True)
class EstimateInWords:
    """An estimate with the half width of its 95 % interval, in its unit; NaN and the reason where it is refused."""

    name: str
    text: str
    unit: str
    value: float
    half_width: float
    refusal: str

    @property
    def valid(self) -> bool:
        """Whether it may be used."""
        return not self.refusal


def code_text(register: str, value: float) -> str:
    """Return what a register of a code says; of a number that this version does not know, the number.

    >>> code_text("mode", 2), code_text("fault", 99), code_text("why", math.nan)
    ('automatic', 'code 99, which this version does not know', 'unknown')
    """
    if not math.isfinite(value):
        return "unknown"
    try:
        return CODES[register](int(value)).text
    except ValueError:
        return f"code {int(value)}, which this version does not know"


def ne107_causes(low: float, high: float = 0) -> list[str]:
    """Return all causes behind an NE 107 status, of both registers.

    >>> ne107_causes(0b100000010, 1)
    ['not automatic', 'friction low: packing leaks', 'cycles or replies too slow']
    """
    number = sum(int(bits) << shift for bits, shift in ((low, 0), (high, 16)) if math.isfinite(bits))
    return [code_text("ne107_cause", bit + 1) for bit in range(number.bit_length()) if number >> bit & 1]


def device_status(word: float, fault: float = Fault.NONE) -> str:
    """Return what the device says of itself, beside the fault by which it said otherwise, or nothing, before.

    >>> device_status(0), device_status(6)
    ('healthy', 'sensor fault, not ready')
    >>> device_status(0, Fault.DEVICE)
    'healthy again; its fault is latched until it is acknowledged'
    >>> device_status(0, Fault.NO_REPLY)
    'healthy when it last answered'
    """
    number = int(word) if math.isfinite(word) else 0
    said = [(each.name or "").lower().replace("_", " ") for each in DeviceStatus if number & each]
    if not said and fault in (Fault.DEVICE, Fault.COMMUNICATION_LOST):
        return "healthy again; its fault is latched until it is acknowledged"
    if not said and fault == Fault.NO_REPLY:
        return "healthy when it last answered"
    return ", ".join(said) or "healthy"


def in_words(register: str, value: float, values: Mapping[str, float]) -> str:
    """Return what a register's number means, among others read with it; empty of a measured value.

    >>> in_words("mode", 2, {}), in_words("b_reason", 0, {}), in_words("position", 0.5, {})
    ('automatic', 'valid', '')
    >>> in_words("lost_replies", 3, {})
    'transactions without a good answer'
    >>> in_words("emergency", 0x2310, {}), in_words("emergency", 0, {})
    ('0x2310: current', 'none')
    >>> in_words("eta_1", 0, {}), in_words("ne107_causes_high", 1, {}), in_words("event_cause", 2, {"event": 7})
    ('on', 'cycles or replies too slow', 'automatic')
    """
    if register in CODES:
        return code_text(register, value)
    if register in CAUSE_BITS:
        return ", ".join(ne107_causes(int(value) << CAUSE_BITS[register])) or "none"
    if register == "device_status":
        return device_status(value, values.get("fault", Fault.NONE))
    if register == "emergency":
        return f"0x{int(value):04X}: {cause_of(int(value))}" if value else "none"
    if register == "event_cause":
        kind = int(values.get("event", EventKind.NONE))
        return cause_text(EventKind(kind), int(value)) if kind in list(EventKind) else ""
    switch = next((words for part, words in SWITCHES.items() if part in register), ("", ""))
    return switch[bool(value)] or COUNTED.get(register, "")


def estimates_in_words(values: Mapping[str, float]) -> Iterator[EstimateInWords]:
    """Yield each estimate that was read, with its interval or why there is none."""
    for name in IDENTIFIED:
        register = BY_NAME[f"{name}_e"]
        if f"{name}_reason" not in values:
            continue
        valid = bool(values[f"{name}_valid"])
        refusal = "" if valid else code_text("refusal", values[f"{name}_reason"])
        value, std = (values[f"{name}_{what}"] if valid else math.nan for what in ("e", "std"))
        yield EstimateInWords(name, register.text, register.unit, value, NORMAL_95 * std, refusal)
