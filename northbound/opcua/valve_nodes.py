"""What the nodes of a valve are, and what each shows of what an observer knows: pure, without a server.

A node's name is its path under the valve; those of PA-DIM have PA-DIM's names. A value that is not of now, or that
nobody knows, is no value with the reason as its status: nothing old is passed on as new.
"""

import math
import re
from collections.abc import Iterator
from enum import Enum
from typing import NamedTuple

from config.registers import BY_NAME
from northbound.observer import ValvePicture
from northbound.observer.register_words import CODES, IDENTIFIED, code_text, estimates_in_words
from northbound.opcua.device_health import device_health

PERCENT = 100.0  # of a share
POSITION = "SignalSet.Position"
PRESSURE = "SignalSet.Pressure"
SIGNAL = f"{POSITION}.ControlSignal"
SETPOINT = f"{SIGNAL}.Setpoint"
PRESSURE_SIGNAL = f"{PRESSURE}.AnalogSignal"
HEALTH = "DeviceHealth"
IDENTIFICATION = "Identification"


def name_of(register: str) -> str:
    """Return what the node of a register is called.

    >>> name_of("reference_in_force")
    'ReferenceInForce'
    """
    return "".join(part.capitalize() for part in register.split("_"))


def _nodes_of(*registers: str) -> dict[str, str]:
    return {name_of(each): each for each in registers}


NUMBERS = {
    "Control": _nodes_of(
        "reference_in_force", "command", "sample_age", "missed_periods", "lost_samples", "lost_replies"
    )
    | {"CyclePeriod": "period", "IdentificationProgress": "progress"},
    "Wear": _nodes_of(
        "friction", "friction_baseline", "friction_ratio", "travel", "reversals", "stiction_index", "moves_judged"
    ),
}
"""By folder: a node's name and its register; SI units, shares of the stroke as p.u."""

STATES = _nodes_of("mode", "state", "service", "fault", "quality") | {"HealthCause": "ne107_cause", "Inhibit": "why"}
"""In folder `Status`: a node's name and the register of its code."""

ESTIMATES = {name: name_of(name) for name in IDENTIFIED}
"""In folder `Estimates`: a node's name by the estimate's; each has its deviation and why it is refused beside it."""


class Why(Enum):
    """Why a value is as it is; each is a status of OPC UA."""

    GOOD = "Good"
    NO_DAEMON = "BadNoCommunication"
    NO_MEASUREMENT = "BadNotConnected"
    NOT_KNOWN = "BadNoData"


class Shown(NamedTuple):
    """A node's value now; None with why not."""

    node: str
    value: float | int | str | None
    why: Why


def show_picture(picture: ValvePicture) -> Iterator[Shown]:
    """Yield what the nodes show of what is known of a valve."""
    for node, value, measured in _values(picture):
        if not picture.freshness.live:
            yield Shown(node, None, Why.NO_DAEMON)
        elif measured and not picture.freshness.measured_live:
            yield Shown(node, None, Why.NO_MEASUREMENT)
        elif value is None or (isinstance(value, float) and math.isnan(value)):
            yield Shown(node, None, Why.NOT_KNOWN)
        else:
            yield Shown(node, value, Why.GOOD)
    yield Shown("Status.Connection", picture.freshness.daemon or picture.freshness.measurement or "of now", Why.GOOD)


def show_refusals(picture: ValvePicture) -> Iterator[Shown]:
    """Yield why each estimate is refused; empty where it is valid."""
    for each in estimates_in_words(picture.values):
        live = picture.freshness.live
        said = Shown(f"Estimates.{ESTIMATES[each.name]}.Refusal", each.refusal, Why.GOOD)
        yield said if live else said._replace(value=None, why=Why.NO_DAEMON)


def _values(picture: ValvePicture) -> Iterator[tuple[str, float | int | None, bool]]:
    """Yield each node, its value, and whether it rests on the measurement."""
    health = device_health(picture.value("ne107"))
    yield HEALTH, None if health is None else int(health), False
    yield SIGNAL, PERCENT * picture.value("position"), True
    yield SETPOINT, PERCENT * picture.value("reference"), False
    yield PRESSURE_SIGNAL, picture.value("pressure"), True
    for folder, names in NUMBERS.items():
        for name, register in names.items():
            yield f"{folder}.{name}", picture.value(register), False
    for name, register in STATES.items():
        value = picture.value(register)
        yield f"Status.{name}", int(value) if math.isfinite(value) else None, False
    for name, node in ESTIMATES.items():
        valid = bool(picture.values.get(f"{name}_valid", 0))
        yield f"Estimates.{node}", picture.value(f"{name}_e") if valid else None, False
        deviation = picture.value(f"{name}_std") if valid else None
        yield f"Estimates.{node}.StandardDeviation", deviation, False


def state_texts(register: str) -> dict[int, str]:
    """Return what each number of a register of a code means."""
    return {int(each): code_text(register, each) for each in CODES[register]}


def unit_of(register: str, *, turns: bool) -> str:
    """Return a register's unit, `1` of a plain number; of a valve that turns, rad in place of m.

    >>> unit_of("b_over_c_e", turns=True), unit_of("missed_periods", turns=True)
    ('Pa/rad', '1')
    """
    unit = BY_NAME[register].unit
    return re.sub(r"\bm\b", "rad", unit) if turns else unit
