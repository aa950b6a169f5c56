"""The continuous stroke test: in operation, the command creeps until the stem moves, then back; once each way.

Break-away friction over the area, from the commands under which it broke loose upwards, from a rest at x_1, and then
downwards, from one at x_2,

    q = p_up - p_down + (k/A) (x_2 - x_1)        q / 2  >=  F_s/A  >=  (q - (k/A) d) / 2

for up to d, both tolerances together, the stem may have followed before it was seen to: an interval, which needs the
spring rate. At 0.05 % of the command's range a second neither lag nor viscous friction adds to it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from config.codes import ValveTestVerdict
from config.drive import VALVE, Kind
from config.errors import InputError
from config.experiment_limits import ExperimentLimits
from positioner.response.figure import Figure, no_value
from positioner.tests_on_the_valve.breakout import Breakout, breakout, rest_before, tolerance_m
from positioner.tests_on_the_valve.outcome import Curve, Outcome, Picture, Quantity
from positioner.tests_on_the_valve.program import Leap, Played, Program, ramped, require_within
from positioner.tests_on_the_valve.valve_test_thresholds import THRESHOLDS

TEST = "continuous stroke test"


@dataclass(frozen=True, slots=True)
class ContinuousStroke:
    """What is asked for: the motion that ends it and the most, of the stroke; the rate, of the command's range, 1/s."""

    start: float = 0.003
    most: float = 0.02
    rate: float = 5e-4

    def require_possible(self) -> None:
        """Refuse what cannot be; InputError as `require_within`."""
        require_within(
            (
                ("--start", self.start, 1e-4, 0.5 * self.most),
                ("--most", self.most, 0.002, 0.2),
                ("--rate", self.rate, 1e-5, 0.05),
            ),
        )


def programme(
    asked: ContinuousStroke,
    bounds: ExperimentLimits,
    start_pa: float,
    stroke_m: float,
    way: int,
    dead_band_pa: float | None = None,
) -> Program:
    """Return the program of one way: to the limit of the command, or as far as half the time limit permits.

    Raises:
        InputError: a stem of this dead band, where it is known, would not be reached in that time.
    """
    asked.require_possible()
    rate = asked.rate * (bounds.maximum_pa - bounds.minimum_pa)
    within_s = max(THRESHOLDS.shortest_way_s, THRESHOLDS.one_way * bounds.longest_s - THRESHOLDS.rest_s)
    farthest_pa = rate * within_s
    if dead_band_pa is not None and farthest_pa < dead_band_pa:
        needed = asked.rate * dead_band_pa / farthest_pa
        raise InputError(
            "--rate",
            f"at {asked.rate:g} the command goes {farthest_pa:.4g} Pa in half of experiment.limit_s, and the stem may "
            f"need {dead_band_pa:.4g} Pa: allowed is {needed:.2g} or more, or a longer limit",
        )
    limit_pa = (
        min(bounds.maximum_pa, start_pa + farthest_pa) if way > 0 else max(bounds.minimum_pa, start_pa - farthest_pa)
    )
    leaps = (Leap(start_pa, THRESHOLDS.rest_s), Leap(limit_pa, 0.0))
    return ramped(
        f"{TEST}, {'up' if way > 0 else 'down'}",
        start_pa,
        leaps,
        rate,
        turn_m=asked.start * stroke_m,
        band_m=asked.most * stroke_m,
    )


def continuous_stroke(
    played: Sequence[Played], asked: ContinuousStroke, valve: str, stroke_m: float, slope_pa_per_m: float | None
) -> Outcome:
    """Return what both ways, up and down, came to; the slope is the spring rate over the area, where it is known."""
    found: list[Breakout | None] = []
    followed_m, notes, verdicts = 0.0, [], []
    rests: list[float] = []
    for each in played:
        rest = None if each.recording is None else rest_before(each.recording)
        if each.recording is None or rest is None:
            found.append(None)
            continue
        tolerance = tolerance_m(asked.start * stroke_m, rest)
        followed_m += tolerance
        rests.append(rest.position_m)
        found.append(breakout(each.recording, rest, tolerance))
    for each in played:
        verdicts += each.broken_off
        notes += [f"broken off: {each.problem}"] if each.broken_off else []
    up, down = [*found, None, None][:2]
    still = [way for way, each in (("up", up), ("down", down)) if each is None]
    if still and not verdicts:
        verdicts.append(ValveTestVerdict.NOT_MOVED)
        notes.append(
            f"the stem did not move {' and '.join(still)} as far as the time limit let the command go: "
            "experiment.limit_s, or a faster --rate"
        )
    kind = next((each.recording.kind for each in played if each.recording is not None), VALVE)
    return Outcome(
        TEST,
        valve,
        tuple(_figures(up, down, rests[-1] - rests[0] if rests else 0.0, followed_m, slope_pa_per_m)),
        tuple(dict.fromkeys(verdicts)) or (ValveTestVerdict.PASSED,),
        tuple(notes),
        picture=_picture(played, kind),
    ).of(kind)


def _figures(
    up: Breakout | None, down: Breakout | None, moved_m: float, followed_m: float, slope: float | None
) -> list[Quantity]:
    told = [
        no_value("the stem did not break loose") if each is None else Figure(each.command_pa, each.plus_minus_pa)
        for each in (up, down)
    ]
    most = least = figure = no_value("the stem did not break loose both ways")
    if up is not None and down is not None:
        apart, error = up.command_pa - down.command_pa, up.plus_minus_pa + down.plus_minus_pa
        most = least = figure = no_value("the spring rate is not known: identify the valve")
        if slope is not None:
            q = apart + slope * moved_m
            most = Figure(0.5 * q, 0.5 * error)
            least = Figure(0.5 * (q - slope * followed_m), 0.5 * error)
            figure = Figure(0.5 * (q - 0.5 * slope * followed_m), 0.5 * error + 0.25 * slope * followed_m)
    return [
        Quantity("breaks_up_pa", "breaks loose upwards at", "Pa", told[0]),
        Quantity("breaks_down_pa", "breaks loose downwards at", "Pa", told[1]),
        Quantity("breakaway_pa", "break-away friction, as a pressure", "Pa", figure),
        Quantity("breakaway_most_pa", "at the most", "Pa", most),
        Quantity("breakaway_least_pa", "at the least", "Pa", least),
    ]


def _picture(played: Sequence[Played], kind: Kind) -> Picture:
    curves = [
        Curve(name, each.recording.command_pa, each.recording.position_m)
        for name, each in zip(("up", "down"), played, strict=False)
        if each.recording is not None
    ]
    return Picture.of_travel(kind, curves)
