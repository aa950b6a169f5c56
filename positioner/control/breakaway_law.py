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

Here is the course of a move. What is remembered is in `breakaway_memory`, 5. in `pulse_following`, and which pulse to
give and what its outcome teaches (3., 4.) in `pulse_trial`; `pulse` has the mechanics of the stem.
"""

from collections.abc import Callable
from dataclasses import replace
from math import sqrt
from typing import NamedTuple

from config.codes import InhibitReason
from positioner.control.balance_law import balance_pa
from positioner.control.breakaway_memory import (
    RESOLUTION,
    BreakawayMemory,
    BreakawaySettings,
    Move,
    Observation,
    PulseInProgress,
    PulseTrial,
)
from positioner.control.pulse_following import follow_pressure, moved_nothing, should_be_at_rest
from positioner.control.pulse_trial import (
    SETTLE_PERIODS,
    evaluate_trial,
    planned_trial,
    push_limit_m,
    take_identification,
)
from positioner.control.rest_detector import RestEstimate
from positioner.estimation.acceptance import Ratios
from positioner.estimation.estimates import Estimates

LARGEST_LEFT = 0.7
"""Share of the error that a pulse may be predicted to leave."""
REVERSAL_WIDENS = 1.5
"""Factor on the dead band for each reversal after the first."""
MOST_PULSES = 40
"""In a move."""
STUCK_AFTER = 3
"""So many pulses at the limit must have moved nothing."""
SLOW_PUSH = 0.3
"""Share of F_c: so much more is asked of a slow pressure."""
WITHIN_NOISE, DISTURBED = 2.5, 8.0
"""Standard deviations of a mean: that an error may be, that a shift at rest must be."""
REFILL_S = 60.0
"""At rest, after this time each, a pulse comes back to the number that is left."""


class PlannedPulse(NamedTuple):
    """What a pulse that may be given is predicted to do, m."""

    error_m: float
    """That there is now ..."""
    left_m: float
    """... and that it leaves."""
    trial: PulseTrial
    dead_m: float
    """The dead band of the move."""


Worth = Callable[[BreakawayMemory, PlannedPulse], bool]
"""Whether a pulse is worth giving to a stem at rest: a law that has other moves may say that it is not."""


def _always(_memory: BreakawayMemory, _pulse: PlannedPulse) -> bool:
    return True


def while_not_commanding(memory: BreakawayMemory, observation: Observation, command_pa: float) -> BreakawayMemory:
    """Return the memory while another state commands: the rest of the stem under that command, nothing of a move."""
    watching = while_watching(memory, observation, command_pa)
    if memory.move is None and memory.in_progress is None and memory.inhibit_reason is InhibitReason.NOTHING:
        return watching
    return replace(watching, move=None, in_progress=None, inhibit_reason=InhibitReason.NOTHING)


def while_watching(memory: BreakawayMemory, observation: Observation, command_pa: float) -> BreakawayMemory:
    """Return the memory while another law moves the stem: its rest under that command; the move stays as it was."""
    rest = memory.rest if command_pa == memory.level_pa else memory.rest.restarted()
    rest = rest.updated(observation.position_m) if observation.usable else rest
    return replace(memory, rest=rest, now_s=observation.now_s, level_pa=command_pa)


def step(
    memory: BreakawayMemory,
    observation: Observation,
    reference_m: float,
    ratios: Ratios,
    estimates: Estimates,
    settings: BreakawaySettings,
    worth: Worth = _always,
) -> BreakawayMemory:
    """Return what is remembered after one step of the law; its `level_pa` is the pressure asked for.

    Args:
        memory, observation, reference_m, ratios, estimates, settings: as said.
        worth: as said there.
    """
    period_s = observation.now_s - memory.now_s
    memory = replace(memory, now_s=observation.now_s)
    if ratios != memory.ratios:
        memory = take_identification(memory, ratios, estimates, settings)
    if memory.move is None or reference_m != memory.move.target_m:
        memory = _begin_move(memory, observation, reference_m, ratios, settings)
    if memory.in_progress is not None:
        memory = follow_pressure(memory, memory.in_progress, observation, ratios)
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
        should_be_at_rest(in_progress, observation, ratios) or moved_nothing(in_progress, memory.rest)
    ):
        return replace(memory, rest=memory.rest.restarted())
    return next_pulse(evaluate_trial(memory, ratios, settings), period_s, ratios, settings, worth)


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


def next_pulse(
    memory: BreakawayMemory,
    period_s: float,
    ratios: Ratios,
    settings: BreakawaySettings,
    worth: Worth = _always,
) -> BreakawayMemory:
    """End the move, or give the next pulse; a stem at rest that something else has moved begins it again.

    Arguments as of `step`; the stem rests, and period_s is that of the loop.
    """
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
    trial = planned_trial(memory, abs(error_m), direction, period_s, ratios, settings)
    end = memory.response.end(trial.pulse, RESOLUTION * settings.stroke_m)
    planned = PlannedPulse(abs(error_m), abs(abs(error_m) - end.travel_m), trial, dead_m)
    resolved = planned.left_m > LARGEST_LEFT * planned.error_m
    if move.pulses >= MOST_PULSES or resolved or not worth(memory, planned):
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
        limit_m = push_limit_m(ratios, settings) - memory.response.bias_m(pulse.direction)
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


def _end_move(memory: BreakawayMemory, move: Move, inhibit_reason: InhibitReason) -> BreakawayMemory:
    """End the move: the pressure stays as it is."""
    move = replace(move, ended_s=memory.now_s, ended_at_m=memory.rest.mean_m)
    return replace(memory, move=move, inhibit_reason=inhibit_reason)
