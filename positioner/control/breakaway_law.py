"""The law for small moves: break the stem loose with a shaped pulse, let the seed's law carry it, trim what is left.

Symbols: r reference, x position at rest (a mean), s direction of the push, b/c = -k_s/A, k/c = -F_c/A (law.py).
All levels are balances of the moving stem at a point X, beta_s the error of that balance learnt in direction s:

    u(X, s) = -(b/c (X - s beta_s) + s k/c)

1. At rest at x, known to sigma_x (rest.py), the error is e = r - x and s = sign(e). Within the dead band

       abs(e) <= max(dead band, 2.5 sigma_x) 1.5^n,    n = reversals of s since the reference changed, less one

   nothing is done, and the pressure stays as it is: that is the end of the move.
2. Else the pulse that goes the distance abs(e) is asked of pulse.py: for one period u(x + s z_p, s), then for good
   u(x + s z_h, s). z_p = push > (F_s - F_c)/k_s breaks the stem loose. A long way is a slide, z_h = abs(e): the seed's
   law. A short one is braked: z_h < abs(e), down to the middle of what static friction holds, u = -b/c x.
   While the end is known no better than sigma_d, the pulse aims short by max(0, 2 sigma_d - dead band).
3. A pulse that would leave more than 0.7 abs(e) is not given: the valve's resolution is reached.
4. At rest again, the pulse is judged. The stem moved: pulse.py learns from the distance, and the push is lowered by a
   little. It did not: the push is raised by more. This weighted staircase settles where most pulses break loose:
   lower p = raise (1 - p). Before any pulse has moved the stem, the push climbs fast. A push at its limit that moves
   nothing ends the move: the valve is stuck.
5. If the pressure had not arrived when the push was over (a slow I/P), pushes are held from then on until the measured
   pressure arrives or the stem is seen to move.

Why there is no limit cycle: a pulse is only given if it is predicted to leave less than 0.7 of the error, the dead
band widens with every reversal, and the number of pulses per move is limited. After the end of the move nothing
happens until the reference changes, or something else is seen to have moved the stem.
"""

from dataclasses import dataclass, replace
from math import inf, log, sqrt

from config.codes import InhibitReason
from positioner.control.balance_law import balance_pa
from positioner.control.pulse import Pulse, Response, unknown
from positioner.control.rest_detector import Rest
from positioner.estimation.acceptance import Ratios
from positioner.estimation.estimates import Estimates

RESOLUTION = 2e-4
"""Of the stroke: to this a position at rest is averaged."""
UNKNOWN_BALANCE = 3e-3
"""Of the stroke: standard deviation of the balance where the identification says none, and ..."""
BALANCE_WALK = 3e-4
"""... how far it changes from move to move, for b/c is not quite right and friction not quite the same."""
FIRST_PUSH, PUSH_CLIMB = 0.05, 1.3
"""(F_s - F_c)/F_c that is tried first, and the factor from there until the stem moves."""
PUSH_RAISE, PUSH_LOWER = 1.08, 0.99
LARGEST_LEFT = 0.7
REVERSAL_WIDENS = 1.5
MOST_PULSES = 40
SHORTEST_AIM = 0.5
"""Of the way: an uncertain pulse aims no shorter."""
STUCK_AFTER, AT_LIMIT = 3, 0.999
"""So many pulses at the limit must have moved nothing."""
SETTLE_PERIODS = 3
"""Beyond the computed end: the delay of the loop and a sample to be sure."""
SLOW_PUSH = 0.3
"""Of F_c: so much more is asked of a slow pressure."""
LONGEST_PUSH_S, LONGEST_PRESSURE_S = 1.0, 0.5
PRESSURE_ARRIVED = 0.02
"""Of F_c/A."""
MOTION_SEEN = 5.0
"""Standard deviations of a sample."""
WITHIN_NOISE, DISTINCT, DISTURBED = 2.5, 2.5, 8.0
"""Standard deviations of a mean: that an error may be, a step must be, a shift at rest must be."""
REFILL_S = 60.0
"""At rest, after this time each, a pulse comes back to the number that is left."""


@dataclass(frozen=True, slots=True)
class BreakawaySettings:
    """What the law is told: m, Pa."""

    stroke_m: float
    dead_band_m: float
    minimum_pa: float
    maximum_pa: float
    breakaway_pa: float | None
    """F_s/A where it is known."""
    push_limit_pa: float | None
    """The most that a push may be beyond the balance; None: F_c/A as identified."""


@dataclass(frozen=True, slots=True)
class Lesson:
    """A pulse that was given, from where (m), and how far the shortest would have gone (m)."""

    pulse: Pulse
    from_m: float
    from_error_m: float
    shortest_m: float
    arrived: bool = False
    """Whether the pressure has been seen at the push."""


@dataclass(frozen=True, slots=True)
class Flight:
    """The stem is under way, or may be: until when, and what it is given after the push."""

    push_pa: float
    hold_pa: float
    start_s: float
    settle_s: float
    """So long after the push its outcome reaches the samples ..."""
    glide_s: float
    """... and so long after that the stem is at rest, if it does as it should."""
    push_end_s: float = inf
    """Infinite while it is pushed."""
    first_gap: tuple[float, float] | None = None
    """Time, s, and gap between pressure and hold, Pa, when the outcome began to show."""
    lag_known: bool = False
    lesson: Lesson | None = None
    """None: nothing can be learnt from this one, for something else happened meanwhile."""


@dataclass(frozen=True, slots=True)
class Side:
    """The push in one direction beyond the balance as learnt, m, and whether a pulse was ever seen to move the stem."""

    push_m: float
    moved: bool


UNTRIED, UNKNOWN = Side(0.0, False), unknown(0.0)


@dataclass(frozen=True, slots=True)
class Move:
    """A move since the reference changed."""

    target_m: float
    pulses: int = 0
    reversals: int = 0
    direction: int = 0
    at_limit: int = 0
    """Pulses at the limit, in a row, that moved nothing."""
    ended_s: float | None = None
    ended_at_m: float = 0.0


@dataclass(frozen=True, slots=True)
class Breakaway:
    """What the law remembers from one step to the next."""

    rest: Rest
    ratios: Ratios | None = None
    response: Response = UNKNOWN
    up: Side = UNTRIED
    down: Side = UNTRIED
    slow_pressure: bool = False
    lag_s: float = 0.0
    """Of the pressure, when it is slow; 0: not measured."""
    now_s: float = 0.0
    level_pa: float = 0.0
    move: Move | None = None
    """None while another state commands."""
    flight: Flight | None = None
    why: InhibitReason = InhibitReason.NOTHING

    def held_pa(self, command_pa: float) -> float:
        """Return what to hold when something interrupts after a command, Pa: what a push would have given way to."""
        pushing = self.flight is not None and self.flight.push_end_s == inf
        return self.flight.hold_pa if self.flight is not None and pushing else command_pa

    def side(self, direction: int) -> Side:
        """Return the push in a direction."""
        return self.up if direction > 0 else self.down

    def with_side(self, direction: int, side: Side) -> "Breakaway":
        """Return the memory with another push in a direction."""
        return replace(self, up=side) if direction > 0 else replace(self, down=side)


@dataclass(frozen=True, slots=True)
class Seen:
    """What one step sees: SI units. `usable` says whether the position may be used."""

    now_s: float
    position_m: float
    pressure_pa: float
    usable: bool


def at_start(settings: BreakawaySettings) -> Breakaway:
    """Return the memory of a law that has seen nothing."""
    return Breakaway(Rest(RESOLUTION * settings.stroke_m))


def watch(memory: Breakaway, seen: Seen, command_pa: float) -> Breakaway:
    """Return what is remembered while another state commands: where the stem rests under what, nothing of a move."""
    rest = memory.rest if command_pa == memory.level_pa else memory.rest.left()
    rest = rest.seen(seen.position_m) if seen.usable else rest
    return replace(
        memory, rest=rest, now_s=seen.now_s, level_pa=command_pa, move=None, flight=None, why=InhibitReason.NOTHING
    )


def step(
    memory: Breakaway,
    seen: Seen,
    reference_m: float,
    ratios: Ratios,
    estimates: Estimates,
    settings: BreakawaySettings,
) -> Breakaway:
    """Return what is remembered after one step of the law; its `level_pa` is the pressure asked for."""
    period_s = seen.now_s - memory.now_s
    memory = replace(memory, now_s=seen.now_s)
    if ratios != memory.ratios:
        memory = _identified(memory, ratios, estimates, settings)
    if memory.move is None or reference_m != memory.move.target_m:
        memory = _asked(memory, seen, reference_m, ratios, settings)
    if memory.flight is not None:
        memory = _flying(memory, memory.flight, seen, ratios)
    flight = memory.flight
    if not seen.usable or (flight is not None and seen.now_s < flight.push_end_s + flight.settle_s):
        return memory
    memory = replace(memory, rest=memory.rest.seen(seen.position_m))
    # Only when a block has just ended is there anything new to judge.
    if memory.rest.block_count or not memory.rest.known or not period_s > 0:
        return memory
    if flight is not None and not (_landed(flight, seen, ratios) or _unmoved(flight, memory.rest)):
        return replace(memory, rest=memory.rest.left())
    return _next(_judged(memory, ratios, settings), period_s, ratios, settings)


def _identified(memory: Breakaway, ratios: Ratios, estimates: Estimates, settings: BreakawaySettings) -> Breakaway:
    """Take over newly identified numbers; what pulses have taught of the rest stays."""
    first = memory.ratios is None
    std_m = UNKNOWN_BALANCE * settings.stroke_m
    if estimates.k_over_c.valid:
        std_m = max(BALANCE_WALK * settings.stroke_m, estimates.k_over_c.std / -ratios.b_over_c)
    response = unknown(std_m) if first else memory.response.rebalanced(std_m)
    a, b = estimates.a, estimates.b
    if a.valid and b.valid:
        response = response.with_poles(a.value, b.value, max(abs(a.std / a.value), abs(b.std / b.value)))
    memory = replace(memory, ratios=ratios, response=response)
    if not first:
        return memory
    friction_pa = -ratios.k_over_c
    beyond_pa, known = FIRST_PUSH * friction_pa, settings.breakaway_pa is not None
    if settings.breakaway_pa is not None:
        beyond_pa = max(beyond_pa, PUSH_RAISE * (settings.breakaway_pa - friction_pa))
    side = Side(beyond_pa / -ratios.b_over_c, known)
    return replace(memory, up=side, down=side)


def _asked(memory: Breakaway, seen: Seen, reference_m: float, ratios: Ratios, settings: BreakawaySettings) -> Breakaway:
    """Begin a move: from rest in peace, else with the seed's law until the stem rests."""
    begun = replace(memory, move=Move(reference_m), why=InhibitReason.NOTHING)
    if (memory.flight is None and memory.rest.known) or not seen.usable:
        return begun
    direction = 1 if reference_m > seen.position_m else -1
    level_pa = balance_pa(reference_m - direction * memory.response.bias_m(direction), direction, ratios)
    level_pa = min(max(level_pa, settings.minimum_pa), settings.maximum_pa)
    glide_s = memory.response.slide_s(abs(reference_m - seen.position_m), RESOLUTION * settings.stroke_m)
    flight = Flight(level_pa, level_pa, seen.now_s, 0.0, glide_s, seen.now_s)
    return replace(begun, flight=flight, level_pa=level_pa, rest=memory.rest.left())


def _flying(memory: Breakaway, flight: Flight, seen: Seen, ratios: Ratios) -> Breakaway:
    """See whether the pressure follows, and end the push when it is time."""
    lesson = flight.lesson
    if lesson is None:
        return memory
    sign = lesson.pulse.direction
    if not lesson.arrived:
        tolerance_pa = max(_tolerance_pa(ratios), 0.2 * lesson.pulse.push_m * -ratios.b_over_c)
        # Written so that a pressure that is not measured (NaN) has arrived.
        lesson = replace(lesson, arrived=not sign * (flight.push_pa - seen.pressure_pa) > tolerance_pa)
        flight = replace(flight, lesson=lesson)
    if flight.push_end_s < inf:
        return _falling(memory, flight, seen, ratios)
    if memory.slow_pressure and seen.now_s < flight.start_s + LONGEST_PUSH_S:
        least_m = max(MOTION_SEEN * memory.rest.std_m, memory.rest.resolution_m)
        moving = seen.usable and sign * (seen.position_m - lesson.from_m) > least_m
        if not (moving or lesson.arrived):
            return replace(memory, flight=flight)
        if moving:  # this is where it broke loose
            broke_m = sign * (seen.pressure_pa - balance_pa(lesson.from_m, sign, ratios)) / -ratios.b_over_c
            flight = replace(flight, lesson=replace(lesson, pulse=lesson.pulse._replace(push_m=broke_m)))
            memory = memory.with_side(sign, Side(max(0.0, broke_m + memory.response.bias_m(sign)), moved=True))
    flight = replace(flight, push_end_s=seen.now_s)
    return replace(memory, flight=flight, level_pa=flight.hold_pa)


def _falling(memory: Breakaway, flight: Flight, seen: Seen, ratios: Ratios) -> Breakaway:
    """Measure the lag of a pressure that does not follow at once: T_p = (t_2 - t_1) / ln(gap_1 / gap_2)."""
    if flight.lag_known or seen.now_s < flight.push_end_s + flight.settle_s:
        return replace(memory, flight=flight)
    gap_pa = abs(seen.pressure_pa - flight.hold_pa)
    if flight.first_gap is None:
        follows = not gap_pa > _tolerance_pa(ratios)
        return replace(memory, flight=replace(flight, first_gap=(seen.now_s, gap_pa), lag_known=follows))
    first_s, first_pa = flight.first_gap
    if not 0.0 < gap_pa < 0.5 * first_pa:
        return replace(memory, flight=flight)
    lag_s = (seen.now_s - first_s) / log(first_pa / gap_pa)
    return replace(memory, flight=replace(flight, lag_known=True), lag_s=lag_s)


def _landed(flight: Flight, seen: Seen, ratios: Ratios) -> bool:
    """Return whether stem and pressure should be at rest."""
    unsteady = abs(seen.pressure_pa - flight.hold_pa) > _tolerance_pa(ratios)
    patience_s = flight.settle_s + flight.glide_s + (LONGEST_PRESSURE_S if unsteady else 0.0)
    return seen.now_s >= flight.push_end_s + patience_s


def _unmoved(flight: Flight, rest: Rest) -> bool:
    """Return whether the push is over and has moved nothing."""
    lesson = flight.lesson
    return lesson is not None and lesson.arrived and not _moved(lesson, rest)


def _moved(lesson: Lesson, rest: Rest) -> bool:
    """Return whether a pulse has moved the stem: by half of the least it can, and by more than noise would."""
    travel_m = lesson.pulse.direction * (rest.mean_m - lesson.from_m)
    noise_m = sqrt(rest.error_m**2 + lesson.from_error_m**2)
    return travel_m > max(0.5 * lesson.shortest_m, DISTINCT * noise_m)


def _tolerance_pa(ratios: Ratios) -> float:
    return PRESSURE_ARRIVED * -ratios.k_over_c


def _judged(memory: Breakaway, ratios: Ratios, settings: BreakawaySettings) -> Breakaway:
    """Judge the pulse that has just come to its end, if there is one."""
    flight, move = memory.flight, memory.move
    if flight is None or move is None:
        return memory
    memory = replace(memory, flight=None)
    lesson = flight.lesson
    if lesson is None:
        return memory
    pulse, rest = lesson.pulse, memory.rest
    side = memory.side(pulse.direction)
    if _moved(lesson, rest):
        travel_m = pulse.direction * (rest.mean_m - lesson.from_m)
        variance_m2 = rest.error_m**2 + lesson.from_error_m**2
        response = memory.response.learnt(pulse, travel_m, variance_m2, BALANCE_WALK * settings.stroke_m)
        by_the_push = pulse.push_m <= _push_m(memory, pulse.direction, ratios, settings)
        side = Side(side.push_m * (PUSH_LOWER if by_the_push and not memory.slow_pressure else 1.0), moved=True)
        other = memory.side(-pulse.direction)
        if not other.moved:
            memory = memory.with_side(-pulse.direction, replace(other, push_m=side.push_m))
        memory = replace(memory, response=response, move=replace(move, at_limit=0))
        return memory.with_side(pulse.direction, side)
    if not (lesson.arrived or memory.slow_pressure):
        return replace(memory, slow_pressure=True)
    limit_m = _push_limit_m(ratios, settings)
    push_m = pulse.push_m + memory.response.bias_m(pulse.direction)
    if push_m >= AT_LIMIT * limit_m:
        memory = replace(memory, move=replace(move, at_limit=move.at_limit + 1))
    push_m = max(side.push_m, push_m) * (PUSH_RAISE if side.moved else PUSH_CLIMB)
    return memory.with_side(pulse.direction, replace(side, push_m=min(push_m, limit_m)))


def _next(memory: Breakaway, period_s: float, ratios: Ratios, settings: BreakawaySettings) -> Breakaway:
    """End the move, or give the next pulse; a stem at rest that something else has moved begins it again."""
    move, rest = memory.move, memory.rest
    if move is None or (move.ended_s is not None and not _disturbed(move, rest, settings)):
        return memory
    if move.ended_s is not None:
        again = int((memory.now_s - move.ended_s) / REFILL_S)
        move = replace(move, ended_s=None, pulses=max(0, move.pulses - again))
    error_m = move.target_m - rest.mean_m
    direction = 1 if error_m > 0 else -1
    reversals = move.reversals + (move.direction == -direction)
    move = replace(move, direction=direction, reversals=reversals)
    dead_m = max(settings.dead_band_m, WITHIN_NOISE * rest.error_m) * REVERSAL_WIDENS ** max(0, reversals - 1)
    if abs(error_m) <= dead_m:
        return _ended(memory, move, InhibitReason.NOTHING)
    if move.at_limit >= STUCK_AFTER:
        return _ended(memory, move, InhibitReason.STUCK)
    lesson = _lesson(memory, abs(error_m), direction, period_s, ratios, settings)
    end = memory.response.end(lesson.pulse, RESOLUTION * settings.stroke_m)
    if move.pulses >= MOST_PULSES or abs(abs(error_m) - end.travel_m) > LARGEST_LEFT * abs(error_m):
        return _ended(memory, move, InhibitReason.TRIM_ENDED)
    return _pushed(memory, move, lesson, end.time_s, period_s, ratios, settings)


def _disturbed(move: Move, rest: Rest, settings: BreakawaySettings) -> bool:
    """Return whether a stem whose move has ended rests elsewhere now."""
    noise_m = DISTURBED * rest.std_m / sqrt(2 * rest.length)
    return abs(rest.mean_m - move.ended_at_m) > settings.dead_band_m + noise_m


def _pushed(
    memory: Breakaway,
    move: Move,
    lesson: Lesson,
    glide_s: float,
    period_s: float,
    ratios: Ratios,
    settings: BreakawaySettings,
) -> Breakaway:
    """Give a pulse, if the pressure may go so far."""
    pulse = lesson.pulse
    push_m = pulse.push_m
    if memory.slow_pressure:  # or it would creep up to the push for ever; it is taken back in time
        limit_m = _push_limit_m(ratios, settings) - memory.response.bias_m(pulse.direction)
        push_m = max(push_m, min(push_m + SLOW_PUSH * ratios.k_over_c / ratios.b_over_c, limit_m))
    push_pa, hold_pa = (
        balance_pa(lesson.from_m + pulse.direction * level_m, pulse.direction, ratios)
        for level_m in (push_m, pulse.hold_m)
    )
    if not settings.minimum_pa <= push_pa <= settings.maximum_pa:
        return _ended(memory, move, InhibitReason.LAW_BEYOND_LIMITS)
    hold_pa = min(max(hold_pa, settings.minimum_pa), settings.maximum_pa)
    flight = Flight(push_pa, hold_pa, memory.now_s, SETTLE_PERIODS * period_s, glide_s, lesson=lesson)
    move = replace(move, pulses=move.pulses + 1)
    return replace(
        memory, flight=flight, move=move, level_pa=push_pa, rest=memory.rest.left(), why=InhibitReason.NOTHING
    )


def _lesson(
    memory: Breakaway, way_m: float, direction: int, period_s: float, ratios: Ratios, settings: BreakawaySettings
) -> Lesson:
    """Choose the pulse that goes a way, m, or short of it by what it is not sure of."""
    response, rest = memory.response, memory.rest
    deepest_m = -ratios.k_over_c / ratios.b_over_c
    duration_s = (SETTLE_PERIODS if memory.slow_pressure else 1) * period_s
    push = Pulse(_push_m(memory, direction, ratios, settings), deepest_m, duration_s, direction, memory.lag_s)
    pulse = response.aimed(way_m, push, deepest_m)
    short_m = 2 * response.std_m(pulse) - settings.dead_band_m
    if short_m > 0:
        pulse = response.aimed(max(way_m - short_m, SHORTEST_AIM * way_m), push, deepest_m)
    shortest_m = response.end(pulse._replace(hold_m=min(pulse.hold_m, deepest_m)), inf).travel_m
    return Lesson(pulse, rest.mean_m, rest.error_m, shortest_m)


def _push_m(memory: Breakaway, direction: int, ratios: Ratios, settings: BreakawaySettings) -> float:
    """Return the push by the balance as identified, m."""
    push_m = min(memory.side(direction).push_m, _push_limit_m(ratios, settings))
    return push_m - memory.response.bias_m(direction)


def _push_limit_m(ratios: Ratios, settings: BreakawaySettings) -> float:
    limit_pa = settings.push_limit_pa if settings.push_limit_pa is not None else -ratios.k_over_c
    return limit_pa / -ratios.b_over_c


def _ended(memory: Breakaway, move: Move, why: InhibitReason) -> Breakaway:
    """End the move: the pressure stays as it is."""
    move = replace(move, ended_s=memory.now_s, ended_at_m=memory.rest.mean_m)
    return replace(memory, move=move, why=why)
