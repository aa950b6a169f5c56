"""What a slide taught of break-away: one function of whether it moved, arrived and turned, and was seen to its end.

    it arrived                        within 5 % of its way, a quantum, the dead band or twice what landings scatter by
    it did not move                   no farther than a packing gives way: half of its way, 3 % of the stroke
    it went elsewhere                 twice on end: the first miss is the balance's, which learns by it
    it was sent elsewhere meanwhile   has arrived if it has gone its way by then; if not, nothing was seen

What these say of the interval: `breakaway_distance.py`. A slide onto a stop says nothing, nor one that something else
than a command has moved.
"""

from dataclasses import replace

from positioner.control.laws.slides.now import Now
from positioner.control.laws.slides.plan import shortest_seen_m
from positioner.control.laws.slides.slide_bounds import SlideBounds
from positioner.control.laws.slides.slide_memory import Anchor, Move, Row, SlideMemory
from positioner.control.laws.slides.slide_states import Presliding, Slide, slide_of
from positioner.estimation.landings.breakaway_distance import Went
from positioner.estimation.landings.landing_detector import SlideOutcome


def after_outcome(memory: SlideMemory, outcome: SlideOutcome, now: Now) -> SlideMemory:
    """Return the memory after what a change of the command did: break-away, and where the stem stands."""
    state = memory.state
    if isinstance(state, Presliding):
        return _after_presliding(memory, state, outcome, now)
    return _after_slide(memory, outcome, now)


def _after_slide(memory: SlideMemory, outcome: SlideOutcome, now: Now) -> SlideMemory:
    thresholds = now.bounds.thresholds
    s, to_m, slide = outcome.direction, outcome.position_m, slide_of(memory.state)
    if outcome.moved and memory.stuck_at_m is not None:
        memory = replace(memory, move=Move(thresholds.most_slides))
    if outcome.moved and (slide is None or slide.direction != s or not outcome.landing):
        return replace(memory, anchor=Anchor(to_m, s) if outcome.landing else None, row=None)
    if slide is None:
        return memory
    if not slid_away(slide, to_m, now.bounds):
        return held(memory, slide, now)
    way_m, went_m, missed_m = slide.way_m, slide.went_m(to_m), abs(slide.to_m - to_m)
    landed = replace(memory, anchor=Anchor(to_m, s), row=None)
    scatter_m = max(thresholds.missed_deviations * now.balance.scatter_m, outcome.std_m)
    near_m = max(thresholds.missed * way_m, now.quantum_m, now.bounds.dead_band_m)
    elsewhere = _went_elsewhere(slide, went_m, near_m, now)
    if not elsewhere and missed_m > max(near_m, scatter_m):
        return landed
    return _taught(landed, slide, Went(way_m, went_m, moved=True, arrived=not elsewhere), now)


def _went_elsewhere(slide: Slide, went_m: float, near_m: float, now: Now) -> bool:
    """Whether a slide did not arrive: far short of its way, or off by more than is near, the second time on end."""
    way_m, missed_m = slide.way_m, abs(slide.way_m - went_m)
    far_short = way_m - went_m > now.bounds.thresholds.far_short * way_m
    return missed_m > near_m and (far_short or now.balance.tried(way_m, slide.direction) > 1)


def _after_presliding(memory: SlideMemory, state: Presliding, outcome: SlideOutcome, now: Now) -> SlideMemory:
    """Return the memory after the packing was to give way: so far it holds, or, landed elsewhere, has broken loose."""
    loose = state.loose
    if not (outcome.moved and outcome.landing):
        return _taught(memory, loose, Went(loose.way_m, 0.0, moved=False, arrived=False), now)
    landed = replace(memory, anchor=Anchor(outcome.position_m, outcome.direction), row=None)
    asked_m, went_m = abs(state.to_m - outcome.from_m), abs(outcome.position_m - outcome.from_m)
    if outcome.direction != loose.direction or went_m <= now.bounds.thresholds.gone_on * asked_m:
        return landed
    way_m = max(loose.way_m, shortest_seen_m(now.bounds))
    return _taught(landed, loose, Went(way_m, way_m, moved=True, arrived=True), now)


def sent_elsewhere(memory: SlideMemory, slide: Slide, now: Now) -> SlideMemory:
    """Return the memory of a slide that is sent elsewhere before it rests: no rest will say so, it may have slid."""
    thresholds, position_m = now.bounds.thresholds, now.position_m
    memory = replace(memory, anchor=Anchor(position_m, slide.direction))
    if not slid_away(slide, position_m, now.bounds):
        return memory
    memory, way_m, went_m = replace(memory, row=None), slide.way_m, slide.went_m(position_m)
    if not (1.0 - thresholds.missed) * way_m < went_m < thresholds.gone_on * way_m:
        return memory
    jumped = _went_elsewhere(slide, went_m, max(2.0 * thresholds.missed * way_m, now.quantum_m), now)
    return _taught(memory, slide, Went(way_m, went_m, moved=True, arrived=not jumped), now)


def slid_away(slide: Slide, position_m: float, bounds: SlideBounds) -> bool:
    """Whether the stem has gone farther in its slide than a packing gives way."""
    return slide.went_m(position_m) > min(bounds.longest_giving_m, bounds.thresholds.gave_way * slide.way_m)


def held(memory: SlideMemory, slide: Slide, now: Now) -> SlideMemory:
    """Return the memory after a slide that did not break the stem loose."""
    way_m = slide.way_m
    if memory.distances is None or memory.learnt is None or way_m <= 0.0:
        return memory
    row = memory.row or Row(memory.distances)
    turning, local = slide.turning is not False, now.local
    before = memory.learnt.at(slide.direction, turning=turning, local=local)
    if way_m >= before.broke_m:
        row = replace(row, held=row.held + 1)
    move = replace(memory.move, held=True, landed=memory.move.landed - 1)
    memory = replace(memory, row=row, move=move)
    return _taught(memory, slide, Went(way_m, 0.0, moved=False, arrived=False), now)


def _taught(memory: SlideMemory, slide: Slide, went: Went, now: Now) -> SlideMemory:
    """Return the memory with what a slide taught; where nobody knows whether it turned, only that it held."""
    if memory.distances is None or (slide.turning is None and went.moved):
        return memory
    turning = slide.turning is not False
    local = now.local
    return replace(memory, distances=memory.distances.taught(slide.direction, went, turning=turning, local=local))
