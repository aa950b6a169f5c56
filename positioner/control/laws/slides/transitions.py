"""Which state of the law of slides follows which, and when: `TABLE`, whose first rule that holds is followed.

While the stem moves, the second of two slides is given as soon as the first has slid, is farther than break-away beyond
the reference, and will go no farther; a reference far from the stem is followed at once; a nearer one waits for the
rest. At rest the move ends, or the next slide is given (`plan.py`). A rule is asked of a plan: the move from where the
stem is seen, or rests, by what is remembered.

Why there is no limit cycle: what a slide missed corrects B for the next (each miss is a fraction of the one before),
the dead band widens from landing to landing, and the slides of a move are numbered. After its end nothing happens until
the reference changes, or something else has visibly moved the stem.

A stem that slides in a row do not break loose is sent farther each time, until a bound bars the next: the limit of an
excursion, the pressure, the number of slides. Then it is stuck, whichever bound it was, and what is known of break-away
is what was known before the row. That it is stuck is known of the stem (`Row.stuck_at_m`), and outlives the state: each
new reference is tried again.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from config.codes import InhibitReason
from positioner.control.laws.slides.now import Now
from positioner.control.laws.slides.plan import Plan, shortest_seen_m
from positioner.control.laws.slides.slide_memory import Excursions, Move, Row, SlideMemory
from positioner.control.laws.slides.slide_states import Idle, Out, Presliding, Slide, Sliding, State, Watching, slide_of
from positioner.control.laws.slides.teaching import sent_elsewhere, slid_away
from positioner.estimation.landings.landing_detector import STOP
from positioner.estimation.landings.stem_at_rest import Rest

NOTHING = InhibitReason.NOTHING


# While the stem moves, or may yet move.


def gone_far_enough(plan: Plan) -> SlideMemory | None:
    """Give the second of two slides: the first has done its work, and the stem need not rest there.

    What follows a slow pressure goes on, at a speed v, for about as long as it has taken until now: by v t.
    """
    memory, now = plan.memory, plan.now
    state, position_m, thresholds = memory.state, now.position_m, now.bounds.thresholds
    if not isinstance(state, Out) or not _seen_for_a_while(state, now):
        return None
    slide, s = state.slide, state.slide.direction
    if s * (slide.from_m - now.reference_m) > 0.0 and not slid_away(slide, position_m, now.bounds):
        return None  # it was beyond before
    beyond_m = min(s * (each - now.reference_m) for each in (position_m, state.seen_m))
    went_m = abs(position_m - state.seen_m)
    goes_on = (now.now_s - state.given_s) / (now.now_s - state.seen_s)
    if (went_m - now.quantum_m) * goes_on >= thresholds.no_farther * now.bounds.stroke_m:
        return None
    if beyond_m <= plan.way_m(-s, turning=True):
        return None
    plan = replace(plan, memory=sent_elsewhere(memory, slide, now))
    return _slide(plan, plan.slide(now.reference_m, -s))


def reference_far_off(plan: Plan) -> SlideMemory | None:
    """Follow a reference that changes while the stem moves, where that can be done at once."""
    memory, now = plan.memory, plan.now
    position_m, reference_m = now.position_m, now.reference_m
    if memory.target_m is None or reference_m == memory.target_m:
        return None
    s = 1 if reference_m > position_m else -1
    sure_m = plan.interval(s, turning=True).sure_m
    if abs(reference_m - position_m) < now.bounds.thresholds.far * sure_m:
        return None
    slide = slide_of(memory.state)
    if slide is not None and slid_away(slide, position_m, now.bounds):
        memory = sent_elsewhere(memory, slide, now)
    command_pa = now.bounds.allowed_pa(now.balance.pressure_pa(reference_m, s))
    move = Move(now.bounds.thresholds.most_slides).given(now.now_s, None)
    return replace(memory, command_pa=command_pa, target_m=reference_m, move=move, state=Sliding(None))


def overdue(plan: Plan) -> SlideMemory | None:
    """Say why the stem is off its reference and is not moved; said once, that stays until it rests."""
    state, why, now, target_m = plan.memory.state, plan.now.waits_for, plan.now, plan.memory.target_m
    if why is NOTHING or target_m is None or isinstance(state, Watching) or state.reason is why:
        return None
    near = abs(target_m - now.position_m) <= now.bounds.dead_band_m + now.quantum_m
    return None if near else replace(plan.memory, state=replace(state, reason=why))


def on_its_way(plan: Plan) -> SlideMemory:
    """Go on; of an excursion, with what brings it back from where it is."""
    memory, now = plan.memory, plan.now
    state, position_m = memory.state, now.position_m
    if not isinstance(state, Out):
        return memory if memory.target_m is not None else replace(memory, target_m=now.reference_m)
    back_pa = plan.back_pa(state.slide.direction, position_m - state.seen_m)
    if _seen_for_a_while(state, now):
        state = replace(state, seen_m=position_m, seen_s=now.now_s)
    return replace(memory, state=replace(state, back_pa=back_pa))


def _seen_for_a_while(state: Out, now: Now) -> bool:
    """Whether where the stem was is known from long enough ago to tell how fast it goes; by rounding, not quite."""
    return now.now_s - state.seen_s > (1.0 - 1e-6) * now.bounds.thresholds.watched_s


# At rest.


def settled(memory: SlideMemory, now: Now, rest: Rest) -> SlideMemory:
    """Return the memory of a stem that has come to rest: what it is to do from here."""
    bounds, stuck_m = now.bounds, memory.stuck_at_m
    if stuck_m is not None and abs(rest.position_m - stuck_m) > bounds.longest_giving_m:
        memory = replace(memory, row=None, move=Move(bounds.thresholds.most_slides))
    move = memory.move.refilled(now.now_s, bounds)
    anchor = memory.anchor_at(rest.position_m, bounds)
    if move is memory.move and anchor is memory.anchor and memory.target_m == now.reference_m:
        return memory
    return replace(memory, move=move, anchor=anchor, target_m=now.reference_m)


def there(plan: Plan) -> SlideMemory | None:
    """End the move: the stem is within the dead band, or as near as it is known."""
    return _idle(plan.memory, NOTHING) if abs(plan.now.error_m) <= _band_m(plan.now) else None


def as_near_as_slides_land(plan: Plan) -> SlideMemory | None:
    """End the move: another slide would miss as the ones before have, or end on the stop, as the last one has."""
    memory, now = plan.memory, plan.now
    thresholds, landed = now.bounds.thresholds, memory.move.landed
    beyond = max(0, landed - thresholds.free_landings)
    band_m = max(_band_m(now), now.balance.scatter_m if beyond else 0.0) * thresholds.widening ** (beyond // 2)
    near = abs(now.error_m) <= band_m or _on_stop(memory, now)
    return _idle(memory, InhibitReason.TRIM_ENDED) if near else None


def one_slide(plan: Plan) -> SlideMemory | None:
    """Give the one slide that reaches the reference, or the second of two, if it is long enough to break loose."""
    memory, now, s = plan.memory, plan.now, plan.now.side
    if plan.used_up:
        return None
    way_m = plan.way_m(s)
    if isinstance(memory.state, Out) and s == -memory.state.slide.direction:
        # Planned by what may do: it is tried before more is asked for.
        likely_m = plan.interval(s, turning=plan.turns(s)).likely_m
        way_m = min(way_m, max(likely_m, shortest_seen_m(now.bounds)))
    slide = plan.slide(now.reference_m + plan.lead_m(s), s)
    if slide.way_m < way_m:
        return None
    sent = _slide(plan, slide)
    return None if sent.command_pa == memory.command_pa else sent  # under which it rests: it holds the stem


def preslid(plan: Plan) -> SlideMemory | None:
    """Move the stem directly, where its packing gives way so far without breaking loose."""
    memory, now, s = plan.memory, plan.now, plan.now.side
    move, command_pa = memory.move, None if plan.used_up else plan.preslid_pa()
    if command_pa is None or command_pa == memory.command_pa:
        return None
    loose = plan.slide(now.reference_m + plan.ahead_m(command_pa, s), s)
    return replace(
        memory,
        command_pa=command_pa,
        state=Presliding(now.reference_m, loose),
        move=replace(move, left=move.left - 1, preslid=move.preslid + 1),
    )


def taken_back(plan: Plan) -> SlideMemory | None:
    """Leave the error to the references to come."""
    memory, now, course = plan.memory, plan.now, plan.memory.course
    if course is None or plan.used_up:
        return None
    away_s = memory.excursions.away_s if memory.excursions is not None else 0.0
    takes_back = course.takes_back(now.now_s, now.error_m, plan.way_m(now.side), away_s)
    return _idle(memory, InhibitReason.REFERENCE_COMES, waits=True) if takes_back else None


def excursion_waits(plan: Plan) -> SlideMemory | None:
    """Wait: the last excursion was too recent. Not where it has left the stem away, for the second was too short."""
    now, before = plan.now, plan.memory.excursions
    if before is None or now.now_s - before.begun_s >= now.bounds.excursion_interval_s:
        return None
    return None if plan.used_up or plan.left_away else _idle(plan.memory, InhibitReason.EXCURSION_WAITS, waits=True)


def two_slides(plan: Plan) -> SlideMemory | None:
    """Give the first of two slides, by whichever side it may, and what is left of the day's travel allows."""
    memory, now, bounds = plan.memory, plan.now, plan.now.bounds
    each = next((each for each, bar in plan.bars if bar is NOTHING), None) if memory.move.left >= 2 else None
    if each is None:  # of two, for it is to come back
        return None
    command_pa = bounds.allowed_pa(now.balance.slide_pa(plan.from_m, each.by_m, each.direction))
    if command_pa == memory.command_pa:
        return None
    out = Out(
        slide=plan.slide(each.by_m, each.direction),
        given_s=now.now_s,
        seen_m=now.position_m,
        seen_s=now.now_s,
        back_pa=plan.back_pa(each.direction, 0.0),
    )
    away_s = memory.excursions.away_s if memory.excursions else 0.0
    return replace(
        memory,
        command_pa=command_pa,
        state=out,
        move=memory.move.given(now.now_s, None),
        excursions=Excursions(now.now_s, away_s, plan.spent_m(each)),
    )


def day_spent(plan: Plan) -> SlideMemory | None:
    """Wait until what a day's excursions may cost has come back."""
    spent = plan.memory.move.left >= 2 and any(bar is InhibitReason.EXCURSION_BUDGET_SPENT for _, bar in plan.bars)
    return _idle(plan.memory, InhibitReason.EXCURSION_BUDGET_SPENT, waits=True) if spent else None


def nothing_breaks_loose(plan: Plan) -> SlideMemory | None:
    """End the move of a stem that is stuck, whichever bound bars a longer slide.

    What slides in a row seem to teach is not believed: the next reference is tried with what was known before, and what
    is held until then brings a stem that comes free to its reference, not to where the last push would have.
    """
    memory, now, s, row = plan.memory, plan.now, plan.now.side, plan.memory.row
    if row is None:
        return None
    rest_m = now.at_rest.position_m
    before = row.before.at(s, turning=plan.turns(s), local=now.balance.local(rest_m))
    whole_way = before.seen and abs(now.error_m) >= before.broke_m
    stuck = row.stuck_at_m is not None
    if not (stuck or row.held >= now.bounds.thresholds.stuck_after or whole_way):
        return None
    if stuck and memory.distances is row.before and memory.move.left == 0:
        return _idle(memory, InhibitReason.TRIM_ENDED)
    return replace(
        memory,
        command_pa=now.bounds.allowed_pa(now.balance.slide_pa(rest_m, now.reference_m, s)),
        state=Idle(InhibitReason.TRIM_ENDED),
        move=replace(memory.move, left=0),
        distances=row.before,
        row=Row(row.before, stuck_at_m=rest_m),
    )


def limits_end_it(plan: Plan) -> SlideMemory:
    """End the move: by its number of slides, or by a bound of the site, of which the pressure is said first."""
    bars = {bar for _, bar in plan.bars} if plan.memory.move.left >= 2 else {NOTHING}
    told = (NOTHING, InhibitReason.LAW_BEYOND_LIMITS, InhibitReason.EXCURSION_BEYOND_LIMIT)
    reason = next(each for each in told if each in bars) or InhibitReason.TRIM_ENDED
    return _idle(plan.memory, reason)


def _band_m(now: Now) -> float:
    """Return within what an error is none, m."""
    thresholds = now.bounds.thresholds
    known_m = (
        max(thresholds.noise_deviations * now.at_rest.std_m, thresholds.noise_quanta * now.quantum_m) + now.beside_m
    )
    return max(now.bounds.dead_band_m, known_m)


def _on_stop(memory: SlideMemory, now: Now) -> bool:
    """Whether the last slide went onto a stop, beyond a target beside it, though sent no farther, or short of one.

    Another one would, too: the stop bears the rest, so that it says nothing of the balance.
    """
    slide, rest_m, target_m = memory.move.last, now.at_rest.position_m, now.reference_m
    if slide is None:
        return False
    s, within_m = slide.direction, STOP * now.balance.stroke_m
    stop_m = now.balance.stops_m[s > 0]
    if abs(stop_m - rest_m) > within_m:
        return False
    if s * (target_m - stop_m) > 0.0:
        return s * (slide.to_m - stop_m) > 0.0
    beyond = s * (slide.to_m - target_m) <= 0.0 < s * (rest_m - target_m)
    return beyond and abs(stop_m - target_m) <= within_m


def _slide(plan: Plan, sent: Slide) -> SlideMemory:
    """Give a slide: the second of two, if the first is under way."""
    memory, now = plan.memory, plan.now
    wanted_pa = now.balance.slide_pa(sent.from_m, sent.to_m, sent.direction)
    command_pa = now.bounds.allowed_pa(wanted_pa)
    state, excursions = memory.state, memory.excursions
    slide, reason = (sent, NOTHING) if command_pa == wanted_pa else (None, InhibitReason.LAW_BEYOND_LIMITS)
    if isinstance(state, Out) and excursions is not None:
        excursions = replace(excursions, away_s=now.now_s - state.given_s)
    return replace(
        memory,
        command_pa=command_pa,
        target_m=now.reference_m,
        state=Sliding(slide, reason),
        move=memory.move.given(now.now_s, slide),
        excursions=excursions,
    )


def _idle(memory: SlideMemory, reason: InhibitReason, *, waits: bool = False) -> SlideMemory:
    """Return the memory of a stem that is left alone: the same one, if it is already, as in most steps.

    Args:
        waits: whether the reason ends by time alone.
    """
    if isinstance(memory.state, Idle) and memory.state.reason is reason:
        return memory
    return replace(memory, state=Idle(reason, waits))


class Rule(NamedTuple):
    """A row of the table: when it holds, to which states it leads (none: the state stays), and which `why` it gives."""

    follow: Callable[[Plan], SlideMemory | None]
    to: tuple[type[State], ...]
    why: tuple[InhibitReason, ...]
    when: str


WAITS = (InhibitReason.NOT_AT_REST, InhibitReason.PRESSURE_ELSEWHERE)
CUT_SHORT, ENDED = (NOTHING, InhibitReason.LAW_BEYOND_LIMITS), (InhibitReason.TRIM_ENDED,)
HELD = "the stem did not move in three slides in a row, or in one of the whole way, or it is already stuck"
BARS = (InhibitReason.LAW_BEYOND_LIMITS, *ENDED, InhibitReason.EXCURSION_BEYOND_LIMIT)
MOVING: tuple[Rule, ...] = (
    Rule(gone_far_enough, (Sliding,), CUT_SHORT, "Out: the stem is far enough beyond the reference"),
    Rule(reference_far_off, (Sliding,), (NOTHING,), "a new reference is far from a moving stem"),
    Rule(overdue, (), WAITS, "a rest is overdue"),
)
AT_REST: tuple[Rule, ...] = (
    Rule(there, (Idle,), (NOTHING,), "the stem is within the dead band"),
    Rule(as_near_as_slides_land, (Idle,), ENDED, "more slides would not reduce the error, or the stem is on its stop"),
    Rule(one_slide, (Sliding,), CUT_SHORT, "the error exceeds the break-away distance"),
    Rule(preslid, (Presliding,), (InhibitReason.PRESLIDING,), "presliding reaches the reference"),
    Rule(taken_back, (Idle,), (InhibitReason.REFERENCE_COMES,), "coming references will reduce the error"),
    Rule(excursion_waits, (Idle,), (InhibitReason.EXCURSION_WAITS,), "the last excursion was too recent"),
    Rule(two_slides, (Out,), (NOTHING,), "two slides are left, no limit bars an excursion"),
    Rule(day_spent, (Idle,), (InhibitReason.EXCURSION_BUDGET_SPENT,), "a day's excursions are spent"),
    Rule(nothing_breaks_loose, (Idle,), (InhibitReason.STUCK,), HELD),
    Rule(limits_end_it, (Idle,), BARS, "else"),
)
TABLE = (*MOVING, *AT_REST)


def after(memory: SlideMemory, now: Now) -> SlideMemory:
    """Return the memory after the first rule that holds."""
    if now.rest is None:
        plan, rules = Plan(now, memory, now.position_m), MOVING
    else:
        plan, rules = Plan.at_rest(settled(memory, now, now.rest), now), AT_REST
    for rule in rules:
        if (followed := rule.follow(plan)) is not None:
            return followed
    return on_its_way(plan)
