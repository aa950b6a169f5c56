"""Which state of the law of slides follows which, and when: `TABLE`, whose first rule that holds is followed.

While the stem moves, the second of two slides is given as soon as the first has slid, is farther than break-away beyond
the reference, and will go no farther; a reference far from the stem is followed at once; a nearer one waits for the
rest. At rest the move ends, or the next slide is given (`plan.py`).

Why there is no limit cycle: what a slide missed corrects B for the next (each miss is a fraction of the one before),
the dead band widens from landing to landing, and the slides of a move are numbered. After its end nothing happens until
the reference changes, or something else has visibly moved the stem.

A stem that slides in a row do not break loose is sent farther each time, until a bound bars the next: the limit of an
excursion, the pressure, the number of slides. Then it is stuck, whichever bound it was, and what is known of break-away
is what was known before the row.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from config.codes import InhibitReason
from positioner.control.laws.slides.now import Now
from positioner.control.laws.slides.plan import Plan, shortest_seen_m
from positioner.control.laws.slides.slide_memory import Excursions, Move, Row, SlideMemory, day_m
from positioner.control.laws.slides.states import (
    STATES,
    STUCK,
    Idle,
    Out,
    Presliding,
    Returning,
    Slide,
    Sliding,
    State,
    Stuck,
    Waiting,
    Watching,
    slide_of,
)
from positioner.control.laws.slides.teaching import sent_elsewhere, slid_away
from positioner.estimation.landings.landing_detector import STOP
from positioner.estimation.landings.stem_at_rest import Rest

NOTHING = InhibitReason.NOTHING
COMMANDING = tuple(each for each in STATES if each is not Watching)
UNDER_WAY = tuple(each for each in COMMANDING if each is not Stuck)


# While the stem moves, or may yet move.


def gone_far_enough(memory: SlideMemory, now: Now) -> SlideMemory | None:
    """Give the second of two slides: the first has done its work, and the stem need not rest there.

    What follows a slow pressure goes on, at a speed v, for about as long as it has taken until now: by v t.
    """
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
    if beyond_m <= Plan(now, memory, position_m).way_m(-s, turning=True):
        return None
    memory = sent_elsewhere(memory, slide, now)
    return _slide(memory, now, Plan(now, memory, position_m).slide(now.reference_m, -s))


def reference_far_off(memory: SlideMemory, now: Now) -> SlideMemory | None:
    """Follow a reference that changes while the stem moves, where that can be done at once."""
    position_m, reference_m = now.position_m, now.reference_m
    if memory.target_m is None or reference_m == memory.target_m:
        return None
    s = 1 if reference_m > position_m else -1
    sure_m = Plan(now, memory, position_m).interval(s, turning=True).sure_m
    if abs(reference_m - position_m) < now.bounds.thresholds.far * sure_m:
        return None
    slide = slide_of(memory.state)
    if slide is not None and slid_away(slide, position_m, now.bounds):
        memory = sent_elsewhere(memory, slide, now)
    command_pa = now.bounds.allowed_pa(now.balance.pressure_pa(reference_m, s))
    move = Move(now.bounds.thresholds.most_slides).given(now.now_s, None)
    return replace(memory, command_pa=command_pa, target_m=reference_m, move=move, state=Sliding(None))


def overdue(memory: SlideMemory, now: Now) -> SlideMemory | None:
    """Say why the stem is off its reference and is not moved; said once, that stays until it rests."""
    why, target_m = now.waits_for, memory.target_m
    if why is NOTHING or target_m is None:
        return None
    if abs(target_m - now.position_m) <= now.bounds.dead_band_m + now.quantum_m:
        return None
    state = memory.state
    if isinstance(state, Waiting | Out) and state.reason is why:
        return on_its_way(memory, now)
    waiting = replace(state, reason=why) if isinstance(state, Out) else Waiting(slide_of(state), why)
    return replace(memory, state=waiting)


def on_its_way(memory: SlideMemory, now: Now) -> SlideMemory:
    """Go on; of an excursion, with what brings it back from where it is."""
    state, position_m = memory.state, now.position_m
    if not isinstance(state, Out):
        return memory if memory.target_m is not None else replace(memory, target_m=now.reference_m)
    back_pa = Plan(now, memory, position_m).back_pa(state.slide.direction, position_m - state.seen_m)
    if _seen_for_a_while(state, now):
        state = replace(state, seen_m=position_m, seen_s=now.now_s)
    return replace(memory, state=replace(state, back_pa=back_pa))


def _seen_for_a_while(state: Out, now: Now) -> bool:
    """Whether where the stem was is known from long enough ago to tell how fast it goes; by rounding, not quite."""
    return now.now_s - state.seen_s > (1.0 - 1e-6) * now.bounds.thresholds.watched_s


# At rest.


def settled(memory: SlideMemory, now: Now, rest: Rest) -> SlideMemory:
    """Return the memory of a stem that has come to rest: what it is to do from here."""
    bounds, stuck_m = now.bounds, None if memory.row is None else memory.row.stuck_at_m
    if stuck_m is not None and abs(rest.position_m - stuck_m) > bounds.longest_giving_m:
        memory = replace(memory, row=None, move=Move(bounds.thresholds.most_slides))
    move = memory.move.refilled(now.now_s, bounds)
    anchor = memory.anchor_at(rest.position_m, bounds)
    if move is memory.move and anchor is memory.anchor and memory.target_m == now.reference_m:
        return memory
    return replace(memory, move=move, anchor=anchor, target_m=now.reference_m)


def there(memory: SlideMemory, now: Now) -> SlideMemory | None:
    """End the move: the stem is within the dead band, or as near as it is known."""
    return _idle(memory, NOTHING) if abs(now.error_m) <= _band_m(now) else None


def as_near_as_slides_land(memory: SlideMemory, now: Now) -> SlideMemory | None:
    """End the move: another slide would miss as the ones before have, or end on the stop, as the last one has."""
    thresholds, landed = now.bounds.thresholds, memory.move.landed
    beyond = max(0, landed - thresholds.free_landings)
    band_m = max(_band_m(now), now.balance.scatter_m if beyond else 0.0) * thresholds.widening ** (beyond // 2)
    near = abs(now.error_m) <= band_m or _on_stop(memory, now)
    return _idle(memory, InhibitReason.TRIM_ENDED) if near else None


def no_slide_left(memory: SlideMemory, now: Now) -> SlideMemory | None:
    """End the move: it has had its slides, save the second of two."""
    ended = memory.move.left <= 0 and not isinstance(memory.state, Out)
    return _stuck_or_barred(memory, now, InhibitReason.TRIM_ENDED) if ended else None


def one_slide(memory: SlideMemory, now: Now) -> SlideMemory | None:
    """Give the one slide that reaches the reference, or the second of two."""
    slide, reaches = _one_slide(memory, now)
    if not reaches:
        return None
    wanted_pa = now.balance.slide_pa(slide.from_m, slide.to_m, slide.direction)
    if now.bounds.allowed_pa(wanted_pa) == memory.command_pa:  # under which it rests: it holds the stem
        beyond = not now.bounds.allows(wanted_pa)
        return _stuck_or_barred(memory, now, InhibitReason.LAW_BEYOND_LIMITS) if beyond else None
    return _slide(memory, now, slide)


def _one_slide(memory: SlideMemory, now: Now) -> tuple[Slide, bool]:
    """Return the one slide to the reference, and whether it is long enough to break loose."""
    plan, s = Plan.at_rest(memory, now), now.side
    way_m = plan.way_m(s)
    if isinstance(memory.state, Out) and s == -memory.state.slide.direction:
        # Planned by what may do: it is tried before more is asked for.
        likely_m = plan.interval(s, turning=plan.turns(s)).likely_m
        way_m = min(way_m, max(likely_m, shortest_seen_m(now.bounds)))
    slide = plan.slide(now.reference_m + plan.lead_m(s), s)
    return slide, slide.way_m >= way_m


def preslid(memory: SlideMemory, now: Now) -> SlideMemory | None:
    """Move the stem directly, where its packing gives way so far without breaking loose."""
    move, s, plan = memory.move, now.side, Plan.at_rest(memory, now)
    command_pa = plan.preslid_pa()
    if command_pa is None or command_pa == memory.command_pa:
        return None
    loose = plan.slide(now.reference_m + plan.ahead_m(command_pa, s), s)
    return replace(
        memory,
        command_pa=command_pa,
        state=Presliding(now.reference_m, loose),
        move=replace(move, left=move.left - 1, preslid=move.preslid + 1),
    )


def taken_back(memory: SlideMemory, now: Now) -> SlideMemory | None:
    """Leave the error to the references to come."""
    course = memory.course
    if course is None:
        return None
    way_m = Plan.at_rest(memory, now).way_m(now.side)
    away_s = memory.excursions.away_s if memory.excursions is not None else 0.0
    takes_back = course.takes_back(now.now_s, now.error_m, way_m, away_s)
    return _idle(memory, InhibitReason.REFERENCE_COMES) if takes_back else None


def excursion_waits(memory: SlideMemory, now: Now) -> SlideMemory | None:
    """Wait: the last excursion was too recent. Not where it has left the stem away, for the second was too short."""
    before = memory.excursions
    if before is None or now.now_s - before.begun_s >= now.bounds.excursion_interval_s or _left_away(memory, now):
        return None
    return _idle(memory, InhibitReason.EXCURSION_WAITS)


def two_slides(memory: SlideMemory, now: Now) -> SlideMemory:
    """Give the first of two slides, by whichever side it may, and what is left of the day's travel allows; or end."""
    now_s, bounds = now.now_s, now.bounds
    if memory.move.left < 2:  # it is to come back
        return _stuck_or_barred(memory, now, InhibitReason.TRIM_ENDED)
    plan, spent, reasons = Plan.at_rest(memory, now), memory.excursions, []
    for each in plan.excursions():
        spent_m = (spent.spent_at_m(now_s, bounds) if spent else 0.0) + 2 * each.beyond_m
        broke = 0.0 < day_m(bounds) < spent_m and not _left_away(memory, now)
        reasons.append(plan.barred(each) or (InhibitReason.EXCURSION_BUDGET_SPENT if broke else NOTHING))
        if reasons[-1] is not NOTHING:
            continue
        command_pa = bounds.allowed_pa(now.balance.slide_pa(plan.from_m, each.by_m, each.direction))
        if command_pa == memory.command_pa:
            return _stuck_or_barred(memory, now, InhibitReason.TRIM_ENDED)
        out = Out(
            slide=plan.slide(each.by_m, each.direction),
            given_s=now_s,
            seen_m=now.position_m,
            seen_s=now_s,
            back_pa=plan.back_pa(each.direction, 0.0),
        )
        return replace(
            memory,
            command_pa=command_pa,
            state=out,
            move=memory.move.given(now_s, None),
            excursions=Excursions(now_s, spent.away_s if spent else 0.0, spent_m),
        )
    if InhibitReason.EXCURSION_BUDGET_SPENT in reasons:
        return _idle(memory, InhibitReason.EXCURSION_BUDGET_SPENT)
    return _stuck_or_barred(memory, now, max(reasons, key=lambda each: each is InhibitReason.LAW_BEYOND_LIMITS))


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


def _left_away(memory: SlideMemory, now: Now) -> bool:
    """Whether a slide of the move has left the stem away."""
    plan = Plan.at_rest(memory, now)
    return memory.move.given_s is not None and abs(now.reference_m - plan.from_m) > 0.5 * plan.back_m(now.side)


def _slide(memory: SlideMemory, now: Now, sent: Slide) -> SlideMemory:
    """Give a slide: the second of two, if the first is under way."""
    now_s, state = now.now_s, memory.state
    wanted_pa = now.balance.slide_pa(sent.from_m, sent.to_m, sent.direction)
    command_pa = now.bounds.allowed_pa(wanted_pa)
    slide, reason = (sent, NOTHING) if command_pa == wanted_pa else (None, InhibitReason.LAW_BEYOND_LIMITS)
    excursions = memory.excursions
    if isinstance(state, Out) and excursions is not None:
        excursions = replace(excursions, away_s=now_s - state.given_s)
    return replace(
        memory,
        command_pa=command_pa,
        target_m=now.reference_m,
        state=Returning(slide, reason) if isinstance(state, Out) else Sliding(slide, reason),
        move=memory.move.given(now_s, slide),
        excursions=excursions,
    )


def _idle(memory: SlideMemory, reason: InhibitReason) -> SlideMemory:
    """Return the memory of a stem that is left alone: the same one, if it is already, as in most steps."""
    if isinstance(memory.state, Idle) and memory.state.reason is reason:
        return memory
    return replace(memory, state=Idle(reason))


def _stuck_or_barred(memory: SlideMemory, now: Now, reason: InhibitReason) -> SlideMemory:
    """End the move where a bound bars a longer slide: for that reason, or, where nothing breaks loose, for that.

    A stem is stuck that slides in a row have not moved, each as long as has broken it loose before, or one that was to
    go the whole way. Whichever bound they met, what they seem to teach is not believed: the next reference is tried
    with what was known before, and what is held until then brings a stem that comes free to its reference, not to where
    the last push would have.
    """
    row, rest_m, error_m, s = memory.row, now.at_rest.position_m, now.error_m, now.side
    if row is None:
        return _idle(memory, reason)
    before = row.before.at(s, turning=Plan(now, memory, rest_m).turns(s), local=now.balance.local(rest_m))
    whole_way = before.seen and abs(error_m) >= before.broke_m
    if not (row.stuck or row.held >= now.bounds.thresholds.stuck_after or whole_way):
        return _idle(memory, reason)
    if isinstance(memory.state, Stuck) and memory.distances is row.before and memory.move.left == 0:
        return memory
    return replace(
        memory,
        command_pa=now.bounds.allowed_pa(now.balance.slide_pa(rest_m, now.reference_m, s)),
        state=STUCK,
        move=replace(memory.move, left=0),
        distances=row.before,
        row=Row(row.before, stuck_at_m=rest_m),
    )


class Rule(NamedTuple):
    """A row of the table: in which states it is asked, what it does, to which states it leads, and when it holds."""

    of: tuple[type[State], ...]
    follow: Callable[[SlideMemory, Now], SlideMemory | None]
    to: tuple[type[State], ...]
    when: str


MOVING = (
    Rule((Out,), gone_far_enough, (Returning,), "the stem is far enough beyond the reference"),
    Rule(COMMANDING, reference_far_off, (Sliding,), "a new reference is far from a moving stem"),
    Rule(UNDER_WAY, overdue, (Waiting, Out), "the stem has not rested within the longest time that it takes"),
)
AT_REST = (
    Rule(COMMANDING, there, (Idle,), "the stem is within the dead band"),
    Rule(COMMANDING, as_near_as_slides_land, (Idle,), "slides leave no smaller error, or the stem is on its stop"),
    Rule(COMMANDING, no_slide_left, (Idle, Stuck), "the move has used up its slides"),
    Rule(COMMANDING, one_slide, (Sliding, Returning, Idle, Stuck), "the error is more than the break-away distance"),
    Rule(COMMANDING, preslid, (Presliding,), "presliding reaches the reference"),
    Rule(COMMANDING, taken_back, (Idle,), "coming references will reduce the error"),
    Rule(COMMANDING, excursion_waits, (Idle,), "the last excursion was too recent"),
    Rule(COMMANDING, two_slides, (Out, Idle, Stuck), "else: an excursion, if the site's limits allow it"),
)
TABLE = (*MOVING, *AT_REST)


def after(memory: SlideMemory, now: Now) -> SlideMemory:
    """Return the memory after the first rule that holds."""
    rest = now.rest
    memory = memory if rest is None else settled(memory, now, rest)
    for rule in MOVING if rest is None else AT_REST:
        if isinstance(memory.state, rule.of) and (followed := rule.follow(memory, now)) is not None:
            return followed
    return on_its_way(memory, now)
