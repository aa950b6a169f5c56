"""A pulse in progress: whether the pressure follows, when the push ends, and when the stem should be at rest again."""

from dataclasses import replace
from math import inf, log

from positioner.control.balance_law import balance_pa
from positioner.control.breakaway_memory import BreakawayMemory, LearntPush, Observation, PulseInProgress
from positioner.control.pulse_trial import moved_the_stem
from positioner.control.rest_detector import RestEstimate
from positioner.estimation.acceptance import Ratios

LONGEST_PUSH_S, LONGEST_PRESSURE_S = 1.0, 0.5
"""Of a push that a slow pressure does not reach; beyond the prediction, of a hold that it does not reach."""
PRESSURE_ARRIVED = 0.02
"""Share of F_c/A: a pressure nearer than this has arrived."""
MOTION_DETECTED = 5.0
"""Standard deviations of a sample by which a stem that moves has left its rest."""


def follow_pressure(
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
        least_m = max(MOTION_DETECTED * memory.rest.std_m, memory.rest.resolution_m)
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


def should_be_at_rest(in_progress: PulseInProgress, observation: Observation, ratios: Ratios) -> bool:
    """Return whether stem and pressure should be at rest."""
    unsteady = abs(observation.pressure_pa - in_progress.hold_pa) > _tolerance_pa(ratios)
    patience_s = in_progress.settle_s + in_progress.glide_s + (LONGEST_PRESSURE_S if unsteady else 0.0)
    return observation.now_s >= in_progress.push_end_s + patience_s


def moved_nothing(in_progress: PulseInProgress, rest: RestEstimate) -> bool:
    """Return whether the push is over and has moved nothing."""
    trial = in_progress.trial
    return trial is not None and trial.arrived and not moved_the_stem(trial, rest)


def _tolerance_pa(ratios: Ratios) -> float:
    return PRESSURE_ARRIVED * -ratios.k_over_c
