"""The metrics of one valve, from its registers: a pure function. Names and units as Prometheus has them.

Counts of the daemon start anew with it and wrap at 2^32, which Prometheus takes for a restart. Codes are one series for
each value, 1 for the one that holds. The histogram is of |T_k - T|, T_k being the time from the start of one cycle to
the next's and T the period that the daemon's file asks for.
"""

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from config.codes import Mode, Quality
from config.registers import JITTER_BOUNDS_S, REQUESTERS
from northbound.observer.register_words import CODES, NORMAL_95

Labels = tuple[tuple[str, str], ...]


class Gauge(NamedTuple):
    """A value that goes up and down; a counter if `counts`."""

    name: str
    text: str
    value: float
    labels: Labels = ()
    counts: bool = False


class Histogram(NamedTuple):
    """Counts up to each bound, and the sum of all."""

    name: str
    text: str
    buckets: tuple[tuple[float, float], ...]
    total: float


NUMBERS = {
    "cycle_period_seconds": ("period", "median of the last periods of the loop"),
    "cycle_duration_seconds": ("cycle_time", "median time that a cycle took, bus included"),
    "sample_age_seconds": ("sample_age", "time since the last good measurement"),
    "reference_ratio": ("reference_in_force", "what the law follows, of the stroke"),
    "command_pascals": ("command", "pressure command"),
    "delta_reference_ratio": ("delta_r", "last change of the reference, of the stroke"),
    "friction_pascals": ("friction", "Coulomb friction F_c / A as the law uses it"),
    "friction_baseline_pascals": ("friction_baseline", "what it was when it was called normal"),
    "stiction_index_ratio": ("stiction_index", "part of the last moves that the stem did not make"),
}
"""Of a register each."""
MEASURED = {
    "position_ratio": ("position", "stem position, of the stroke; NaN while there is no good measurement"),
    "pressure_pascals": ("pressure", "actuator pressure as measured; NaN while there is no good measurement"),
}
COUNTS = {
    "cycles": ("cycles", "cycles run"),
    "missed_periods": ("missed_periods", "periods in which no cycle ran"),
    "travel_strokes": ("travel", "travel accumulated, in strokes"),
    "reversals": ("reversals", "how often the stem turned round"),
    "identifications": ("identifications", "identifications applied"),
    "refused_identifications": ("refusals", "identifications refused"),
    "events": ("event_number", "events of the valve's history"),
}
LOST = {
    "samples": "lost_samples",
    "replies": "lost_replies",
    "unrecorded": "unrecorded",
    "history": "history_lost",
}
"""What is lost, by its kind."""
STATES = ("state", "mode", "service", "fault", "quality", "ne107", "ne107_cause")
SPACE = "positioner"


def metrics(values: Mapping[str, float]) -> Iterator[Gauge | Histogram]:
    """Yield the metrics of a valve whose registers were all read."""
    for name, (register, text) in NUMBERS.items():
        yield Gauge(f"{SPACE}_{name}", text, values[register])
    good = values["quality"] == Quality.GOOD
    for name, (register, text) in MEASURED.items():
        yield Gauge(f"{SPACE}_{name}", text, values[register] if good else math.nan)
    for name, (register, text) in COUNTS.items():
        yield Gauge(f"{SPACE}_{name}", text, values[register], counts=True)
    for kind, register in LOST.items():
        yield Gauge(f"{SPACE}_lost", "what was lost, by kind", values[register], (("kind", kind),), counts=True)
    for who in REQUESTERS:
        text = "requests to the daemon's port, of all its valves, by who asked"
        yield Gauge(f"{SPACE}_requests", text, values[f"requests_{who}"], (("peer", who),), counts=True)
    for state in STATES:
        yield from _states(state, values[state])
    yield Gauge(f"{SPACE}_automatic", "1 in automatic", float(values["mode"] == Mode.AUTOMATIC))
    for bound, value in zip(("low", "high"), friction_interval_pa(values), strict=True):
        text = "95 % interval of the newest valid estimate of the friction"
        yield Gauge(f"{SPACE}_friction_interval_pascals", text, value, (("bound", bound),))
    yield _jitter(values)


def friction_interval_pa(values: Mapping[str, float]) -> tuple[float, float]:
    """Return the 95 % interval of F_c / A, Pa: of k/c, else of the static law's two directions; NaN without either.

    >>> friction_interval_pa({"k_over_c_valid": 1, "k_over_c_e": -20e3, "k_over_c_std": 100.0})
    (19804.0, 20196.0)
    """
    if values["k_over_c_valid"]:
        value, std = -values["k_over_c_e"], values["k_over_c_std"]
    elif values["static_up_valid"] and values["static_down_valid"]:
        value = (values["static_up_e"] + values["static_down_e"]) / 2
        std = math.hypot(values["static_up_std"], values["static_down_std"]) / 2
    else:
        return math.nan, math.nan
    return value - NORMAL_95 * std, value + NORMAL_95 * std


def _states(register: str, value: float) -> Iterator[Gauge]:
    text = f"1 for the {register.replace('_', ' ')} that holds"
    for each in CODES[register]:
        label = each.name.lower()
        yield Gauge(f"{SPACE}_{register}", text, float(value == each), ((register, label),))


def _jitter(values: Mapping[str, float]) -> Histogram:
    buckets = tuple((bound_s, values[f"jitter_within_{name}"]) for name, bound_s in JITTER_BOUNDS_S.items())
    text = "how far the loop's periods were from the one asked for"
    return Histogram(f"{SPACE}_cycle_jitter_seconds", text, buckets, 1e-6 * values["jitter_sum"])
