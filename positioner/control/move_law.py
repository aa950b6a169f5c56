"""The law that chooses the move: nothing, a pulse, a slide, or two slides.

With the stem at rest at x, e = r - x, d the way of the pulse that suits e best (pulse.py), m the shortest slide, M the
excursion of two (slide_law.py):

    move           leaves                      excursion    at hand where
    nothing        abs(e)                      0            always
    a slide        what landings scatter by    0            abs(e) >= m
    a pulse        abs(abs(e) - d)             0            it leaves less than 0.7 abs(e): a loop that is fast enough
    two slides     what landings scatter by    M            the site's bounds let it, no reference to come takes it back

The least error beyond the dead band is chosen; of equal ones the least excursion, which is time and wear. So

    a pulse       which leaves no more than the dead band, or than it is unsure of, or so much that another pulse can
                  follow; or where slides would do nothing, be it that the site or the course of the reference bars them
    else          what the law of slides does: one, two, or nothing

Pulses see a straight valve: B(x, s) of the slides, which is bent as landings are, is given to them as the straight line
through B(r, +1) and B(r, -1). What either law learns of break-away the other begins with.

Why there is no limit cycle: slides given for one reference are counted, and so are pulses; both counts stay when the
stem goes from hand to hand, and a pulse that was not worth giving is not asked for again before another slide.
"""

from dataclasses import replace
from math import nan

from config.codes import InhibitReason
from positioner.control import breakaway_law, slide_law
from positioner.control.breakaway_law import PlannedPulse, Worth
from positioner.control.breakaway_memory import BreakawayMemory, LearntPush, Move, Observation
from positioner.control.move_memory import MoveMemory, MoveSettings
from positioner.control.pulse_trial import take_identification
from positioner.control.slide_balance import Balance
from positioner.control.slide_margins import NO_MARGINS, Margin, Margins
from positioner.control.slide_memory import NOWHERE, Anchor, SlideMemory, StemObservation
from positioner.estimation.acceptance import Ratios
from positioner.estimation.estimates import Estimates
from positioner.estimation.landings.stem_at_rest import Rest

HELD = 0.9
"""Of a push that breaks loose: a slide that surely does not."""
NEAR_ENOUGH = 2.0
"""Dead bands: an error that no pulse makes smaller, and that is not worth an excursion."""
STOPPED = 0.8
"""Of the push: a shortest pulse that goes farther is hardly stopped, the loop is too slow for it."""
UNSURE = 2.0
"""Standard deviations: a pulse that leaves no more may have hit."""
NOT_THERE = (
    InhibitReason.REFERENCE_COMES,
    InhibitReason.EXCURSION_WAITS,
    InhibitReason.EXCURSION_BUDGET_SPENT,
    InhibitReason.EXCURSION_BEYOND_LIMIT,
    InhibitReason.LAW_BEYOND_LIMITS,
    InhibitReason.TRIM_ENDED,
    InhibitReason.STUCK,
)
"""With which slides leave an error."""


def while_not_commanding(memory: MoveMemory, observation: Observation, command_pa: float) -> MoveMemory:
    """Return the memory while another state commands: the rest of the stem, nothing of a move."""
    pulses = breakaway_law.while_not_commanding(memory.pulses, observation, command_pa)
    slides = slide_law.while_not_commanding(memory.slides, command_pa)
    return MoveMemory(pulses, slides, identified=memory.identified, given_up=memory.given_up)


def step(
    memory: MoveMemory,
    sampled: Observation,
    observation: StemObservation,
    reference_m: float,
    balance: Balance,
    estimates: Estimates,
    settings: MoveSettings,
    *,
    pulses_allowed: bool,
) -> MoveMemory:
    """Return what is remembered after one step of the law; its `level_pa` is the pressure asked for.

    Args:
        memory, sampled, observation, reference_m, balance, estimates, settings: as of the laws of pulses and slides.
        pulses_allowed: False while the first slides have to tell whether what is known of the valve holds.
    """
    if memory.identified != balance.ratios:
        memory = _identified(memory, balance, estimates, settings)
    if memory.by_pulses:
        return _pulsing(memory, sampled, observation, reference_m, balance, estimates, settings)
    allowed = pulses_allowed and not memory.given_up and not memory.pulses.slow_pressure
    return _sliding(memory, sampled, observation, reference_m, balance, settings, pulses_allowed=allowed)


def _identified(memory: MoveMemory, balance: Balance, estimates: Estimates, settings: MoveSettings) -> MoveMemory:
    """Take over newly identified numbers."""
    pulses = take_identification(memory.pulses, balance.ratios, estimates, settings.pulses)
    return replace(memory, pulses=pulses, identified=balance.ratios, given_up=False)


def _sliding(
    memory: MoveMemory,
    sampled: Observation,
    observation: StemObservation,
    reference_m: float,
    balance: Balance,
    settings: MoveSettings,
    *,
    pulses_allowed: bool,
) -> MoveMemory:
    """Let slides have the stem, or give it to a pulse that is worth more than what they would do."""
    before = memory.slides.asked(observation.now_s, reference_m)
    slides = slide_law.step(before, observation, reference_m, balance, settings.slides)
    gave = slides.level_pa != before.level_pa
    away = slides.inhibit_reason in NOT_THERE or (slides.excursion and gave)
    asked = (reference_m, before.slides)
    if pulses_allowed and away and memory.pulses.rest.known and asked != memory.declined:
        pulses = _first_pulse(memory, sampled, observation, reference_m, balance, settings)
        if pulses.in_progress is not None:
            waiting = replace(slides, anchor=NOWHERE, aim_m=nan, excursion=False, direction=0, slides=before.slides)
            return replace(memory, pulses=pulses, slides=waiting, by_pulses=True, inhibit_reason=InhibitReason.NOTHING)
        memory = replace(memory, declined=asked)
    watching = breakaway_law.while_watching(memory.pulses, sampled, slides.level_pa)
    return MoveMemory(
        watching, slides, False, memory.identified, memory.declined, memory.given_up, slides.inhibit_reason
    )


def _first_pulse(
    memory: MoveMemory,
    sampled: Observation,
    observation: StemObservation,
    reference_m: float,
    balance: Balance,
    settings: MoveSettings,
) -> BreakawayMemory:
    """Return the memory of pulses with the first pulse of a move in progress, or, if none is worth it, without."""
    pulses = memory.pulses
    period_s = sampled.now_s - pulses.now_s
    move = pulses.move if pulses.move is not None and pulses.move.target_m == reference_m else Move(reference_m)
    ratios = _line_at(reference_m, balance)
    pulses = replace(pulses, now_s=sampled.now_s, move=replace(move, ended_s=None), ratios=ratios)
    if not period_s > 0.0:
        return pulses
    worth = _worth(memory.slides, observation, reference_m, balance, settings)
    return breakaway_law.next_pulse(_told(pulses, memory.slides.margins), period_s, ratios, settings.pulses, worth)


def _told(pulses: BreakawayMemory, margins: Margins) -> BreakawayMemory:
    """Return the memory of pulses with what slides have learnt of break-away, where no pulse has."""
    for s in (1, -1):
        margin = margins.of(s, turning=True)
        if margin.held_m and margin.broke_m and not pulses.push_in(s).moved:
            pulses = pulses.with_push_in(s, LearntPush(margin.broke_m, moved=True))
    return pulses


def _pulsing(
    memory: MoveMemory,
    sampled: Observation,
    observation: StemObservation,
    reference_m: float,
    balance: Balance,
    estimates: Estimates,
    settings: MoveSettings,
) -> MoveMemory:
    """Let pulses have the stem, or give it to slides where a slide does more."""
    pulses = memory.pulses
    if pulses.move is None or pulses.move.target_m != reference_m:
        pulses = replace(pulses, ratios=_line_at(reference_m, balance))
    slides = _beside_pulses(memory.slides, pulses, observation.now_s, reference_m)
    ratios = balance.ratios if pulses.ratios is None else pulses.ratios
    worth = _worth(slides, observation, reference_m, balance, settings)
    pulses = breakaway_law.step(pulses, sampled, reference_m, ratios, estimates, settings.pulses, worth)
    move = pulses.move
    if not sampled.usable or move is None or move.ended_s is None or _is_there(pulses, move, settings):
        return MoveMemory(
            pulses, slides, True, memory.identified, memory.declined, memory.given_up, pulses.inhibit_reason
        )
    stuck = pulses.inhibit_reason is InhibitReason.STUCK or move.pulses >= breakaway_law.MOST_PULSES
    before = _handed_over(slides, pulses, reference_m)
    slides = _by_slides(before, pulses, observation, reference_m, balance, settings)
    return replace(
        memory,
        pulses=pulses,
        slides=slides,
        by_pulses=bool(slides.level_pa == before.level_pa),
        declined=(reference_m, before.slides),
        given_up=memory.given_up or stuck,
        inhibit_reason=slides.inhibit_reason,
    )


def _beside_pulses(slides: SlideMemory, pulses: BreakawayMemory, now_s: float, reference_m: float) -> SlideMemory:
    """Return the memory of slides while pulses have the stem: the course of the reference, the last direction."""
    slides = slides.asked(now_s, reference_m)
    trial = None if pulses.in_progress is None else pulses.in_progress.trial
    if trial is not None and trial.pulse.direction != slides.anchor.direction:
        slides = replace(slides, anchor=Anchor(nan, trial.pulse.direction))
    return slides


def _is_there(pulses: BreakawayMemory, move: Move, settings: MoveSettings) -> bool:
    """Whether pulses have ended too near for two slides, whatever the dead band was widened to."""
    within_m = max(NEAR_ENOUGH * settings.pulses.dead_band_m, breakaway_law.WITHIN_NOISE * pulses.rest.error_m)
    return abs(move.target_m - move.ended_at_m) <= within_m


def _worth(
    slides: SlideMemory,
    observation: StemObservation,
    reference_m: float,
    balance: Balance,
    settings: MoveSettings,
) -> Worth:
    """Return what says whether a pulse is worth giving: the table at the head of this module."""

    def worth(pulses: BreakawayMemory, pulse: PlannedPulse) -> bool:
        if pulse.trial.shortest_m > STOPPED * pulse.trial.pulse.push_m:
            return False
        if pulse.left_m <= pulse.dead_m or pulse.left_m >= pulse.trial.shortest_m:
            return True
        if pulse.left_m <= UNSURE * pulses.response.std_m(pulse.trial.pulse):
            return True
        before = _handed_over(slides, pulses, reference_m)
        return _by_slides(before, pulses, observation, reference_m, balance, settings).level_pa == before.level_pa

    return worth


def _handed_over(slides: SlideMemory, pulses: BreakawayMemory, reference_m: float) -> SlideMemory:
    """Return the memory of slides to which pulses leave a stem at rest."""
    return replace(
        slides,
        level_pa=pulses.level_pa,
        target_m=reference_m,
        anchor=Anchor(pulses.rest.mean_m, slides.anchor.direction),
        last_m=nan,
        margins=_pushed(pulses) if slides.margins is NO_MARGINS else slides.margins,
    )


def _by_slides(
    slides: SlideMemory,
    pulses: BreakawayMemory,
    observation: StemObservation,
    reference_m: float,
    balance: Balance,
    settings: MoveSettings,
) -> SlideMemory:
    """Return the memory of slides after the step in which they take over a stem at rest."""
    known = pulses.rest
    rest = Rest(known.mean_m, known.error_m, known.std_m, known.count, 0.0)
    return slide_law.step(slides, replace(observation, rest=rest, outcome=None), reference_m, balance, settings.slides)


def _pushed(pulses: BreakawayMemory) -> Margins:
    """Return the margins of slides as pulses have learnt them: no slide has broken loose by less than a push."""
    up, down = (
        Margin(HELD * push.push_m, push.push_m) if push.moved else Margin() for push in (pulses.up, pulses.down)
    )
    return Margins(up, down, up, down) if pulses.up.moved or pulses.down.moved else NO_MARGINS


def _line_at(reference_m: float, balance: Balance) -> Ratios:
    """Return the straight law that says at a place, m, what slides know of it."""
    up_pa, down_pa = (balance.pressure_pa(reference_m, s) for s in (1, -1))
    friction_pa = 0.5 * (up_pa - down_pa)
    if not friction_pa > 0.0:
        return balance.ratios
    slope = balance.ratios.b_over_c
    return Ratios(slope, -friction_pa, 0.5 * (up_pa + down_pa) + slope * reference_m)
