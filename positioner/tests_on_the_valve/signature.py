"""The valve signature: slow ramps of the command over the whole travel, up and down, at two rates.

Of the straight part of each ramp (`ramps`), taken to no rate, so that neither lag nor viscous friction is left in it,

    p_s(x) = (k x + F_0 + s F) / A        s = +1 up, -1 down, x from the lower end

follow, of the travel from x_0 to x_1,

    spring rate / area      k/A = dp/dx
    friction / area         F/A = (p_up - p_down) / 2               at half travel
    bench set               (p_up + p_down) / 2                     at x_0 and at x_1: without friction
    seat load / area        p_down(x_0) - p_least                   what presses on the seat at the least command
    hysteresis              (p_up - p_down) / (bench set's span)    dead band included, at half travel
    dynamic error band      x_down - x_up at one command            at the slowest rate played, lag and all
    linearity               farthest of (x_up + x_down) / 2 from its best straight line

Friction over travel is the half distance at the slowest rate, in bins of a tenth, less what the rate adds.
Every +- is two standard deviations. With the diaphragm's area, forces follow in newtons.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from math import hypot, sqrt

import numpy as np

from config.actuators import NEEDED
from config.codes import ValveTestVerdict
from config.drive import VALVE, Kind
from config.errors import InputError
from config.experiment_limits import ExperimentLimits
from config.recording import Column, Recording
from config.results.block import Table
from positioner.response.figure import Figure, no_value
from positioner.tests_on_the_valve.air_rates import supply_lacking, verdict_at_rest
from positioner.tests_on_the_valve.outcome import Curve, Outcome, Picture, Quantity
from positioner.tests_on_the_valve.program import Leap, Program, ramped
from positioner.tests_on_the_valve.ramps import Leg, Line, Ramps, difference, legs_of, ramps_of, scaled
from positioner.tests_on_the_valve.valve_test_thresholds import THRESHOLDS

LEGS = 2.0 + 1.0 / THRESHOLDS.least_rate_ratio
"""There and back, and at the fast rate from the command in force to the nearer end and back: as long as slow legs."""
HOLDS = 3
"""At that end, at the other, and there again."""
DECILES = tuple(0.1 * each for each in range(1, 10))


@dataclass(frozen=True, slots=True)
class Nameplate:
    """What is known of the valve before: m, and where it is known its force over its pressure, m^2.

    Of a valve that turns: rad, and its torque over its pressure, N m/Pa.
    """

    valve: str
    stroke_m: float
    area_m2: float | None = None
    kind: Kind = VALVE


def programmes(bounds: ExperimentLimits, start_pa: float, source: str = "experiment") -> tuple[Program, ...]:
    """Return the slow ramps, twice, and the fast ones, each a program of its own, as slow as the time limit permits.

    From the command in force to the nearer end of the pressures, to the other, there again, and back; the fast ones go
    there and back twice. The ways to them are fast, for they show nothing: the faster a force grows, the less of it
    breaks a stem loose.

    Raises:
        InputError: the time limit leaves no time for slow ramps; names the source.
    """
    span_pa, held_s = bounds.maximum_pa - bounds.minimum_pa, THRESHOLDS.end_held_s
    slow_s = min(THRESHOLDS.slowest_leg_s, _leg_s(bounds.longest_s))
    shortest_s = max(THRESHOLDS.shortest_leg_s, THRESHOLDS.least_rate_ratio * span_pa / bounds.rate_pa_per_s)
    if slow_s < shortest_s:
        least_s = time_limit_s(shortest_s)
        raise InputError(
            source, f"experiment.limit_s: a signature needs {least_s:.3g} s or more, got {bounds.longest_s:g}"
        )
    fast_s = min(slow_s / THRESHOLDS.least_rate_ratio, max(slow_s / THRESHOLDS.rate_ratio, THRESHOLDS.shortest_leg_s))
    fast_s = max(fast_s, span_pa / bounds.rate_pa_per_s)
    near_pa, far_pa = sorted((bounds.minimum_pa, bounds.maximum_pa), key=lambda each: abs(each - start_pa))
    near, back = Leap(near_pa, held_s), Leap(start_pa, 0.0)
    there_and_back = (Leap(far_pa, held_s), near)
    slowly = tuple(replace(each, rate_pa_per_s=span_pa / slow_s) for each in there_and_back)
    slow = ramped("slow ramps", start_pa, (near, *slowly, back), span_pa / fast_s)
    fast = ramped("fast ramps", start_pa, (near, *2 * there_and_back, back), span_pa / fast_s)
    return slow, slow, fast


def time_limit_s(leg_s: float) -> float:
    """Return the time limit within which slow ramps take so long a leg, s."""
    return LEGS * leg_s / THRESHOLDS.of_time_limit + HOLDS * THRESHOLDS.end_held_s


def _leg_s(limit_s: float) -> float:
    return THRESHOLDS.of_time_limit * (limit_s - HOLDS * THRESHOLDS.end_held_s) / LEGS


def signature(recordings: "list[Recording]", plate: Nameplate) -> Outcome:
    """Return the signature that recordings of ramps show; whatever they do not show says why."""
    legs = [leg for recording in recordings for leg in legs_of(recording)]
    ramps = ramps_of(legs)
    if recordings:
        plate = replace(plate, kind=recordings[0].kind)
    if not ramps.lines:
        return _without_motion(recordings, legs, plate)
    low, high = ramps.low_m, ramps.high_m
    travel = difference(high, low)
    x_0 = 0.0 if low.value is None else low.value
    x_1 = plate.stroke_m if high.value is None else high.value
    notes = [f"{each.reason}: the file's stroke is used" for each in (low, high) if each.reason]
    rates = ", ".join(f"{1e-3 * each:.3g}" for each in ramps.rates_pa_per_s)
    notes.append(f"{len(ramps.lines)} ramps at {rates} kPa/s")
    verdict, told = _verdict(ramps, travel, 0.5 * (x_0 + x_1), plate)
    if travel.value is None and (lacking := supply_lacking(recordings)):
        verdict, told = (ValveTestVerdict.NO_SUPPLY,), [lacking]
    quantities = [
        Quantity("low_m", "lower end of the travel", "m", low),
        Quantity("high_m", "upper end of the travel", "m", high),
        Quantity("travel_m", "travel", "m", travel),
        Quantity("spring_pa_per_m", "spring rate over 10 to 90 %", "Pa/m", ramps.slope_pa_per_m),
        *_force("spring_n_per_m", "spring rate", "N/m", ramps.slope_pa_per_m, plate),
        *_friction(ramps, plate, x_0, x_1),
        *_bench_set(ramps, plate, x_0, x_1, float(min(np.min(each.command_pa) for each in legs))),
        *_bands(ramps, x_0, x_1),
        Quantity("rate_pa_per_s", "slowest rate", "Pa/s", Figure(ramps.rates_pa_per_s[0])),
        Quantity("noise_m", "noise about the lines", "m", Figure(ramps.noise_m)),
    ]
    return Outcome(
        "signature",
        plate.valve,
        tuple(quantities),
        verdict,
        (*notes, *told),
        (_over_travel(ramps, plate, x_0, x_1),),
        _picture(ramps, plate.kind),
    ).of(plate.kind)


def _without_motion(recordings: "list[Recording]", legs: list[Leg], plate: Nameplate) -> Outcome:
    if not legs:
        why = "no ramp in the recording: the command nowhere goes one way over most of its span"
        return Outcome("signature", plate.valve, (), (ValveTestVerdict.UNDETERMINED,), (why,))
    verdict, supply = verdict_at_rest(recordings)
    why = supply or "the stem did not follow the command: it is stuck, it has no supply, or the reading is another's"
    return Outcome("signature", plate.valve, (), (verdict,), (why,))


def _verdict(
    ramps: Ramps, travel: Figure, half_m: float, plate: Nameplate
) -> tuple[tuple[ValveTestVerdict, ...], list[str]]:
    if travel.value is None:
        return (ValveTestVerdict.UNDETERMINED,), ["the ramps did not take the stem from end to end"]
    _, slow, _ = _half_apart(ramps, half_m)
    if (ramps.slope_pa_per_m.value or 0.0) * travel.value < THRESHOLDS.springless * 2.0 * (slow.value or 0.0):
        return (ValveTestVerdict.NO_SPRING,), [f"a broken spring, or {NEEDED['double_acting']}"]
    off_m = abs(travel.value - plate.stroke_m)
    if off_m > max(THRESHOLDS.stroke_wrong * plate.stroke_m, travel.plus_minus or 0.0):
        told = (
            f"the file says {plate.kind.length.said(plate.stroke_m, '.4g')}, the stem travels "
            f"{plate.kind.length.said(travel.value, '.4g')}: one of them is wrong"
        )
        return (ValveTestVerdict.STROKE_DIFFERS,), [told]
    return (ValveTestVerdict.PASSED,), []


def _force(name: str, text: str, unit: str, figure: Figure, plate: Nameplate) -> list[Quantity]:
    """Return the same as a force, where the area is known."""
    if plate.area_m2 is None:
        return []
    return [Quantity(name, text, unit, scaled(figure, plate.area_m2))]


def _half_apart(ramps: Ramps, half_m: float) -> tuple[Figure, Figure, Figure]:
    """Return half the distance of both directions at half travel, at no rate and at the slowest, and what that adds."""
    still = difference(ramps.at_no_rate(1, half_m), ramps.at_no_rate(-1, half_m), 0.5)
    slow = difference(ramps.at_slowest(1, half_m), ramps.at_slowest(-1, half_m), 0.5)
    return still, slow, difference(slow, still)


def _friction(ramps: Ramps, plate: Nameplate, x_0: float, x_1: float) -> list[Quantity]:
    still, slow, lag = _half_apart(ramps, 0.5 * (x_0 + x_1))
    lag = replace(lag, plus_minus=still.plus_minus)
    return [
        Quantity("friction_pa", "friction at half travel, extrapolated to rate 0", "Pa", still),
        *_force("friction_n", "friction", "N", still, plate),
        Quantity("friction_at_rate_pa", "the same at the slowest rate, with the lag", "Pa", slow),
        Quantity("lag_pa", "of it lag and viscous friction", "Pa", lag),
        Quantity("lag_s", "lag, over the rate: a time", "s", scaled(lag, 1.0 / ramps.rates_pa_per_s[0])),
    ]


def _bench_set(ramps: Ramps, plate: Nameplate, x_0: float, x_1: float, least_pa: float) -> list[Quantity]:
    ups = [ramps.at_no_rate(1, each) for each in (x_0, x_1)]
    downs = [ramps.at_no_rate(-1, each) for each in (x_0, x_1)]
    if ups[0].value is None:  # of one rate alone: the mean of both directions has no lag
        ups = [ramps.at_slowest(1, each) for each in (x_0, x_1)]
        downs = [ramps.at_slowest(-1, each) for each in (x_0, x_1)]
    slope = ramps.slope_pa_per_m.value or 0.0
    for told in (ups, downs):  # where the end is, is known no better than it was seen
        told[:] = [_widened(each, slope, end) for each, end in zip(told, (ramps.low_m, ramps.high_m), strict=True)]
    low, high = (_together(up, down) for up, down in zip(ups, downs, strict=True))
    unseated = no_value("the stem was not seen on its seat")
    seat = unseated if ramps.low_m.value is None else difference(downs[0], Figure(least_pa, 0.0))
    return [
        Quantity("bench_low_pa", "bench set, lower end", "Pa", low),
        Quantity("bench_high_pa", "bench set, upper end", "Pa", high),
        Quantity("opens_at_pa", "leaves the lower end at", "Pa", ups[0]),
        Quantity("closes_at_pa", "is back on it at", "Pa", downs[0]),
        Quantity("seat_load_pa", "seat load at the least command, as a pressure", "Pa", seat),
        *_force("seat_load_n", "seat load", "N", seat, plate),
    ]


def _widened(figure: Figure, slope_pa_per_m: float, end: Figure) -> Figure:
    """Return a pressure at an end with what that is uncertain by."""
    return difference(figure, Figure(0.0, slope_pa_per_m * (end.plus_minus or 0.0)))


def _together(up: Figure, down: Figure) -> Figure:
    """Return the mean of both directions; the end's own uncertainty, which they share, does not shrink."""
    middle = difference(up, scaled(down, -1.0), 0.5)
    return (
        middle
        if middle.value is None
        else replace(middle, plus_minus=max(up.plus_minus or 0.0, down.plus_minus or 0.0))
    )


def _bands(ramps: Ramps, x_0: float, x_1: float) -> list[Quantity]:
    still, _, _ = _half_apart(ramps, 0.5 * (x_0 + x_1))
    hysteresis = scaled(still, 2.0 / ((ramps.slope_pa_per_m.value or 1.0) * (x_1 - x_0)))
    largest = average = linear = no_value("too few samples of both directions at one command")
    if (told := _averaged(ramps, x_0, x_1)) is not None:
        centres, up, down, error = (each / (x_1 - x_0) for each in told)
        band, middle, error = down - up, 0.5 * (up + down), THRESHOLDS.sigmas * error
        off = np.abs(middle - np.polyval(np.polyfit(centres, middle, 1), centres))
        largest = Figure(float(band.max()), sqrt(2.0) * float(error[np.argmax(band)]))
        average = Figure(float(np.mean(band)), sqrt(2.0) * float(np.sqrt(np.mean(error**2) / len(band))))
        linear = Figure(float(off.max()), float(error[np.argmax(off)]) / sqrt(2.0))
    return [
        Quantity("hysteresis", "hysteresis and dead band, of the span", "1", hysteresis),
        Quantity("dynamic_error_band", "dynamic error band at the slowest rate, largest", "1", largest),
        Quantity("dynamic_error_band_mean", "the same, mean", "1", average),
        Quantity("linearity", "linearity: farthest from the best line", "1", linear),
    ]


def _averaged(ramps: Ramps, x_0: float, x_1: float) -> tuple[Column, Column, Column, Column] | None:
    """Return commands, mean positions up and down there at the slowest rate, m, and the mean's deviation, m."""
    ways = [ramps.slowest(way) for way in (1, -1)]
    edge_m, lines = THRESHOLDS.band_edge * (x_1 - x_0), [*ways[0], *ways[1]]
    first = max((each.pressure_pa(x_0 + edge_m)[0] for each in lines), default=0.0)
    last = min((each.pressure_pa(x_1 - edge_m)[0] for each in lines), default=0.0)
    if not all(ways) or last <= first:
        return None
    edges = np.linspace(first, last, 11)
    (up, up_error), (down, down_error) = (_in_bins(each, edges) for each in ways)
    whole = np.isfinite(up) & np.isfinite(down)
    error = np.hypot(up_error, down_error) / sqrt(2.0)
    centres = 0.5 * (edges[:-1] + edges[1:])
    return (centres[whole], up[whole], down[whole], error[whole]) if whole.any() else None


def _in_bins(lines: list[Line], edges: Column) -> tuple[Column, Column]:
    """Return in each bin of the command the position at its middle, m, and its deviation; NaN where samples lack."""
    p = np.concatenate([each.leg.command_pa for each in lines])
    x = np.concatenate([each.leg.position_m for each in lines])
    slope = float(np.mean([each.slope for each in lines]))
    level, error = np.full(len(edges) - 1, np.nan), np.full(len(edges) - 1, np.nan)
    for number, (low, high) in enumerate(pairwise(edges.tolist())):
        rows = (p >= low) & (p < high)
        if int(rows.sum()) >= THRESHOLDS.fewest_in_bin:
            evened = x[rows] - slope * (p[rows] - 0.5 * (low + high))
            level[number] = float(np.mean(evened))
            error[number] = float(np.std(evened, ddof=1)) / sqrt(int(rows.sum()))
    return level, error


def _over_travel(ramps: Ramps, plate: Nameplate, x_0: float, x_1: float) -> Table:
    """Return friction at the tenths of the travel."""
    lag_pa = _half_apart(ramps, 0.5 * (x_0 + x_1))[2].value or 0.0
    rows, unit = [], plate.kind.force.si
    for share in DECILES:
        found = _friction_at(ramps, x_0 + share * (x_1 - x_0), 0.1 * (x_1 - x_0), lag_pa)
        shown = Quantity("", "", "Pa", found).shown
        force = "" if plate.area_m2 is None else Quantity("", "", unit, scaled(found, plate.area_m2)).shown
        rows.append((f"{100 * share:.0f} %", shown, *((force,) if plate.area_m2 is not None else ())))
    headings = ("travel", "friction, as a pressure", *(("friction",) if plate.area_m2 is not None else ()))
    return Table(headings, rows, "friction over travel, at the slowest rate less its lag")


def _friction_at(ramps: Ramps, middle_m: float, width_m: float, lag_pa: float) -> Figure:
    """Return the half distance of both directions about a position: of rows taken by the lines' commands."""
    told = []
    for way in (1, -1):
        lines = ramps.slowest(way)
        ends = [[each.pressure_pa(middle_m + share * width_m)[0] for each in lines] for share in (-0.5, 0.5)]
        edges = np.array([float(np.mean(each)) if each else 0.0 for each in ends])
        level, error = _in_bins(lines, edges) if lines else np.full((2, 1), np.nan)
        if not np.isfinite(level[0]):
            return no_value("too few samples there")
        slope = float(np.mean([each.slope for each in lines]))
        told.append((float(np.mean(edges) - (level[0] - middle_m) / slope), float(error[0]) / slope))
    (up_pa, up_error_pa), (down_pa, down_error_pa) = told
    return Figure(0.5 * (up_pa - down_pa) - lag_pa, THRESHOLDS.sigmas * 0.5 * hypot(up_error_pa, down_error_pa))


def _picture(ramps: Ramps, kind: Kind) -> Picture:
    curves = []
    for way, name in ((1, "up"), (-1, "down")):
        lines = ramps.slowest(way)
        if lines:
            leg = lines[0].leg
            curves.append(Curve(name, leg.command_pa, leg.position_m, points=True))
    for way, name in ((1, "line up"), (-1, "line down")):
        for line in ramps.slowest(way)[:1]:
            p = np.array([np.min(line.leg.command_pa), np.max(line.leg.command_pa)])
            x = np.clip(
                line.slope * p + line.level,
                *np.quantile(line.leg.position_m, THRESHOLDS.end_quantiles),
            )
            ends = (x - line.level) / line.slope
            curves.append(Curve(name, ends, x))
    return Picture.of_travel(kind, curves)
