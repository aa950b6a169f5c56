"""The law for small moves: break the stem loose with a shaped pulse, let the seed's law carry it, trim what is left.

Symbols: r reference, x position at rest (a mean), s direction of the push, b/c = -k_s/A, k/c = -F_c/A (balance_law.py).
All levels are balances of the moving stem at a point X, beta_s the error of that balance learnt in direction s:

    u(X, s) = -(b/c (X - s beta_s) + s k/c)

1. At rest at x, known to sigma_x (rest_detector.py), the error is e = r - x and s = sign(e). Within the dead band

       abs(e) <= max(dead band, 2.5 sigma_x) 1.5^n,    n = reversals of s since the reference changed, less one

   nothing is done, and the pressure stays as it is: that is the end of the move.
2. Else the pulse that goes the distance abs(e) is asked of pulse.py: for one period u(x + s z_p, s), then for good
   u(x + s z_h, s). z_p = push > (F_s - F_c)/k_s breaks the stem loose. A long way is a slide, z_h = abs(e): the seed's
   law. A short one is braked: z_h < abs(e), down to the middle of what static friction holds, u = -b/c x.
   While the end is known no better than sigma_d, the pulse aims short by max(0, 2 sigma_d - dead band).
3. A pulse that would leave more than 0.7 abs(e) is not given: the valve's resolution is reached.
4. At rest again, the trial is evaluated. The stem moved: pulse.py learns from the distance, and the push is lowered
   by a little. It did not: the push is raised by more. This weighted staircase settles where most pulses break loose:
   lower p = raise (1 - p). Before any pulse has moved the stem, the push climbs fast. A push at its limit that moves
   nothing ends the move: the valve is stuck.
5. If the pressure had not arrived when the push was over (a slow I/P), pushes are held from then on until the measured
   pressure arrives or the stem measurably moves.

Why there is no limit cycle: a pulse is only given if it is predicted to leave less than 0.7 of the error, the dead
band widens with every reversal, and the number of pulses per move is limited. After the end of the move nothing
happens until the reference changes, or something else has measurably moved the stem.
"""

from dataclasses import dataclass, replace
from math import inf, log, sqrt

from config.codes import InhibitReason
from positioner.control.balance_law import balance_pa
from positioner.control.pulse import Pulse, PulseResponse, unidentified_response
from positioner.control.rest_detector import RestEstimate
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
    """Settings of the law: m, Pa."""

    stroke_m: float
    dead_band_m: float
    minimum_pa: float
    maximum_pa: float
    breakaway_pa: float | None
    """F_s/A where it is known."""
    push_limit_pa: float | None
    """The most that a push may be beyond the balance; None: F_c/A as identified."""


@dataclass(frozen=True, slots=True)
class PulseTrial:
    """A pulse given to learn from: the rest it started at, m, and how far the shortest pulse would have gone, m."""

    pulse: Pulse
    from_m: float
    from_error_m: float
    shortest_m: float
    arrived: bool = False
    """Whether the pressure has reached the push."""


@dataclass(frozen=True, slots=True)
class PulseInProgress:
    """The stem moves, or may move: the pressures of push and hold, and when it should be at rest."""

    push_pa: float
    hold_pa: float
    start_s: float
    settle_s: float
    """Delay from the end of the push until its effect is in the samples ..."""
    glide_s: float
    """... and from there until the stem is predicted to rest."""
    push_end_s: float = inf
    """Infinite while it is pushed."""
    first_gap: tuple[float, float] | None = None
    """Time, s, and gap between pressure and hold, Pa, when the outcome began to show."""
    lag_known: bool = False
    trial: PulseTrial | None = None
    """None: nothing can be learnt from this pulse, for the reference changed meanwhile."""


@dataclass(frozen=True, slots=True)
class LearntPush:
    """The push in one direction beyond the balance as learnt, m, and whether such a pulse ever moved the stem."""

    push_m: float
    moved: bool


UNTRIED_PUSH, UNKNOWN_RESPONSE = LearntPush(0.0, False), unidentified_response(0.0)


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
class BreakawayMemory:
    """What the law remembers from one step to the next."""

    rest: RestEstimate
    ratios: Ratios | None = None
    response: PulseResponse = UNKNOWN_RESPONSE
    up: LearntPush = UNTRIED_PUSH
    down: LearntPush = UNTRIED_PUSH
    slow_pressure: bool = False
    lag_s: float = 0.0
    """Of the pressure, when it is slow; 0: not measured."""
    now_s: float = 0.0
    level_pa: float = 0.0
    move: Move | None = None
    """None while another state commands."""
    in_progress: PulseInProgress | None = None
    inhibit_reason: InhibitReason = InhibitReason.NOTHING

    def held_pa(self, command_pa: float) -> float:
        """Return what to hold when something interrupts after a command, Pa: what a push would have given way to."""
        pushing = self.in_progress is not None and self.in_progress.push_end_s == inf
        return self.in_progress.hold_pa if self.in_progress is not None and pushing else command_pa

    def push_in(self, direction: int) -> LearntPush:
        """Return the push in a direction."""
        return self.up if direction > 0 else self.down

    def with_push_in(self, direction: int, push: LearntPush) -> "BreakawayMemory":
        """Return the memory with another push in a direction."""
        return replace(self, up=push) if direction > 0 else replace(self, down=push)


@dataclass(frozen=True, slots=True)
class Observation:
    """The measurement of one step, SI units. `usable` says whether the position may be used."""

    now_s: float
    position_m: float
    pressure_pa: float
    usable: bool


def initial_memory(settings: BreakawaySettings) -> BreakawayMemory:
    """Return the memory of a law that has no measurement yet."""
    return BreakawayMemory(RestEstimate(RESOLUTION * settings.stroke_m))


def while_not_commanding(memory: BreakawayMemory, observation: Observation, command_pa: float) -> BreakawayMemory:
    """Return the memory while another state commands: the rest of the stem under that command, nothing of a move."""
    rest = memory.rest if command_pa == memory.level_pa else memory.rest.restarted()
    rest = rest.updated(observation.position_m) if observation.usable else rest
    return replace(
        memory,
        rest=rest,
        now_s=observation.now_s,
        level_pa=command_pa,
        move=None,
        in_progress=None,
        inhibit_reason=InhibitReason.NOTHING,
    )


def step(
    memory: BreakawayMemory,
    observation: Observation,
    reference_m: float,
    ratios: Ratios,
    estimates: Estimates,
    settings: BreakawaySettings,
) -> BreakawayMemory:
    """Return what is remembered after one step of the law; its `level_pa` is the pressure asked for."""
    period_s = observation.now_s - memory.now_s
    memory = replace(memory, now_s=observation.now_s)
    if ratios != memory.ratios:
        memory = _take_identification(memory, ratios, estimates, settings)
    if memory.move is None or reference_m != memory.move.target_m:
        memory = _begin_move(memory, observation, reference_m, ratios, settings)
    if memory.in_progress is not None:
        memory = _follow_pressure(memory, memory.in_progress, observation, ratios)
    in_progress = memory.in_progress
    if not observation.usable or (
        in_progress is not None and observation.now_s < in_progress.push_end_s + in_progress.settle_s
    ):
        return memory
    memory = replace(memory, rest=memory.rest.updated(observation.position_m))
    # Only when a block has just ended is there anything new to evaluate.
    if memory.rest.block_count or not memory.rest.known or not period_s > 0:
        return memory
    if in_progress is not None and not (
        _should_be_at_rest(in_progress, observation, ratios) or _unmoved(in_progress, memory.rest)
    ):
        return replace(memory, rest=memory.rest.restarted())
    return _next_pulse(_evaluate_trial(memory, ratios, settings), period_s, ratios, settings)


def _take_identification(
    memory: BreakawayMemory, ratios: Ratios, estimates: Estimates, settings: BreakawaySettings
) -> BreakawayMemory:
    """Take over newly identified numbers; what pulses have taught besides stays."""
    first = memory.ratios is None
    std_m = UNKNOWN_BALANCE * settings.stroke_m
    if estimates.k_over_c.valid:
        std_m = max(BALANCE_WALK * settings.stroke_m, estimates.k_over_c.std / -ratios.b_over_c)
    response = unidentified_response(std_m) if first else memory.response.with_new_balance(std_m)
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
    push = LearntPush(beyond_pa / -ratios.b_over_c, known)
    return replace(memory, up=push, down=push)


def _begin_move(
    memory: BreakawayMemory, observation: Observation, reference_m: float, ratios: Ratios, settings: BreakawaySettings
) -> BreakawayMemory:
    """Begin a move: from rest with a pulse, else with the seed's law until the stem rests."""
    begun = replace(memory, move=Move(reference_m), inhibit_reason=InhibitReason.NOTHING)
    if (memory.in_progress is None and memory.rest.known) or not observation.usable:
        return begun
    direction = 1 if reference_m > observation.position_m else -1
    level_pa = balance_pa(reference_m - direction * memory.response.bias_m(direction), direction, ratios)
    level_pa = min(max(level_pa, settings.minimum_pa), settings.maximum_pa)
    glide_s = memory.response.slide_s(abs(reference_m - observation.position_m), RESOLUTION * settings.stroke_m)
    in_progress = PulseInProgress(level_pa, level_pa, observation.now_s, 0.0, glide_s, observation.now_s)
    return replace(begun, in_progress=in_progress, level_pa=level_pa, rest=memory.rest.restarted())


def _follow_pressure(
    memory: BreakawayMemory, in_progress: PulseInProgress, observation: Observation, ratios: Ratios
) -> BreakawayMemory:
    """Check whether the pressure follows, and end the push when it is time."""
    trial = in_progress.trial
    if trial is None:
        return memory
    sign = trial.pulse.direction
    if not trial.arrived:
        tolerance_pa = max(_tolerance_pa(ratios), 0.2 * trial.pulse.push_m * -ratios.b_over_c)
        # Written so that a pressure that is not measured (NaN) has arrived.
        trial = replace(trial, arrived=not sign * (in_progress.push_pa - observation.pressure_pa) > tolerance_pa)
        in_progress = replace(in_progress, trial=trial)
    if in_progress.push_end_s < inf:
        return _measure_lag(memory, in_progress, observation, ratios)
    if memory.slow_pressure and observation.now_s < in_progress.start_s + LONGEST_PUSH_S:
        least_m = max(MOTION_SEEN * memory.rest.std_m, memory.rest.resolution_m)
        moving = observation.usable and sign * (observation.position_m - trial.from_m) > least_m
        if not (moving or trial.arrived):
            return replace(memory, in_progress=in_progress)
        if moving:  # this is where it broke loose
            broke_m = sign * (observation.pressure_pa - balance_pa(trial.from_m, sign, ratios)) / -ratios.b_over_c
            in_progress = replace(in_progress, trial=replace(trial, pulse=trial.pulse._replace(push_m=broke_m)))
            memory = memory.with_push_in(sign, LearntPush(max(0.0, broke_m + memory.response.bias_m(sign)), moved=True))
    in_progress = replace(in_progress, push_end_s=observation.now_s)
    return replace(memory, in_progress=in_progress, level_pa=in_progress.hold_pa)


def _measure_lag(
    memory: BreakawayMemory, in_progress: PulseInProgress, observation: Observation, ratios: Ratios
) -> BreakawayMemory:
    """Measure the lag of a pressure that does not follow at once: T_p = (t_2 - t_1) / ln(gap_1 / gap_2)."""
    if in_progress.lag_known or observation.now_s < in_progress.push_end_s + in_progress.settle_s:
        return replace(memory, in_progress=in_progress)
    gap_pa = abs(observation.pressure_pa - in_progress.hold_pa)
    if in_progress.first_gap is None:
        follows = not gap_pa > _tolerance_pa(ratios)
        return replace(
            memory, in_progress=replace(in_progress, first_gap=(observation.now_s, gap_pa), lag_known=follows)
        )
    first_s, first_pa = in_progress.first_gap
    if not 0.0 < gap_pa < 0.5 * first_pa:
        return replace(memory, in_progress=in_progress)
    lag_s = (observation.now_s - first_s) / log(first_pa / gap_pa)
    return replace(memory, in_progress=replace(in_progress, lag_known=True), lag_s=lag_s)


def _should_be_at_rest(in_progress: PulseInProgress, observation: Observation, ratios: Ratios) -> bool:
    """Return whether stem and pressure should be at rest."""
    unsteady = abs(observation.pressure_pa - in_progress.hold_pa) > _tolerance_pa(ratios)
    patience_s = in_progress.settle_s + in_progress.glide_s + (LONGEST_PRESSURE_S if unsteady else 0.0)
    return observation.now_s >= in_progress.push_end_s + patience_s


def _unmoved(in_progress: PulseInProgress, rest: RestEstimate) -> bool:
    """Return whether the push is over and has moved nothing."""
    trial = in_progress.trial
    return trial is not None and trial.arrived and not _moved(trial, rest)


def _moved(trial: PulseTrial, rest: RestEstimate) -> bool:
    """Return whether a pulse has moved the stem: by half of the least it can, and by more than noise would."""
    travel_m = trial.pulse.direction * (rest.mean_m - trial.from_m)
    noise_m = sqrt(rest.error_m**2 + trial.from_error_m**2)
    return travel_m > max(0.5 * trial.shortest_m, DISTINCT * noise_m)


def _tolerance_pa(ratios: Ratios) -> float:
    return PRESSURE_ARRIVED * -ratios.k_over_c


def _evaluate_trial(memory: BreakawayMemory, ratios: Ratios, settings: BreakawaySettings) -> BreakawayMemory:
    """Learn from the pulse that has just ended, if there is one: whether it moved the stem, and how far."""
    in_progress, move = memory.in_progress, memory.move
    if in_progress is None or move is None:
        return memory
    memory = replace(memory, in_progress=None)
    trial = in_progress.trial
    if trial is None:
        return memory
    pulse, rest = trial.pulse, memory.rest
    push = memory.push_in(pulse.direction)
    if _moved(trial, rest):
        travel_m = pulse.direction * (rest.mean_m - trial.from_m)
        variance_m2 = rest.error_m**2 + trial.from_error_m**2
        response = memory.response.updated(pulse, travel_m, variance_m2, BALANCE_WALK * settings.stroke_m)
        by_the_push = pulse.push_m <= _push_m(memory, pulse.direction, ratios, settings)
        push = LearntPush(push.push_m * (PUSH_LOWER if by_the_push and not memory.slow_pressure else 1.0), moved=True)
        other = memory.push_in(-pulse.direction)
        if not other.moved:
            memory = memory.with_push_in(-pulse.direction, replace(other, push_m=push.push_m))
        memory = replace(memory, response=response, move=replace(move, at_limit=0))
        return memory.with_push_in(pulse.direction, push)
    if not (trial.arrived or memory.slow_pressure):
        return replace(memory, slow_pressure=True)
    limit_m = _push_limit_m(ratios, settings)
    push_m = pulse.push_m + memory.response.bias_m(pulse.direction)
    if push_m >= AT_LIMIT * limit_m:
        memory = replace(memory, move=replace(move, at_limit=move.at_limit + 1))
    push_m = max(push.push_m, push_m) * (PUSH_RAISE if push.moved else PUSH_CLIMB)
    return memory.with_push_in(pulse.direction, replace(push, push_m=min(push_m, limit_m)))


def _next_pulse(
    memory: BreakawayMemory, period_s: float, ratios: Ratios, settings: BreakawaySettings
) -> BreakawayMemory:
    """End the move, or give the next pulse; a stem at rest that something else has moved begins it again."""
    move, rest = memory.move, memory.rest
    if move is None or (move.ended_s is not None and not _was_disturbed(move, rest, settings)):
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
        return _end_move(memory, move, InhibitReason.NOTHING)
    if move.at_limit >= STUCK_AFTER:
        return _end_move(memory, move, InhibitReason.STUCK)
    trial = _planned_trial(memory, abs(error_m), direction, period_s, ratios, settings)
    end = memory.response.end(trial.pulse, RESOLUTION * settings.stroke_m)
    if move.pulses >= MOST_PULSES or abs(abs(error_m) - end.travel_m) > LARGEST_LEFT * abs(error_m):
        return _end_move(memory, move, InhibitReason.TRIM_ENDED)
    return _give_pulse(memory, move, trial, end.time_s, period_s, ratios, settings)


def _was_disturbed(move: Move, rest: RestEstimate, settings: BreakawaySettings) -> bool:
    """Return whether a stem whose move has ended rests elsewhere now."""
    noise_m = DISTURBED * rest.std_m / sqrt(2 * rest.length)
    return abs(rest.mean_m - move.ended_at_m) > settings.dead_band_m + noise_m


def _give_pulse(
    memory: BreakawayMemory,
    move: Move,
    trial: PulseTrial,
    glide_s: float,
    period_s: float,
    ratios: Ratios,
    settings: BreakawaySettings,
) -> BreakawayMemory:
    """Give a pulse, if the pressure may go so far."""
    pulse = trial.pulse
    push_m = pulse.push_m
    if memory.slow_pressure:  # or it would creep up to the push for ever; it is taken back in time
        limit_m = _push_limit_m(ratios, settings) - memory.response.bias_m(pulse.direction)
        push_m = max(push_m, min(push_m + SLOW_PUSH * ratios.k_over_c / ratios.b_over_c, limit_m))
    push_pa, hold_pa = (
        balance_pa(trial.from_m + pulse.direction * level_m, pulse.direction, ratios)
        for level_m in (push_m, pulse.hold_m)
    )
    if not settings.minimum_pa <= push_pa <= settings.maximum_pa:
        return _end_move(memory, move, InhibitReason.LAW_BEYOND_LIMITS)
    hold_pa = min(max(hold_pa, settings.minimum_pa), settings.maximum_pa)
    in_progress = PulseInProgress(push_pa, hold_pa, memory.now_s, SETTLE_PERIODS * period_s, glide_s, trial=trial)
    move = replace(move, pulses=move.pulses + 1)
    return replace(
        memory,
        in_progress=in_progress,
        move=move,
        level_pa=push_pa,
        rest=memory.rest.restarted(),
        inhibit_reason=InhibitReason.NOTHING,
    )


def _planned_trial(
    memory: BreakawayMemory, way_m: float, direction: int, period_s: float, ratios: Ratios, settings: BreakawaySettings
) -> PulseTrial:
    """Choose the pulse that goes a way, m, or short of it by what it is not sure of."""
    response, rest = memory.response, memory.rest
    deepest_m = -ratios.k_over_c / ratios.b_over_c
    duration_s = (SETTLE_PERIODS if memory.slow_pressure else 1) * period_s
    push = Pulse(_push_m(memory, direction, ratios, settings), deepest_m, duration_s, direction, memory.lag_s)
    pulse = response.reaching(way_m, push, deepest_m)
    short_m = 2 * response.std_m(pulse) - settings.dead_band_m
    if short_m > 0:
        pulse = response.reaching(max(way_m - short_m, SHORTEST_AIM * way_m), push, deepest_m)
    shortest_m = response.end(pulse._replace(hold_m=min(pulse.hold_m, deepest_m)), inf).travel_m
    return PulseTrial(pulse, rest.mean_m, rest.error_m, shortest_m)


def _push_m(memory: BreakawayMemory, direction: int, ratios: Ratios, settings: BreakawaySettings) -> float:
    """Return the push by the balance as identified, m."""
    push_m = min(memory.push_in(direction).push_m, _push_limit_m(ratios, settings))
    return push_m - memory.response.bias_m(direction)


def _push_limit_m(ratios: Ratios, settings: BreakawaySettings) -> float:
    limit_pa = settings.push_limit_pa if settings.push_limit_pa is not None else -ratios.k_over_c
    return limit_pa / -ratios.b_over_c


def _end_move(memory: BreakawayMemory, move: Move, inhibit_reason: InhibitReason) -> BreakawayMemory:
    """End the move: the pressure stays as it is."""
    move = replace(move, ended_s=memory.now_s, ended_at_m=memory.rest.mean_m)
    return replace(memory, move=move, inhibit_reason=inhibit_reason)
