"""Step, dead-band and resolution tests: small steps of the command that bracket both, by ISA-75.25.01 and IEC 61514-2.

    on          a leap that moves the stem, so that which way it went last is known
    resolution  steps the same way, each a fiftieth of the dead band expected
    dead band   steps back, each a tenth of it, until well beyond it
    again       both, from the other side

Each step is held, so that the stem rests when the next comes. What did not move it and what did bracket each figure
(`positioner.response.measured_dead_band`); step responses (T63, T86) are those of the steps that did.
"""

from dataclasses import dataclass
from statistics import median

from config.codes import ValveTestVerdict
from config.errors import InputError
from config.experiment_limits import ExperimentLimits
from config.recording import Column, Recording
from positioner.response.figure import Figure, no_value
from positioner.response.measured_dead_band import follows_step
from positioner.response.response_figures import respond
from positioner.tests_on_the_valve.outcome import Curve, Outcome, Picture, Quantity
from positioner.tests_on_the_valve.program import Leap, Program, ramped, require_within
from positioner.tests_on_the_valve.ramps import scaled
from positioner.tests_on_the_valve.valve_test_thresholds import THRESHOLDS

TEST = "step test"


@dataclass(frozen=True, slots=True)
class SmallSteps:
    """What is asked for: the dead band expected, Pa; how long a step is held, s; the most travel, of the stroke."""

    dead_band_pa: float
    held_s: float = 0.8
    most: float = 0.3

    def require_possible(self) -> None:
        """Refuse what cannot be; InputError as `require_within`."""
        require_within(
            (
                ("--dead-band-pa", self.dead_band_pa, 1.0, 1e6),
                ("--held-s", self.held_s, 0.05, 600.0),
                ("--most", self.most, 0.01, 0.9),
            ),
        )


def programme(
    asked: SmallSteps, bounds: ExperimentLimits, start_pa: float, stroke_m: float, source: str = "experiment"
) -> Program:
    """Return the program: up first, or down where there is no room above.

    Raises:
        InputError: the limits of time or pressure leave no room.
    """
    asked.require_possible()
    back_pa, onward_pa = asked.dead_band_pa / THRESHOLDS.back_parts, asked.dead_band_pa / THRESHOLDS.onward_parts
    room_pa = (THRESHOLDS.leap + THRESHOLDS.onward_steps / THRESHOLDS.onward_parts) * asked.dead_band_pa
    way = 1.0 if start_pa + room_pa <= bounds.maximum_pa else -1.0
    if not bounds.minimum_pa <= start_pa + way * room_pa <= bounds.maximum_pa:
        raise InputError("--dead-band-pa", f"no room for {room_pa:.3g} Pa either way of the command, {start_pa:.6g} Pa")
    at_pa = start_pa + way * THRESHOLDS.leap * asked.dead_band_pa
    levels = [at_pa]
    for direction in (way, -way):
        for _ in range(THRESHOLDS.onward_steps):
            levels.append(levels[-1] + direction * onward_pa)
        for _ in range(THRESHOLDS.back_steps):
            levels.append(levels[-1] - direction * back_pa)
    kept = [min(max(each, bounds.minimum_pa), bounds.maximum_pa) for each in levels]
    leaps = (Leap(start_pa, 2.0 * asked.held_s), *(Leap(each, asked.held_s) for each in kept), Leap(start_pa, 0.0))
    program = ramped(TEST, start_pa, leaps, bounds.rate_pa_per_s, band_m=asked.most * stroke_m)
    if program.lasts_s > bounds.longest_s:
        raise InputError(
            source, f"experiment.limit_s: these steps need {program.lasts_s:.3g} s, got {bounds.longest_s:g}"
        )
    return program


def small_steps(recording: Recording, valve: str, stroke_m: float, slope_pa_per_m: float | None = None) -> Outcome:
    """Return what the steps show; the slope is the spring rate over the area, where it is known."""
    told = {name: recording.columns[name] for name in ("time_s", "position_m")}
    response = respond(Recording(told | {"command_pa": _in_steps(recording.command_pa)}, recording.metadata))
    gain = response.static_gain.value
    moved = [each for each in response.steps if gain and follows_step(each, gain)]
    quantities = [
        Quantity("dead_band_pa", "dead band", "Pa", response.dead_band),
        Quantity("resolution_pa", "resolution", "Pa", response.resolution),
        *_of_span(response.dead_band, response.resolution, slope_pa_per_m, stroke_m),
        *(_time(name, text, [getattr(each, name) for each in moved]) for name, text in TIMES),
        Quantity("least_move_m", "smallest move seen", "m", _least([each.travel_m for each in moved])),
    ]
    if not moved:
        verdict = ValveTestVerdict.NOT_MOVED
    elif response.dead_band.value is None or response.resolution.value is None:
        verdict = ValveTestVerdict.UNDETERMINED
    else:
        verdict = ValveTestVerdict.PASSED
    kind, since_s = recording.kind, recording.time_s - recording.time_s[0]
    travel, command = kind.length, kind.command.read
    picture = Picture(
        "time, s",
        f"travel, {travel.unit}; command, {command.unit}",
        (
            Curve("travel", since_s, travel.factor * recording.position_m),
            Curve("command", since_s, command.factor * recording.command_pa),
        ),
    )
    return Outcome(TEST, valve, tuple(quantities), (verdict,), tuple(response.notes), picture=picture).of(kind)


def _in_steps(command_pa: Column) -> Column:
    """Return a command without the samples on the way from one level to the next, which are the next one's."""
    steps = command_pa.copy()
    on_the_way = (steps[1:-1] != steps[:-2]) & (steps[1:-1] != steps[2:])
    steps[1:-1][on_the_way] = steps[2:][on_the_way]
    return steps


TIMES = (("dead_time_s", "dead time"), ("t63_s", "T63"), ("t86_s", "T86, step response time"))


def _of_span(dead_band: Figure, resolution: Figure, slope: float | None, stroke_m: float) -> list[Quantity]:
    if slope is None:
        return []
    span_pa = slope * stroke_m
    pairs = (("dead_band", "dead band, of the span", dead_band), ("resolution", "resolution, of the span", resolution))
    return [Quantity(name, text, "1", scaled(each, 1.0 / span_pa)) for name, text, each in pairs]


def _time(name: str, text: str, told: list[Figure]) -> Quantity:
    known = [each for each in told if each.value is not None]
    if not known:
        reason = next((each.reason for each in told if each.reason), "no step moved the stem")
        return Quantity(name, text, "s", no_value(reason))
    middle = median(each.value or 0.0 for each in known)
    return Quantity(name, text, "s", Figure(middle, median(each.plus_minus or 0.0 for each in known)))


def _least(told: list[Figure]) -> Figure:
    known = [(abs(each.value), each.plus_minus) for each in told if each.value is not None]
    return Figure(*min(known)) if known else no_value("no step moved the stem")
