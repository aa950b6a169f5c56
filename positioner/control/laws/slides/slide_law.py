"""The law of slides: a stem that slides into rest lands where spring and friction balance, however slow the loop.

    B(x, s)    pressure under which a slide in direction s lands at x            (slide_balance.py)
    m_s        shortest slide that breaks loose in direction s, (F_s - F_c)/k_s  (learnt: slide_margins.py; at another
                                                                place: margins_over_travel.py)

With the stem at rest at x, e = r - x and s = sign(e):

    abs(e) <= dead band              nothing
    abs(e) >= m_s                    one slide:   u = B(r, s)
    else                             two slides:  u = B(r + s M, s), wait until it rests, u = B(r, -s)
                                                  M = max(1.02 m_-s, m_s - abs(e))

The first of two slides leaves the way between x and r by M: an excursion. The second is given as soon as the stem has
slid, is farther than m_-s beyond r, and will go no farther; it need not rest. An excursion goes the other way round, by
r - s M' with M' = max(1.02 m_s, m_-s + abs(e)), where it leaves the way between by less, M' - abs(e) < M, for the
margins of turning and of going on differ. Or where one of the two would leave the travel or the pressure limits. To
1.02 m comes what sensor and device round: a first slide that fell so much short would leave no way back. Only resting
times depend on the period of the loop, not where the stem lands.

While the stem moves, a reference that lies two margins from it is followed at once; a nearer one waits for the rest. A
stem that does not come to rest, off its reference, is not moved, and that is said.
While references keep coming, one slide lands ahead of a ramp, and two are given only for an error that the coming ones
do not take back (reference_course.py).
Why there is no limit cycle: what a slide missed corrects B for the next (each miss is a fraction of the one before),
the dead band widens from slide to slide, and their number is limited. After the end of a move nothing happens until the
reference changes, or something else has visibly moved the stem.

A stem that slides in a row do not break loose makes its margins longer until a bound bars the next: the limit of an
excursion, the pressure, the number of slides. Then it is stuck, whichever bound it was, and the margins are those from
before the row (`_barred`).
"""

from dataclasses import replace
from math import isnan, nan
from typing import NamedTuple

from config.codes import InhibitReason
from positioner.control.laws.slides.slide_balance import Balance
from positioner.control.laws.slides.slide_memory import (
    CREEP,
    DAY_S,
    NONE_HELD,
    NOWHERE,
    Anchor,
    Held,
    SlideMemory,
    SlideSettings,
    StemObservation,
)
from positioner.estimation.landings.landing_detector import STOP, SlideOutcome
from positioner.estimation.landings.slide_margins import BESIDE, GROWS, NO_MARGINS, Margin

RETURN = 1.02
"""Margins that the second slide is given, for a stem must not stay where the first took it."""
UNLIKE = 2.0
"""Factor by which static friction may differ up and down, where slides in one direction were long ones only."""
MISSED, SURELY, GAVE_WAY = 0.05, 2.0, 0.5
"""Of its way, and of the deviation of landings: by which a slide may miss its aim; of its way: beyond it was none."""
JUMPED, GONE_ON = 1.1, 2.0
"""Of its way: a stem that went farther jumped there, for none goes less far; from farther still it has crept there, or
been pushed."""
LEAST = 5.1e-3
"""Of the stroke: a slide shorter than this would not be seen for one."""
TRIED = 2
"""Slides of a move that may be as short as may break loose."""
FIRST_MARGIN = 0.1
"""Of F_c/k_s: the first margin, where nothing is known of static friction."""
ROUNDED = 0.5
"""Quanta by which a position may be rounded."""
OTHER_SIDE = 1.05
"""Factor on how far an excursion by the other side leaves the way between, for it takes longer."""
SLOW, WHILE_S = 2e-3, 0.02
"""Of the stroke: an excursion that will go no farther has done its work; in which time its speed is seen."""
FAR = 2.0
"""Margins beyond which a stem that moves is sent the other way."""
WITHIN_NOISE, WITHIN_QUANTUM = 2.5, 0.6
"""Deviations of a mean, and quanta, that an error may be."""
WIDENS, FREE_SLIDES = 1.5, 2
"""Factor on the dead band for each two slides beyond the first few."""
MOST_SLIDES = 14
"""Given for one reference."""
REFILL_S = 60.0
"""At rest, after this time each, two slides come back to the number that is left."""
STUCK_AFTER = 3
"""Slides in a row that break nothing loose, each as long as has: one may be luck, and friction grows."""


def while_not_commanding(memory: SlideMemory, command_pa: float) -> SlideMemory:
    """Return the memory while another state commands: nothing of a move, nor of what seems to hold the stem."""
    return replace(
        memory,
        slides=0,
        margins=memory.learnt,
        held=NONE_HELD,
        level_pa=command_pa,
        target_m=None,
        direction=0,
        aim_m=nan,
        excursion=False,
        anchor=NOWHERE,
        inhibit_reason=InhibitReason.NOTHING,
    )


def step(
    memory: SlideMemory, observation: StemObservation, reference_m: float, balance: Balance, settings: SlideSettings
) -> SlideMemory:
    """Return what is remembered after one step of the law; its `level_pa` is the pressure asked for."""
    if not observation.usable:
        return memory
    if memory.margins is NO_MARGINS:
        memory = _first_margins(memory, balance, settings)
    if observation.outcome is not None:
        memory = _learnt(memory, observation.outcome, observation.quantum_m, balance, settings)
    memory = memory.asked(observation.now_s, reference_m)
    reference_m = _asked_m(memory, observation, settings)
    if observation.rest is None and _far_enough(memory, observation, reference_m, settings):
        memory = _broken_loose(memory, observation, settings)
        return _slide(memory, observation.now_s, reference_m, -memory.direction, balance, settings, excursion=False)
    if memory.excursion and observation.rest is None:
        memory = replace(memory, return_pa=_return_pa(memory, observation.position_m, balance, settings))
    if memory.excursion and _seen_for_a_while(memory, observation):
        memory = replace(memory, last_m=observation.position_m, last_s=observation.now_s)
    if observation.rest is None:
        return _waiting(_redirected(memory, observation, reference_m, balance, settings), observation, settings)
    if reference_m != memory.target_m:
        memory = replace(memory, target_m=reference_m, inhibit_reason=InhibitReason.NOTHING)
    return _next_slide(memory, observation, balance, settings)


def _asked_m(memory: SlideMemory, observation: StemObservation, settings: SlideSettings) -> float:
    """Return where the stem is to be, m: the reference, or, where that takes two slides, what it scatters about.

    A stem that stands on its reference stays there.
    """
    course = memory.course
    if not course.changes_m:
        return course.value_m
    stands_m = observation.position_m if observation.rest is None else observation.rest.position_m
    error_m = course.value_m - stands_m
    ways_m = {s: _way_m(memory, memory.margins.of(s, turning=True), settings) for s in (1, -1)}
    reached = not memory.excursion and abs(error_m) >= ways_m[1 if error_m > 0 else -1]
    if reached or abs(error_m) <= settings.dead_band_m:
        return course.value_m
    return course.middle_m(observation.now_s, min(ways_m.values()))


def _far_enough(memory: SlideMemory, observation: StemObservation, reference_m: float, settings: SlideSettings) -> bool:
    """Whether the first of two slides has done its work: then the stem need not rest there.

    What follows a slow pressure goes on, at a speed v, for about as long as it has taken until now: by v t.
    """
    if not memory.excursion or not _seen_for_a_while(memory, observation):
        return False
    s, went_m = memory.direction, abs(observation.position_m - memory.last_m)
    goes_on = (observation.now_s - memory.slide_s) / (observation.now_s - memory.last_s)
    beyond_m = min(s * (each - reference_m) for each in (observation.position_m, memory.last_m))
    if s * (memory.anchor.position_m - reference_m) > 0.0 and not _has_slid(memory, observation.position_m, settings):
        return False  # it was beyond before
    return (
        beyond_m > _way_m(memory, memory.margins.of(-s, turning=True), settings)
        and (went_m - observation.quantum_m) * goes_on < SLOW * settings.stroke_m
    )


def _has_slid(memory: SlideMemory, position_m: float, settings: SlideSettings) -> bool:
    """Whether the stem has gone farther in its slide than a packing gives way."""
    way_m, went_m = _way_and_went_m(memory, position_m)
    return went_m > min(CREEP * settings.stroke_m, GAVE_WAY * way_m)


def _way_and_went_m(memory: SlideMemory, position_m: float) -> tuple[float, float]:
    """Return how far the slide under way is to go from where the stem stood, m, and how far it has gone."""
    s, from_m = memory.direction, memory.anchor.position_m
    return s * (memory.aim_m - from_m), s * (position_m - from_m)


def _seen_for_a_while(memory: SlideMemory, observation: StemObservation) -> bool:
    """Whether where the stem was is known from long enough ago to tell how fast it goes; by rounding, not quite."""
    return observation.now_s - memory.last_s > (1.0 - 1e-6) * WHILE_S


def _broken_loose(memory: SlideMemory, observation: StemObservation, settings: SlideSettings) -> SlideMemory:
    """Return the memory of a slide that is sent elsewhere before it rests: no rest will say so, but it has slid."""
    s, position_m = memory.direction, observation.position_m
    way_m, went_m = _way_and_went_m(memory, position_m)
    sent_back = replace(memory, anchor=Anchor(position_m, s))
    if not _has_slid(memory, position_m, settings):
        return sent_back
    if not memory.anchor.direction or not (1.0 - MISSED) * way_m < went_m < GONE_ON * way_m:
        return replace(sent_back, held=NONE_HELD)
    turning = s != memory.anchor.direction
    margin = memory.margins.own(s, turning=turning)
    jumped = went_m > max(JUMPED * way_m, way_m + observation.quantum_m)
    margin = margin.after_jumping(way_m, went_m) if jumped else margin.after_breaking(went_m)
    return replace(sent_back, held=NONE_HELD, margins=memory.margins.replaced(s, margin, turning=turning))


def _first_margins(memory: SlideMemory, balance: Balance, settings: SlideSettings) -> SlideMemory:
    """Return the memory with first margins: the shortest slide seen, and the longest way before that held."""
    guess_m = FIRST_MARGIN * balance.friction_m
    if settings.breakaway_pa is not None:
        guess_m = max(guess_m, (settings.breakaway_pa + balance.ratios.k_over_c) / -balance.ratios.b_over_c)
    at_m = memory.margins_at_m
    slid_m = {
        s: min(
            (
                abs(each.position_m - each.from_m) * balance.grows(each.from_m, at_m, s)
                for each in balance.landings
                if each.direction == s
            ),
            default=guess_m,
        )
        / (1.0 - balance.swing)
        for s in (1, -1)
    }
    margins = memory.margins
    for s in (1, -1):
        shortest_m = min(slid_m[s], UNLIKE * slid_m[-s])
        ways_m = (
            balance.way_m(each) * balance.grows(each.from_m, at_m, s) for each in balance.held if each.direction == s
        )
        held_m = max((way_m for way_m in ways_m if way_m < shortest_m), default=0.0)
        guessed = settings.breakaway_pa is None and not any(each.direction == s for each in balance.landings)
        margins = margins.replaced(s, Margin(max(0.0, held_m), shortest_m, guessed=guessed), turning=False)
    return replace(memory, margins=margins)


def _learnt(
    memory: SlideMemory, outcome: SlideOutcome, quantum_m: float, balance: Balance, settings: SlideSettings
) -> SlideMemory:
    """Return the memory after a slide: its margin, and where the stem stands. A slide onto a stop says nothing.

    A stem that breaks loose lands where it is to. One that goes not half as far, and no farther than a packing gives
    way, did not. One that lands elsewhere, as behind a slow I/P, has slid, and its way says nothing of the margin. If
    that is not half as far, friction has grown: nor do the slides before it that held, by a balance that is no more.
    One that rests where it was to, as far as is seen, has slid, though it came there so slowly that it seemed to creep.
    What may be either, for it went elsewhere, is a slide where its way has been seen to break loose; of a stem that
    turns round it was too short, for a soft packing gives way, where a longer one has landed; and that however far
    landings scatter.
    """
    s, to_m = outcome.direction, outcome.position_m
    if outcome.moved and not outcome.landing:
        return replace(memory, anchor=NOWHERE, held=NONE_HELD)
    ours = s == memory.direction and not isnan(memory.aim_m)
    anchor = memory.anchor.at(outcome.from_m, settings.stroke_m)
    turning = s != anchor.direction
    way_m = s * (memory.aim_m - anchor.position_m) if ours else balance.way_m(outcome)
    missed_m = abs(memory.aim_m - to_m) if ours else 0.0
    short = missed_m > GAVE_WAY * way_m
    arrived = ours and missed_m <= max(MISSED * way_m, quantum_m)
    slid = arrived or (outcome.moved and (not short or abs(to_m - outcome.from_m) > CREEP * settings.stroke_m))
    unsure_m = max(SURELY * balance.scatter_m, settings.dead_band_m, outcome.std_m, quantum_m)
    hit = slid and missed_m <= max(MISSED * way_m, unsure_m)
    known = memory.learnt if slid and short else memory.margins
    margin = known.own(s, turning=turning)
    landed, went_m = replace(memory, held=NONE_HELD, anchor=Anchor(to_m, s)), s * (to_m - anchor.position_m)
    if not slid and 0.0 < margin.seen_m <= way_m and went_m > GAVE_WAY * way_m:
        return landed
    if not slid:
        return _after_holding(replace(memory, anchor=anchor), s, way_m)
    beside = not short and missed_m > max(MISSED * way_m, settings.dead_band_m, quantum_m)
    again = beside and balance.tried(way_m, s) > 1
    if again and ours and s * (to_m - memory.aim_m) > 0.0:
        margin = margin.after_jumping(way_m, went_m)
    elif again and turning and BESIDE * way_m < margin.seen_m:
        margin = margin.after_holding(way_m)
    elif hit and anchor.direction:
        margin = margin.after_breaking(went_m)
    return replace(landed, margins=known.replaced(s, margin, turning=turning))


def _after_holding(memory: SlideMemory, direction: int, way_m: float) -> SlideMemory:
    """Return the memory after a slide meant to go a way, m, that did not break the stem loose."""
    turning = direction != memory.anchor.direction
    margin = memory.margins.own(direction, turning=turning).after_holding(way_m)
    held, before = memory.held, memory.learnt.of(direction, turning=turning)
    if way_m >= before.sure_m:
        held = held.one_more(memory.margins, surely=0.0 < before.seen_m <= way_m)
    return replace(memory, margins=memory.margins.replaced(direction, margin, turning=turning), held=held)


def _redirected(
    memory: SlideMemory, observation: StemObservation, reference_m: float, balance: Balance, settings: SlideSettings
) -> SlideMemory:
    """Follow a reference that changes while the stem moves, where that can be done at once."""
    target_m = memory.target_m
    if target_m is None or reference_m == target_m:
        return replace(memory, target_m=reference_m)
    s = 1 if reference_m > observation.position_m else -1
    way_m = abs(reference_m - observation.position_m)
    if way_m < FAR * memory.margins.of(s, turning=True).sure_m:
        return memory
    if not isnan(memory.aim_m) and _has_slid(memory, observation.position_m, settings):
        memory = _broken_loose(memory, observation, settings)
    level_pa = min(max(balance.pressure_pa(reference_m, s), settings.minimum_pa), settings.maximum_pa)
    return replace(
        memory,
        level_pa=level_pa,
        target_m=reference_m,
        direction=s,
        aim_m=nan,
        excursion=False,
        slides=1,
        slide_s=observation.now_s,
        inhibit_reason=InhibitReason.STUCK if memory.held.stuck else InhibitReason.NOTHING,
    )


def _waiting(memory: SlideMemory, observation: StemObservation, settings: SlideSettings) -> SlideMemory:
    """Say why the stem is off its reference and is not moved: it does not come to rest, or not under what is commanded.

    Said once, that stays until it does.
    """
    assert memory.target_m is not None
    off = abs(memory.target_m - observation.position_m) > settings.dead_band_m + observation.quantum_m
    return _because(memory, observation.waits_for) if off and observation.waits_for else memory


def _next_slide(
    memory: SlideMemory, observation: StemObservation, balance: Balance, settings: SlideSettings
) -> SlideMemory:
    """End the move, or give the next slide."""
    rest, target_m = observation.rest, memory.target_m
    assert rest is not None
    assert target_m is not None
    error_m = target_m - rest.position_m
    landed = memory.slides - memory.held.slides  # those that held have missed nothing
    widened = WIDENS ** (max(0, landed - FREE_SLIDES) // 2)
    beside_m = _beside_m(balance, settings)
    known_m = max(WITHIN_NOISE * rest.std_m, WITHIN_QUANTUM * observation.quantum_m) + beside_m
    band_m = max(settings.dead_band_m, known_m)
    if abs(error_m) <= band_m:
        return _because(memory, InhibitReason.NOTHING)
    # Another slide would miss as the ones before have: where they scatter by more than they are wanted to, so will it.
    scatter_m = balance.scatter_m if landed > FREE_SLIDES else 0.0
    if abs(error_m) <= max(band_m, scatter_m) * widened or _on_stop(memory, rest.position_m, balance):
        return _because(memory, InhibitReason.TRIM_ENDED)
    if memory.held.stuck and abs(rest.position_m - memory.held.at_m) > CREEP * settings.stroke_m:
        memory = replace(memory, held=NONE_HELD, slides=0)
    again = int((observation.now_s - memory.slide_s) / REFILL_S) if memory.slides else 0
    memory = replace(memory, slides=max(0, memory.slides - 2 * again)) if again else memory
    if memory.slides >= MOST_SLIDES:
        return _barred(memory, InhibitReason.TRIM_ENDED, rest.position_m, balance, settings)
    s = 1 if error_m > 0 else -1
    anchor = memory.anchor.at(rest.position_m, settings.stroke_m)
    memory = replace(memory, anchor=anchor)
    way_m = _way_m(memory, memory.margin(s), settings)
    if memory.excursion and s == -memory.direction:  # planned by what may do: it is tried before more is asked for
        least_m = LEAST * settings.stroke_m - _rounded_m(observation, balance, settings)
        way_m = min(way_m, max(memory.margin(s).way_m, least_m))
    to_m = target_m + _lead_m(memory, observation.now_s, s, way_m, balance, settings)
    asked_m = s * (to_m - anchor.position_m)
    if asked_m >= way_m:
        if memory.held.stuck or memory.level_pa != balance.slide_pa(anchor.position_m, to_m, s):
            return _slide(memory, observation.now_s, to_m, s, balance, settings, excursion=False)
        memory = _after_holding(memory, s, asked_m)  # under that pressure it rests: a redirected slide has no outcome
    if memory.course.takes_back(observation.now_s, error_m, way_m, memory.away_s):
        return _because(memory, InhibitReason.REFERENCE_COMES)
    return _excursion(memory, observation, balance, settings)


def _on_stop(memory: SlideMemory, rest_m: float, balance: Balance) -> bool:
    """Whether the last slide went onto a stop, beyond a target beside it, though sent no farther, or short of one.

    Another one would, too: the stop bears the rest, so that it says nothing of the balance.
    """
    s, target_m, beside_m = memory.direction, memory.target_m, STOP * balance.stroke_m
    stop_m = balance.stops_m[s > 0]
    assert target_m is not None
    if memory.excursion or abs(stop_m - rest_m) > beside_m:
        return False
    if s * (target_m - stop_m) > 0.0:
        return s * (memory.aim_m - stop_m) > 0.0
    beyond = s * (memory.aim_m - target_m) <= 0.0 < s * (rest_m - target_m)
    return beyond and abs(stop_m - target_m) <= beside_m


def _because(memory: SlideMemory, reason: InhibitReason) -> SlideMemory:
    """Return the memory with the reason why nothing is done: the same one, if it says so already, as in most steps.

    Of a stem that nothing has broken loose, and that is not where it is to be, no other reason matters. As long as no
    bound bars a longer slide, slides that only a guess says to be long enough tell nothing.
    """
    holds = memory.held.stuck or memory.held.surely >= STUCK_AFTER
    reason = InhibitReason.STUCK if holds and reason is not InhibitReason.NOTHING else reason
    return memory if memory.inhibit_reason is reason else replace(memory, inhibit_reason=reason)


def _barred(
    memory: SlideMemory, reason: InhibitReason, rest_m: float, balance: Balance, settings: SlideSettings
) -> SlideMemory:
    """End the move where a bound bars a longer slide: for that reason, or, where nothing breaks loose, for that.

    A stem is stuck that slides in a row have not moved, each as long as has broken it loose before, or one that was to
    go the whole way. Whichever bound they met, their margins are not believed: the next reference is tried with those
    known before, and what is held until then brings a stem that comes free to its reference, not to where the last push
    would have.
    """
    assert memory.target_m is not None
    held, error_m = memory.held, memory.target_m - rest_m
    s = 1 if error_m > 0 else -1
    broke_m = held.margins.of(s, turning=s != memory.anchor.direction).seen_m
    if not held.slides or not (held.stuck or held.slides >= STUCK_AFTER or abs(error_m) >= broke_m > 0.0):
        return _because(memory, reason)
    level_pa = min(max(balance.slide_pa(rest_m, memory.target_m, s), settings.minimum_pa), settings.maximum_pa)
    return replace(
        memory,
        level_pa=level_pa,
        direction=0,
        aim_m=nan,
        excursion=False,
        slides=MOST_SLIDES,
        margins=memory.learnt,
        held=Held(at_m=rest_m),
        inhibit_reason=InhibitReason.STUCK,
    )


def _lead_m(
    memory: SlideMemory, now_s: float, direction: int, way_m: float, balance: Balance, settings: SlideSettings
) -> float:
    """Return how far ahead of a ramp to land, m, where the site's bounds let it."""
    lead_m = memory.course.lead_m(now_s, way_m)
    assert memory.target_m is not None
    to_m = memory.target_m + lead_m
    low_m, high_m = balance.stops_m
    ahead = 0.0 < direction * lead_m <= settings.excursion_limit_m and low_m <= to_m <= high_m
    within = ahead and settings.minimum_pa <= balance.pressure_pa(to_m, direction) <= settings.maximum_pa
    return lead_m if within else 0.0


def _beside_m(balance: Balance, settings: SlideSettings) -> float:
    """Return how far beside its aim a slide may land, m, where the device is told whole numbers: by half a step."""
    return 0.5 * settings.command_step_pa / -balance.ratios.b_over_c


def _rounded_m(observation: StemObservation, balance: Balance, settings: SlideSettings) -> float:
    """Return by how much sensor and device round where a slide lands, m."""
    return ROUNDED * observation.quantum_m + _beside_m(balance, settings)


def _way_m(memory: SlideMemory, margin: Margin, settings: SlideSettings) -> float:
    """Return how far a slide must be sent, m: at first in a move as short as may do, then as surely does.

    What surely does may be longer than an excursion may, where none but long ones have been seen: what lies between is
    tried.
    """
    return max(_breaks_loose_m(memory, margin, settings), LEAST * settings.stroke_m)


def _breaks_loose_m(memory: SlideMemory, margin: Margin, settings: SlideSettings) -> float:
    """Return how far a slide must be sent to break loose, m, be it seen for a slide or not."""
    surely = memory.slides >= TRIED and margin.seen_m <= settings.excursion_limit_m
    return min(margin.sure_m, GROWS * margin.way_m) if surely else margin.way_m


def _excursion(
    memory: SlideMemory, observation: StemObservation, balance: Balance, settings: SlideSettings
) -> SlideMemory:
    """Give the first of two slides, by whichever side it may."""
    target_m, now_s = memory.target_m, observation.now_s
    assert target_m is not None
    assert observation.rest is not None
    # A stem that the first of two slides has left away, for the second was too short, does not wait there.
    error_m = target_m - memory.anchor.position_m
    back_m = _back_m(memory, 1 if error_m > 0 else -1, observation, balance, settings)
    left_away = memory.slides > 0 and abs(error_m) > 0.5 * back_m
    if now_s - memory.excursion_s < settings.excursion_interval_s and not left_away:
        return _because(memory, InhibitReason.EXCURSION_WAITS)
    why = InhibitReason.EXCURSION_BEYOND_LIMIT
    low_m, high_m = balance.stops_m
    for direction, by_m, beyond_m in _ways_round(memory, target_m, observation, balance, settings):
        if abs(by_m - target_m) > settings.excursion_limit_m or not low_m <= by_m <= high_m:
            continue
        both_pa = balance.pressure_pa(by_m, direction), balance.pressure_pa(target_m, -direction)
        if not all(settings.minimum_pa <= each <= settings.maximum_pa for each in both_pa):
            why = InhibitReason.LAW_BEYOND_LIMITS
            continue
        spent_m = memory.spent_at_m(now_s, settings) + 2 * beyond_m
        if 0.0 < settings.budget_m_per_s * DAY_S < spent_m and not left_away:
            why = InhibitReason.EXCURSION_BUDGET_SPENT
            continue
        memory = replace(memory, excursion_s=now_s, spent_m=spent_m, last_m=observation.position_m, last_s=now_s)
        memory = _slide(memory, now_s, by_m, direction, balance, settings, excursion=True)
        return replace(memory, return_pa=_return_pa(memory, memory.anchor.position_m, balance, settings))
    if why is InhibitReason.EXCURSION_BUDGET_SPENT:
        return _because(memory, why)
    return _barred(memory, why, observation.rest.position_m, balance, settings)


class _WayRound(NamedTuple):
    """An excursion: the direction of its first slide, by which place it goes, and how far beyond the way between, m."""

    direction: int
    by_m: float
    beyond_m: float


def _ways_round(
    memory: SlideMemory, target_m: float, observation: StemObservation, balance: Balance, settings: SlideSettings
) -> list[_WayRound]:
    """Return the excursions by either side, first the one that leaves the way between stem and target by less.

    What a slide of the move has left beside its target is off that way already, and while references keep coming there
    is none: then it is the one that leaves the target by less.
    """
    error_m = target_m - memory.anchor.position_m
    s, way_m = (1 if error_m > 0 else -1), abs(error_m)
    there = {each: _way_m(memory, memory.margin(each), settings) for each in (1, -1)}
    back = {each: _back_m(memory, each, observation, balance, settings) for each in (1, -1)}
    on_m, round_m = max(back[-s], there[s] - way_m), max(back[s], there[-s] + way_m)
    by_its_side = _WayRound(s, target_m + s * on_m, on_m)
    by_the_other = _WayRound(-s, target_m - s * round_m, round_m - way_m)
    leaves_m = round_m if memory.slides or memory.course.changes_m else OTHER_SIDE * by_the_other.beyond_m
    return [by_its_side, by_the_other] if on_m <= leaves_m else [by_the_other, by_its_side]


def _back_m(
    memory: SlideMemory, direction: int, observation: StemObservation, balance: Balance, settings: SlideSettings
) -> float:
    """Return how far beyond its target a stem is sent, m, that is to come back by a slide in a direction."""
    turning_m = _breaks_loose_m(memory, memory.margins.of(direction, turning=True), settings)
    return max(RETURN * turning_m + _rounded_m(observation, balance, settings), LEAST * settings.stroke_m)


def _return_pa(memory: SlideMemory, position_m: float, balance: Balance, settings: SlideSettings) -> float:
    """Return what to hold, Pa, if something interrupts the first of two slides now.

    From beyond a margin that has broken loose the stem comes back to its target. From nearer it might not break loose:
    it goes as far beyond the target on the other side as it lacks, if that is nearer than where it is.
    """
    assert memory.target_m is not None
    s, target_m = memory.direction, memory.target_m
    goes_on_m = 0.0 if isnan(memory.last_m) else position_m - memory.last_m
    beyond_m = s * (position_m + goes_on_m - target_m)
    lacks_m = RETURN * memory.margins.of(-s, turning=True).sure_m - beyond_m
    to_m = target_m - s * max(0.0, lacks_m) if beyond_m > lacks_m else target_m
    return min(max(balance.slide_pa(position_m, to_m, -s), settings.minimum_pa), settings.maximum_pa)


def _slide(
    memory: SlideMemory,
    now_s: float,
    to_m: float,
    direction: int,
    balance: Balance,
    settings: SlideSettings,
    *,
    excursion: bool,
) -> SlideMemory:
    wanted_pa = balance.slide_pa(memory.anchor.position_m, to_m, direction)
    level_pa = min(max(wanted_pa, settings.minimum_pa), settings.maximum_pa)
    if level_pa == memory.level_pa:  # nothing would change: what the stem does not do now it will not do then
        return replace(memory, slides=MOST_SLIDES, slide_s=now_s)
    reason = InhibitReason.NOTHING if level_pa == wanted_pa else InhibitReason.LAW_BEYOND_LIMITS
    return replace(
        memory,
        level_pa=level_pa,
        direction=direction,
        aim_m=to_m if level_pa == wanted_pa else nan,
        excursion=excursion,
        slides=memory.slides + 1,
        slide_s=now_s,
        away_s=now_s - memory.slide_s if memory.excursion and not excursion else memory.away_s,
        inhibit_reason=InhibitReason.STUCK if memory.held.stuck else reason,
    )
