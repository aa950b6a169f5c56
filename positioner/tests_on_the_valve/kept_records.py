"""Records of tests, kept in the valve's history: as found, as left, as the factory left it; and what has changed since.

A record is one JSON file, `STAMP_TEST.json`, in a folder of the valve's own: outcome, picture, what was configured.
`positioner.history.kept_tests` says where those folders are.

A figure has changed where it is off by more than `changed_sigmas` of both deviations together and by `worth` of itself:

    d = (now - before) / sqrt(s_now^2 + s_before^2)      s half of each +-

A place on the travel, or a command, is counted from a zero that means nothing: `worth_of_span` of what they span.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from math import hypot, inf, prod
from pathlib import Path
from typing import Any

import numpy as np

from config.drive import ROTARY
from config.errors import InputError, explain_failure
from config.json_value import json_value
from config.results.block import Table
from config.whole_file import replace_whole
from positioner.response.figure import Figure
from positioner.tests_on_the_valve.outcome import TURNED, Curve, Outcome, Picture, Quantity
from positioner.tests_on_the_valve.valve_test_thresholds import THRESHOLDS

KINDS = ("factory", "as_found", "as_left")
"""What a record is kept as; the newest of a kind stands for it."""
BASELINES = ("as_left", "factory")
"""What a test is compared with where nobody says, the first that is there."""
TREND = 8
"""Records that a trend shows."""
MOST_POINTS = 600
"""Of a curve that is kept: more than a picture shows."""
RATE = "rate_pa_per_s"
"""The figure that says how fast the slowest ramp was."""
AT_ITS_RATE = frozenset({"friction_at_rate_pa", "lag_pa", "dynamic_error_band", "dynamic_error_band_mean"})
"""Figures that hold for a ramp of their own rate: compared with those of such a one alone."""
PLACES = {
    **dict.fromkeys(("low_m", "high_m", "closed_m"), ("travel_m",)),
    **dict.fromkeys(("bench_low_pa", "bench_high_pa", "opens_at_pa", "closes_at_pa"), ("travel_m", "spring_pa_per_m")),
}
"""Figures that are places, and the figures whose product is what they span."""
OF_ITS_START = frozenset({"command_pa", "start_m", "breakout_pa", "breakout_s", "back_m"})
"""Figures of where a test began, and of which way the stem had come there: compared with none."""
MEANS: Mapping[str, tuple[str, str]] = {
    "friction_pa": (
        "friction lower: packing loose or worn, it may leak",
        "friction higher: packing tight or dry, or the stem rubs",
    ),
    "spring_pa_per_m": (
        "spring weaker, or more area: a spring is broken, or another actuator",
        "spring stiffer: something rubs ever more, or another spring",
    ),
    "bench_low_pa": ("bench set lower: the spring is set looser", "bench set higher: the spring is set tighter"),
    "seat_load_pa": (
        "less seat load: it may leak through; spring, or least command",
        "more seat load: the spring is set tighter, or the friction is lower",
    ),
    "travel_m": (
        "travel shorter: something lies on the seat, or a stop is set",
        "travel longer: a stop",
    ),
    "low_m": ("lower end lower: seat worn, or the reading's zero", "lower end higher: something lies on the seat"),
    "lag_s": ("less lag: another tubing or booster", "more lag: tubing or booster choked, air leaks"),
    "opening_s": ("opens faster", "opens more slowly: supply, tubing, booster or friction"),
    "closing_s": ("closes faster", "closes more slowly: exhaust, booster, spring or friction"),
}
"""Of a figure that fell, and that rose: what a technician looks at first."""


@dataclass(frozen=True, slots=True)
class Change:
    """A figure then and now; of a place, what such places span."""

    quantity: Quantity
    before: Quantity
    span: float | None = None

    @property
    def deviations(self) -> float:
        """By how many deviations of both it is off."""
        now, before = self.quantity.figure, self.before.figure
        if now.value is None or before.value is None:
            return 0.0
        std = 0.5 * hypot(now.plus_minus or 0.0, before.plus_minus or 0.0)
        off = now.value - before.value
        return off / std if std > 0.0 else (0.0 if off == 0.0 else inf * off)

    @property
    def changed(self) -> bool:
        """Whether it is off by what is worth a look, or is known of one of both alone."""
        now, before = self.quantity.figure.value, self.before.figure.value
        return now is not before if now is None or before is None else self.is_off_by(THRESHOLDS.worth)

    def is_off_by(self, share: float) -> bool:
        """Whether it is off by more than both uncertainties, and by more than a share of itself; false without one."""
        now, before = self.quantity.figure.value, self.before.figure.value
        if now is None or before is None or abs(self.deviations) <= THRESHOLDS.changed_sigmas:
            return False
        if self.span is not None:
            return abs(now - before) > THRESHOLDS.worth_of_span * self.span
        return abs(now - before) > share * max(abs(now), abs(before))

    @property
    def means(self) -> str:
        """What it may mean; empty where nothing is known of it, or one of both is not."""
        if self.deviations == 0.0:
            return ""
        low, high = MEANS.get(self.quantity.name, ("", ""))
        return high if self.deviations > 0 else low


@dataclass(frozen=True, slots=True)
class Record:
    """A record that is kept: when, as what, the outcome, and what was configured."""

    path: Path
    time_s: float
    kind: str
    outcome: Outcome
    configuration: Mapping[str, Any]

    @property
    def told(self) -> str:
        """What it is, in a few words."""
        when = datetime.fromtimestamp(self.time_s, UTC)
        kind = f"{self.kind.replace('_', ' ')} record" if self.kind else "test"
        return f"{kind} of {when:%Y-%m-%d %H:%M} UTC"


def keep(folder: Path, outcome: Outcome, kind: str, time_s: float, configuration: Mapping[str, Any]) -> Path:
    """Keep an outcome, and return its file.

    Raises:
        InputError: it cannot be written.
    """
    when = datetime.fromtimestamp(time_s, UTC)
    path = folder / f"{when:%Y%m%dT%H%M%S%f}_{outcome.test.replace(' ', '_')}.json"
    picture = outcome.picture
    told = {
        "time_s": time_s,
        "kind": kind,
        "outcome": outcome.as_json(),
        "tables": [{"title": each.title, "headings": each.headings, "rows": each.rows} for each in outcome.tables],
        "picture": None
        if picture is None
        else {"x": picture.x, "y": picture.y, "curves": [_kept_curve(each) for each in picture.curves]},
        "configuration": configuration,
    }
    with explain_failure(path, "cannot be written"):
        folder.mkdir(parents=True, exist_ok=True)
        replace_whole(path, json.dumps(json_value(told), allow_nan=False, default=str) + "\n")
    return path


def records(folder: Path, test: str | None = None, kind: str | None = None) -> list[Record]:
    """Return the records of a valve, oldest first, of one test or kind if so asked.

    Raises:
        InputError: a record cannot be read.
    """
    found = [_read(path) for path in sorted(folder.glob("*.json"))]
    return [each for each in found if test in (None, each.outcome.test) and kind in (None, each.kind)]


def baseline(folder: Path, test: str, against: str | None) -> Record | None:
    """Return the newest record of a kind; where nobody says which, as left, or else the factory's; None without one.

    Raises:
        InputError: one was asked for, and there is none.
    """
    for kind in BASELINES if against is None else (against,):
        if found := records(folder, test, kind):
            return found[-1]
    if against is not None:
        raise InputError(f"--against {against}", f"no {test} is kept as {against} in {folder}")
    return None


def changes(now: Outcome, before: Outcome) -> list[Change]:
    """Return the figures of both; one without a +- can be compared with nothing."""
    then = {each.name: each for each in before.quantities}
    apart = OF_ITS_START | (AT_ITS_RATE if _rates_differ(now, before) else frozenset())
    both = [(each, then[each.name]) for each in now.quantities if each.name in then.keys() - apart]
    told = [pair for pair in both if all(each.figure.value is None or each.figure.plus_minus for each in pair)]
    return [Change(each, was, span_of(each.name, now)) for each, was in told]


def span_of(name: str, outcome: Outcome) -> float | None:
    """Return what places of a figure's kind span in an outcome; None of a figure that is none, or where it lacks."""
    known = {each.name: each.figure.value for each in outcome.quantities}
    factors = PLACES.get(name, ())
    told = [value for each in factors if (value := known.get(each)) is not None]
    return prod(told) if told and len(told) == len(factors) else None


def _rates_differ(*outcomes: Outcome) -> bool:
    """Whether ramps were faster in one: the rate is what the limits of pressure and time permitted."""
    rates = [each.figure.value for outcome in outcomes for each in outcome.quantities if each.name == RATE]
    known = [each for each in rates if each is not None]
    return len(known) == len(outcomes) and max(known) > (1.0 + THRESHOLDS.same_rate) * min(known)


def change_table(told: Sequence[Change], since: str) -> Table:
    """Return what has changed as a table, what has not left out."""
    rows = [
        (each.quantity.text, each.before.shown, each.quantity.shown, f"{each.deviations:+.3g}")
        for each in told
        if each.changed
    ]
    return Table(("figure", "before ", "now ", "deviations"), rows, f"changed since the {since}")


def meaning_table(told: Sequence[Change]) -> Table:
    """Return what changes may mean, a line each, in the technician's words."""
    return Table(("what it may mean",), [(each.means,) for each in told if each.changed and each.means])


def trend(told: Sequence[Record], names: Sequence[str]) -> Table:
    """Return the newest records, a row each: when, the verdict, as what, and figures by their names."""
    shown = told[-TREND:]
    texts = {each.name: each.text for record in shown for each in record.outcome.quantities}
    rows = []
    for record in shown:
        figures = {each.name: each for each in record.outcome.quantities}
        cells = [
            figures[each].shown if each in figures and figures[each].figure.reason is None else "-" for each in names
        ]
        when = datetime.fromtimestamp(record.time_s, UTC)
        rows.append((f"{when:%Y-%m-%d %H:%M}", record.outcome.said, record.kind.replace("_", " "), *cells))
    headings = ("UTC", "", "", *(texts.get(each, each) + " " for each in names))
    return Table(headings, rows, f"the last {len(shown)} of {len(told)}")


def _kept_curve(curve: Curve) -> dict[str, object]:
    every = max(1, len(curve.x) // MOST_POINTS)
    return {"name": curve.name, "x": curve.x[::every], "y": curve.y[::every], "points": curve.points}


def _read(path: Path) -> Record:
    from config.codes import ValveTestVerdict

    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        outcome, picture = told["outcome"], told["picture"]
        return Record(
            path,
            float(told["time_s"]),
            str(told["kind"]),
            Outcome(
                outcome["test"],
                outcome["valve"],
                tuple(_quantities(outcome["figures"])),
                tuple(ValveTestVerdict(each["code"]) for each in outcome["verdicts"]),
                tuple(outcome["notes"]),
                tuple(Table(each["headings"], each["rows"], each["title"]) for each in told["tables"]),
                None if picture is None else _picture(picture),
            ),
            told["configuration"],
        )
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise InputError(str(path), "is no record of a test on the valve: move it out of this folder") from None


def _quantities(told: Mapping[str, Any]) -> Iterator[Quantity]:
    for name, each in told.items():
        figure = Figure(each["value"], each["plus_minus"], each["reason"])
        inside = ROTARY.of_valve(name) if each["unit"] in TURNED.values() else name
        yield Quantity(inside, each["text"], each["unit"], figure, each["expected"])


def _picture(told: Mapping[str, Any]) -> Picture:
    curves = (
        Curve(each["name"], np.array(each["x"], dtype=float), np.array(each["y"], dtype=float), each["points"])
        for each in told["curves"]
    )
    return Picture(told["x"], told["y"], tuple(curves))
