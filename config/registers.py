"""The supervisory register table, declared once: the server, `positioner map`, `get` and `set` all read it here.

Every register stands at the same address among holding and input registers, so FC3 and FC4 read the same. A value
of two words is sent most significant word first and is written whole or not at all. Addresses are counted from 0,
as on the wire; many tools print them from 1. `Register.writer` is the role that may write one.
"""

import math
from dataclasses import dataclass, replace
from difflib import get_close_matches
from itertools import chain
from typing import Literal

from config.codes import (
    Code,
    EndTrend,
    EventKind,
    ExperimentState,
    Fault,
    InhibitReason,
    Mode,
    Ne107Cause,
    Ne107Status,
    Quality,
    Refusal,
    Restored,
    Sampling,
    ServiceState,
    State,
    texts,
)
from config.errors import InputError
from config.quantities import DeviceStatus, list_bits
from config.register_format import Format, WireType
from config.roles import Role

MAP_VERSION = 1  # grows where a register changes its meaning
WORD_TEST = 0xB38C  # by these three a client finds its order of bytes
LONG_TEST = 0x12345678  # each byte another
FLOAT_TEST = 1234.5  # exact in a float32
MOST_EXPERIMENT_POINTS = 200
"""Of an experiment."""


Codes = type[Code]


@dataclass(frozen=True, slots=True)
class Register:
    """One value of the table: `minimum` and `maximum` bound what may be written."""

    name: str
    address: int
    type: WireType
    unit: str
    text: str
    access: Literal["r", "rw"] = "r"
    minimum: float | None = None
    maximum: float | None = None
    writer: Role = Role.ENGINEER
    """Who may write it on a secured connection."""
    codes: Codes | None = None
    """What its numbers say."""

    @property
    def format(self) -> Format:
        """How the value lies in its registers."""
        return Format(self.type)

    @property
    def end(self) -> int:
        """The address just past the last register."""
        return self.address + self.format.words

    def problem_with(self, value: float) -> str | None:
        """Return why the value may not be written, or None when it may."""
        if self.access == "r":
            return f"{self.name}: is read-only"
        # Written so that NaN, for which no comparison holds, is outside.
        low = self.minimum is None or value >= self.minimum
        high = self.maximum is None or value <= self.maximum
        if not (low and high):
            unit = "" if self.unit == "1" else f" {self.unit}"
            return f"{self.name}: allowed is {self.minimum:g} to {self.maximum:g}{unit}, got {value:.9g}"
        if not self.format.holds(value):
            return f"{self.name}: allowed is a whole number, {self.minimum:g} to {self.maximum:g}, got {value}"
        return None


def _writable(
    name: str,
    address: int,
    type_: WireType,
    unit: str,
    low: float,
    high: float,
    text: str,
    writer: Role = Role.ENGINEER,
) -> Register:
    return Register(name, address, type_, unit, text, "rw", low, high, writer)


def _coded(name: str, address: int, codes: Codes, text: str = "") -> Register:
    """Return a register that serves a code; its text ends with what each number says."""
    return Register(name, address, "uint16", "1", f"{text}: {texts(codes)}" if text else texts(codes), codes=codes)


def _operable(name: str, address: int, type_: WireType, unit: str, low: float, high: float, text: str) -> Register:
    """Return a register that operators write, too."""
    return _writable(name, address, type_, unit, low, high, text, Role.OPERATOR)


_LARGEST_PA = 2e6

COMMANDS = (
    _operable(
        "reference", 0, "float32", "p.u.", 0.0, 1.0, "opening asked for, or the signal that [travel] makes one of"
    ),
    _operable("reference_scaled", 2, "uint16", "1e-4 p.u.", 0, 10000, "reference as a whole number"),
    replace(_writable("mode", 3, "uint16", "1", 0, 2, f"{texts(Mode)}; falls to hold on a fault"), codes=Mode),
    _writable("eta_1", 4, "uint16", "1", 0, 1, "0 switches the excitation on (state S3); the DCS ends it: 1"),
    _writable("eta_2", 5, "uint16", "1", 0, 1, "0 switches the parameter identifier on"),
    _writable("eta_3", 6, "uint16", "1", 0, 1, "0 switches the friction estimator on"),
    _operable("acknowledge", 7, "uint16", "1", 0, 1, "write 1: acknowledges a fault whose cause is gone; reads 0"),
    _operable("heartbeat", 8, "uint16", "1", 0, 65535, "the DCS writes it to show that it lives"),
    _writable("manual_pressure", 9, "float32", "Pa", 0.0, _LARGEST_PA, "the command in manual mode"),
    _writable("alpha", 11, "float32", "Pa", 0.0, _LARGEST_PA, "excitation, constant; 0: what keeps the stem"),
    _writable("beta", 13, "float32", "Pa", 0.0, _LARGEST_PA, "excitation, amplitude of the sine"),
    _writable("omega", 15, "float32", "rad/s", 1e-3, 1e3, "excitation, angular frequency"),
)

STATUS = (
    _coded("state", 100, State),
    _coded("fault", 101, Fault),
    _coded("quality", 102, Quality, "of the last measurement"),
    _coded("why", 103, InhibitReason, "why not as asked"),
    Register("position", 104, "float32", "p.u.", "opening, from the closed end"),
    Register("position_scaled", 106, "int16", "1e-4 p.u.", "position as a whole number"),
    Register("device_status", 107, "uint16", "1", f"the device's own status word, bits: {list_bits(DeviceStatus)}"),
    Register("position_m", 108, "float32", "m", "position times the stroke; NaN: the valve turns"),
    Register("pressure", 110, "float32", "Pa", "actuator pressure as measured"),
    Register("command", 112, "float32", "Pa", "pressure command"),
    Register("delta_r", 114, "float32", "p.u.", "last change of the reference, kept until the next"),
    Register("sample_age", 116, "float32", "s", "time since the last good measurement"),
    Register("reference_in_force", 118, "float32", "p.u.", "what the law follows; while it follows none, the stem"),
    Register("position_deg", 134, "float32", "deg", "position of a valve that turns; NaN: it has a stem"),
    _coded("restored", 122, Restored, "what was known before the daemon was started"),
    Register("emergency", 124, "uint16", "1", "CANopen: error code of the device's last EMCY, 0 when it is over"),
    _coded("service", 125, ServiceState, "what the service does"),
    Register("locked_out", 126, "uint16", "1", "1: the local switch locks out all writes but the heartbeat"),
    Register(
        "reference_opening", 128, "float32", "p.u.", "opening that the reference asks for: split range, characteristic"
    ),
    Register("position_signal", 130, "float32", "p.u.", "reference that would ask for the present position"),
    Register("dead_band", 132, "float32", "p.u.", "error at rest that is left alone, as in force"),
    Register("restored_agreed", 123, "uint16", "1", "landings since then that agree with it"),
)

ESTIMATED = {
    "a": "1/s",
    "b": "1/s^2",
    "c": "m/(Pa s^2)",
    "k": "m/s^2",
    "b_over_c": "Pa/m",
    "k_over_c": "Pa",
}
"""What is identified, in register order, and in which unit."""

TURNED = "; rad for m where it turns"
"""Of a register whose unit has a metre."""


def _estimate_registers_of(name: str, base: int, unit: str, text: str) -> tuple[Register, ...]:
    where = TURNED if unit in ("m/s^2", "m/(Pa s^2)", "Pa/m") else ""
    return (
        Register(f"{name}_e", base, "float32", unit, text + where),
        Register(f"{name}_std", base + 2, "float32", unit, f"standard deviation of {name}_e{where}"),
        Register(f"{name}_valid", base + 4, "uint16", "1", "1 when the estimate may be used"),
        replace(_coded(f"{name}_reason", base + 5, Refusal), text="0 valid, else why not (positioner map --reasons)"),
    )


def _estimate_registers() -> tuple[Register, ...]:
    numbered = enumerate(ESTIMATED.items())
    each = (_estimate_registers_of(name, 200 + 6 * i, unit, f"{name}, estimated") for i, (name, unit) in numbered)
    return tuple(chain.from_iterable(each))


ESTIMATES = (
    *_estimate_registers(),
    Register(
        "progress", 240, "float32", "1", "of the identification window, 0 to 1; at 1 the DCS may end S3 (eta_1 = 1)"
    ),
    Register("estimate_age", 242, "float32", "s", "time since the last sample the estimates used"),
    Register("b_over_c_applied", 244, "float32", "Pa/m", f"b/c as the law uses it; NaN: none yet{TURNED}"),
    Register("k_over_c_applied", 246, "float32", "Pa", "k/c as the law uses it; NaN: none yet"),
    Register("identifications", 248, "uint16", "1", "how many identifications were applied, wraps"),
    Register("refusals", 249, "uint16", "1", "how many were refused, wraps"),
    replace(_coded("refusal", 250, Refusal), text="why the last one was refused, as in *_reason; 0: it was applied"),
    *_estimate_registers_of("breakaway", 252, "Pa", "static friction F_s / A, from where the stem broke away"),
    *_estimate_registers_of("static_slope", 260, "Pa/m", "k_s / A of the static law, from landings"),
    *_estimate_registers_of("static_up", 266, "Pa", "friction and preload after a slide up, (F_c + F_0) / A"),
    *_estimate_registers_of("static_down", 272, "Pa", "friction less preload after a slide down, (F_c - F_0) / A"),
    Register("landings", 278, "uint16", "1", "slides that ended in rest, which the static law is taken from"),
    Register("static_residual", 280, "float32", "p.u.", "how far landings lie off the static law, standard deviation"),
    Register("offset_applied", 282, "float32", "Pa", "(up - down) / 2 as the law uses it; 0 in the seed's model"),
    _coded("sampling", 284, Sampling, "[device] sampling, as the last excitation found it"),
)

JITTER_BOUNDS_S = {
    "10us": 10e-6,
    "20us": 20e-6,
    "50us": 50e-6,
    "100us": 100e-6,
    "200us": 200e-6,
    "500us": 500e-6,
    "1ms": 1e-3,
    "2ms": 2e-3,
    "5ms": 5e-3,
    "10ms": 10e-3,
    "any": math.inf,
}
"""Of the histogram of how far a period was from the one of the daemon's file: registers `jitter_within_*`."""

REQUESTERS = ("plain", "observer", "operator", "engineer", "refused")
"""Whose requests are counted: in the clear, of a role, and what a role may not."""


def _histogram() -> tuple[Register, ...]:
    of = "periods, in real time, that differed from [cycle] period_s"
    return tuple(
        Register(
            f"jitter_within_{name}", 320 + 2 * i, "uint32", "1", f"{of}{f' by {name} at the most' * (name != 'any')}"
        )
        for i, name in enumerate(JITTER_BOUNDS_S)
    )


def _requests() -> tuple[Register, ...]:
    texts = ("in the clear", "of observers", "of operators", "of engineers", "that a role may not make, refused")
    return tuple(
        Register(f"requests_{name}", 344 + 2 * i, "uint32", "1", f"requests to this port {text}")
        for i, (name, text) in enumerate(zip(REQUESTERS, texts, strict=True))
    )


STATISTICS = (
    Register("cycles", 300, "uint32", "1", "cycles run, wraps"),
    Register("missed_periods", 302, "uint32", "1", "periods in which no cycle ran"),
    Register(
        "lost_samples",
        304,
        "uint32",
        "1",
        "samples of the device that no cycle looked at, for it samples faster or replies were lost",
    ),
    Register("lost_replies", 306, "uint32", "1", "transactions without a good answer"),
    Register("period", 308, "float32", "s", "median of the last cycles' periods"),
    Register("jitter_99", 310, "float32", "s", "99 % of the last periods differ from the median by less than this"),
    Register("cycle_time", 312, "float32", "s", "median time a cycle took, bus included"),
    Register("unrecorded", 314, "uint32", "1", "samples the recorder could not write"),
    Register("jitter_sum", 316, "uint64", "1e-6 s", "sum of how far periods differed from [cycle] period_s"),
    *_histogram(),
    *_requests(),
)

IDENTITY = (
    Register("map_version", 400, "uint16", "1", f"version of this map: {MAP_VERSION}"),
    Register("version_major", 401, "uint16", "1", "version of the software"),
    Register("version_minor", 402, "uint16", "1", "version of the software"),
    Register("version_patch", 403, "uint16", "1", "version of the software"),
    Register("word_test", 404, "uint16", "1", f"constant 0x{WORD_TEST:04X}"),
    Register("long_test", 406, "uint32", "1", f"constant 0x{LONG_TEST:08X}: tells the word order"),
    Register("float_test", 408, "float32", "1", f"constant {FLOAT_TEST:g}: tells the word order"),
)

HEALTH = (
    _writable(
        "health_baseline", 500, "uint16", "1", 0, 1, "write 1: the friction now is the baseline from now on; reads 0"
    ),
    _writable(
        "health_reset", 501, "uint16", "1", 0, 1, "write 1: travel, reversals and stiction index start anew; reads 0"
    ),
    _coded("ne107", 502, Ne107Status, "NAMUR NE 107"),
    _coded("ne107_cause", 503, Ne107Cause, "what decides ne107"),
    Register("ne107_causes", 504, "uint16", "1", "causes that hold: bit n - 1 is cause n of ne107_cause, 1 to 16"),
    Register(
        "ne107_causes_high", 505, "uint16", "1", "causes that hold, from 17 up: bit n - 17 is cause n of ne107_cause"
    ),
    Register("friction", 506, "float32", "Pa", "Coulomb friction F_c / A as the law uses it; NaN: none yet"),
    Register("friction_baseline", 508, "float32", "Pa", "what it was when it was called normal; NaN: never"),
    Register("friction_ratio", 510, "float32", "1", "friction over its baseline; NaN: one is missing"),
    Register("travel", 512, "float32", "p.u.", "travel accumulated, in strokes"),
    Register("stem_cycles", 514, "uint32", "1", "full strokes up and down that the travel amounts to"),
    Register("reversals", 516, "uint32", "1", "how often the stem turned round"),
    Register("stiction_index", 518, "float32", "1", "part of the last moves asked for that the stem did not make"),
    Register("away_mean", 522, "float32", "p.u.", "reference in force less position, mean size today in automatic"),
    Register("saturated", 524, "float32", "1", "share of today for which the command is at a limit"),
    Register("course_deviation", 526, "float32", "p.u.", "how far the stem rests outside what is identified, today"),
    Register("pressure_short", 528, "float32", "1", "command less measured pressure today, of the span: a leak"),
    Register(
        "supply_short",
        530,
        "float32",
        "1",
        "pressure_short under commands in the upper fifth of what the travel needs: the supply",
    ),
    Register("end_closed", 532, "float32", "p.u.", "opening where the valve is pressed shut, mean of today"),
    _coded("end_trend", 534, EndTrend, "of end_closed over the last days"),
    Register("exhausted", 536, "float32", "1", "air let out today, in volumes of the actuator at atmospheric pressure"),
    Register("moves_judged", 520, "uint32", "1", "moves behind the stiction index"),
)

EXPERIMENT = (
    _writable(
        "experiment_consent",
        600,
        "uint16",
        "1",
        0,
        1,
        "1: tests may be commanded; 0 breaks one off",
    ),
    _operable("experiment_veto", 601, "uint16", "1", 0, 1, "1: no experiment and no S3; breaks one off"),
    _writable(
        "experiment_point", 602, "uint16", "1", 0, MOST_EXPERIMENT_POINTS - 1, "which point is written; 0 begins anew"
    ),
    _writable("experiment_time", 603, "float32", "s", 0.0, 1e5, "its time; written together with the point"),
    _writable("experiment_pressure", 605, "float32", "Pa", 0.0, _LARGEST_PA, "its pressure; the same"),
    _writable(
        "experiment_start", 607, "uint16", "1", 2, MOST_EXPERIMENT_POINTS, "write the number of points: plays them"
    ),
    Register("experiment_points", 608, "uint16", "1", "how many there are"),
    _coded("experiment_state", 609, ExperimentState),
    Register("experiment_elapsed", 610, "float32", "s", "time since its first point, while it is under way"),
    _writable("experiment_turn", 612, "float32", "p.u.", 0.0, 1.0, "travel at which it retraces its way; 0: never"),
    _writable("experiment_band", 614, "float32", "p.u.", 0.0, 1.0, "travel that breaks it off; 0: the window alone"),
)

EVENTS = (
    Register("event_number", 700, "uint32", "1", "how many events there were: the number of the newest"),
    _coded("event", 702, EventKind, "the newest"),
    _coded("event_class", 703, Ne107Status, "its class by NAMUR NE 107"),
    Register("event_cause", 704, "uint16", "1", "its cause, a number of the code that goes with it (docs/history.md)"),
    Register("event_time", 706, "uint32", "s", "when it happened, since 1970, UTC"),
    Register("history_lost", 708, "uint32", "1", "entries of the history that were lost since the start"),
)

_ALARM_BITS = "bit n - 1 is cause n of ne107_cause"

ALARMS = (
    _operable("alarm_acknowledge", 800, "uint16", "1", 1, 32, "write a cause (ne107_cause): its alarm is seen"),
    _operable("alarm_shelve", 801, "uint16", "1", 1, 32, "which alarm is put aside; written together with the time"),
    _operable("alarm_shelve_time", 802, "float32", "s", 0.0, 1e7, "for how long; 0: it is shown again"),
    Register("alarms_active", 804, "uint32", "1", f"alarms that hold and are not shelved: {_ALARM_BITS}"),
    Register("alarms_unacknowledged", 806, "uint32", "1", f"alarms that nobody has seen: {_ALARM_BITS}"),
    Register("alarms_shelved", 808, "uint32", "1", f"alarms put aside: {_ALARM_BITS}"),
    Register("alarms_shelved_until", 810, "uint32", "s", "when the first of them is shown again, since 1970; 0: none"),
)

REGISTERS = (*COMMANDS, *STATUS, *ESTIMATES, *STATISTICS, *IDENTITY, *HEALTH, *EXPERIMENT, *EVENTS, *ALARMS)

BY_NAME = {register.name: register for register in REGISTERS}

WRITER_AT = {
    address: register.writer
    for register in REGISTERS
    if register.access == "rw"
    for address in range(register.address, register.end)
}
"""Who may write each word that may be written."""

SIZE = max(register.end for register in REGISTERS)
"""Addresses from 0 to here (exclusive) may be read; those that hold nothing read 0."""


LISTED = "`positioner map` lists all"


def register_named(name: str) -> Register:
    """Return the register of that name.

    Raises:
        InputError: there is none; names those that are nearest.
    """
    if name in BY_NAME:
        return BY_NAME[name]
    if name.endswith(".toml"):
        raise InputError(name, "no register, but a file; the daemon's is given as --config FILE")
    near = [each for each in BY_NAME if name.lower() in each or each in name.lower()]
    near = near or get_close_matches(name.lower(), BY_NAME)
    raise InputError(name, f"no register of that name; {'near: ' + ', '.join(near) if near else LISTED}")
