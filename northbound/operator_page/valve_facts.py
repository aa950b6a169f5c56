"""What the page says of a valve, a line each: label, text, and what is to be stressed. Pure: no browser, no clock."""

import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from config.codes import Fault, Ne107Status
from config.registers import BY_NAME
from northbound.observer.register_words import (
    EstimateInWords,
    device_status,
    estimates_in_words,
    in_words,
    ne107_causes,
)
from northbound.observer.valve_events import Happened
from northbound.observer.valve_view import ValvePicture
from northbound.observer.waiting_reference import waiting_reference
from webpage.units import NO_NUMBER, Unit, Units


@dataclass(frozen=True, slots=True)
class Fact:
    """A line: what, and its value in words; `help` is what the register table says of it."""

    label: str
    text: str
    help: str = ""


NE107_LETTER = {
    Ne107Status.GOOD: "",
    Ne107Status.MAINTENANCE_REQUIRED: "M",
    Ne107Status.OUT_OF_SPECIFICATION: "S",
    Ne107Status.FUNCTION_CHECK: "C",
    Ne107Status.FAILURE: "F",
}


def figures(picture: ValvePicture, stroke_m: float, units: Units) -> dict[str, str]:
    """Return the figures that are read from afar, by register; a measurement that is old is none."""
    position, pressure = units.position_unit(stroke_m, turns=picture.turns), units.pressure
    measured = picture.value if picture.freshness.measured_live else (lambda _: math.nan)
    return {
        "reference": position.text(picture.value("reference_in_force") * stroke_m),
        "position": position.text(measured("position_m")),
        "pressure": pressure.text(measured("pressure")),
        "command": pressure.text(picture.value("command")),
    }


def waiting(picture: ValvePicture, stroke_m: float, units: Units) -> str:
    """Say which reference waits; empty where none does."""
    reference_pu = waiting_reference(picture.values)
    if reference_pu is None:
        return ""
    unit = units.position_unit(stroke_m, turns=picture.turns)
    return f"waits: {unit.text(reference_pu * stroke_m)}, followed in automatic"


def status(picture: ValvePicture) -> list[Fact]:
    """Return in words what is said in no tile: mode, state and fault are."""
    return [
        Fact("service", picture.text("service"), BY_NAME["service"].text),
        Fact("law", picture.text("why"), BY_NAME["why"].text),
        Fact("measurement", picture.freshness.measurement or picture.text("quality"), BY_NAME["quality"].text),
        Fact(
            "device",
            device_status(picture.value("device_status"), picture.value("fault")),
            BY_NAME["device_status"].text,
        ),
        *_emergency(picture.value("emergency")),
        Fact("kept from before the restart", picture.text("restored"), BY_NAME["restored"].text),
        Fact("experiment", picture.text("experiment_state"), BY_NAME["experiment_state"].text),
    ]


def is_faulty(picture: ValvePicture) -> bool:
    """Return whether a fault is latched."""
    return picture.value("fault") != Fault.NONE


def condition(picture: ValvePicture) -> tuple[str, str, list[str]]:
    """Return the NE 107 status, a letter (empty: good) and words, and all its causes, the deciding one first."""
    number = picture.value("ne107")
    known = math.isfinite(number) and int(number) in {int(each) for each in Ne107Status}
    letter = NE107_LETTER[Ne107Status(int(number))] if known else "?"
    causes = ne107_causes(picture.value("ne107_causes"), picture.value("ne107_causes_high"))
    decides = picture.text("ne107_cause")
    return letter, picture.text("ne107"), sorted(causes, key=lambda each: each != decides)


def cycle(picture: ValvePicture) -> list[Fact]:
    """Return how the daemon's loop goes."""
    milli = Unit("ms", 1e3, 3)
    age_s = picture.value("sample_age") if picture.freshness.live else math.nan
    times = [("period", "period"), ("jitter, 99 %", "jitter_99"), ("time of a cycle", "cycle_time")]
    counts = [
        ("cycles", "cycles"),
        ("missed periods", "missed_periods"),
        ("samples that no cycle used", "lost_samples"),
        ("lost replies", "lost_replies"),
        ("samples not recorded", "unrecorded"),
    ]
    return [
        *(Fact(label, milli.text(picture.value(name)), BY_NAME[name].text) for label, name in times),
        Fact("age of the sample", Unit("s", 1.0, 3).text(age_s), BY_NAME["sample_age"].text),
        *(Fact(label, _count(picture.value(name)), BY_NAME[name].text) for label, name in counts),
        Fact("restarts of the daemon", f"{picture.restarts} since this page was opened"),
    ]


def wear(picture: ValvePicture, units: Units) -> list[Fact]:
    """Return friction against its baseline, and what is counted of wear."""
    ratio = picture.value("friction_ratio")
    return [
        Fact("friction", units.pressure.text(picture.value("friction")), BY_NAME["friction"].text),
        Fact("baseline", units.pressure.text(picture.value("friction_baseline")), BY_NAME["friction_baseline"].text),
        Fact("friction / baseline", _figure(ratio), BY_NAME["friction_ratio"].text),
        Fact("stiction index", _figure(picture.value("stiction_index")), BY_NAME["stiction_index"].text),
        Fact("moves judged", _count(picture.value("moves_judged")), BY_NAME["moves_judged"].text),
        Fact("travel", f"{_figure(picture.value('travel'))} strokes", BY_NAME["travel"].text),
        Fact("reversals", _count(picture.value("reversals")), BY_NAME["reversals"].text),
    ]


def estimates(picture: ValvePicture, stroke_m: float, units: Units) -> list[Fact]:
    """Return estimates with 95 % intervals, pressures first, then the rest; what is refused last, a reason once."""
    read = list(estimates_in_words(picture.values))
    valid = sorted((each for each in read if each.valid), key=lambda each: not each.unit.startswith("Pa"))
    refused: dict[str, list[str]] = {}
    for each in read:
        if not each.valid:
            refused.setdefault(each.refusal, []).append(each.name)
    return [
        *(Fact(each.name, _interval(each, stroke_m, units), each.text) for each in valid),
        *(Fact(f"refused: {', '.join(names)}", why) for why, names in refused.items()),
    ]


def list_events(lines: Iterable[Happened]) -> Iterator[str]:
    """Yield a line an event: when, by this machine's clock and zone, what, and its NE 107 class unless that is good."""
    for line in lines:
        when = time.strftime("%Y-%m-%d %H:%M:%S %Z", time.localtime(line.time_s))
        yield f"{when} {line.text}" + (f" ({line.ne107})" if line.ne107 else "")


def _interval(each: EstimateInWords, stroke_m: float, units: Units) -> str:
    factor, unit = 1.0, "" if each.unit == "1" else each.unit
    if unit == "Pa":
        factor, unit = units.pressure.per_si, units.pressure.name
    elif unit == "Pa/m" and math.isfinite(stroke_m):
        factor, unit = units.pressure.per_si * stroke_m, f"{units.pressure.name} over the stroke"
    return f"{factor * each.value:.4g} ± {factor * each.half_width:.2g} {unit}".rstrip()


def _emergency(code: float) -> Iterator[Fact]:
    """Yield what a CANopen node reports: of a device on another bus, and of a healthy one, nothing."""
    if code > 0:
        yield Fact("CANopen's emergency", in_words("emergency", code, {}), BY_NAME["emergency"].text)


def _count(value: float) -> str:
    return f"{int(value):,}".replace(",", " ") if math.isfinite(value) else NO_NUMBER


def _figure(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else NO_NUMBER
