"""A pulse as a trial: which one to give, and what its outcome teaches of push, response and balance."""

from dataclasses import replace
from math import inf, sqrt

from positioner.control.breakaway_memory import BreakawayMemory, BreakawaySettings, LearntPush, PulseTrial
from positioner.control.pulse import Pulse, unidentified_response
from positioner.control.rest_detector import RestEstimate
from positioner.estimation.acceptance import Ratios
from positioner.estimation.estimates import Estimates

UNKNOWN_BALANCE = 3e-3
"""Share of the stroke: standard deviation of the balance where the identification gives none, and ..."""
BALANCE_WALK = 3e-4
"""... how far it changes from move to move, for b/c is not quite right and friction not quite the same."""
FIRST_PUSH, PUSH_CLIMB = 0.05, 1.3
"""(F_s - F_c)/F_c of the first push, and the factor from push to push until the stem moves."""
PUSH_RAISE, PUSH_LOWER = 1.08, 0.99
"""Factors on the push after a trial that did not move the stem, and after one that did."""
SHORTEST_AIM = 0.5
"""Share of the way: an uncertain pulse aims no shorter."""
AT_LIMIT = 0.999
"""Share of the push limit that counts as the limit."""
DISTINCT = 2.5
"""Standard deviations of a mean that a move of the stem must be."""
SETTLE_PERIODS = 3
"""Beyond the computed end: the delay of the loop and a sample to be sure."""


def take_identification(
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


def planned_trial(
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


def evaluate_trial(memory: BreakawayMemory, ratios: Ratios, settings: BreakawaySettings) -> BreakawayMemory:
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
    if moved_the_stem(trial, rest):
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
    limit_m = push_limit_m(ratios, settings)
    push_m = pulse.push_m + memory.response.bias_m(pulse.direction)
    if push_m >= AT_LIMIT * limit_m:
        memory = replace(memory, move=replace(move, at_limit=move.at_limit + 1))
    push_m = max(push.push_m, push_m) * (PUSH_RAISE if push.moved else PUSH_CLIMB)
    return memory.with_push_in(pulse.direction, replace(push, push_m=min(push_m, limit_m)))


def moved_the_stem(trial: PulseTrial, rest: RestEstimate) -> bool:
    """Return whether a pulse has moved the stem: by half of the least it can, and by more than noise would."""
    travel_m = trial.pulse.direction * (rest.mean_m - trial.from_m)
    noise_m = sqrt(rest.error_m**2 + trial.from_error_m**2)
    return travel_m > max(0.5 * trial.shortest_m, DISTINCT * noise_m)


def _push_m(memory: BreakawayMemory, direction: int, ratios: Ratios, settings: BreakawaySettings) -> float:
    """Return the push by the balance as identified, m."""
    push_m = min(memory.push_in(direction).push_m, push_limit_m(ratios, settings))
    return push_m - memory.response.bias_m(direction)


def push_limit_m(ratios: Ratios, settings: BreakawaySettings) -> float:
    """Return the most that a push may be beyond the balance, m."""
    limit_pa = settings.push_limit_pa if settings.push_limit_pa is not None else -ratios.k_over_c
    return limit_pa / -ratios.b_over_c
