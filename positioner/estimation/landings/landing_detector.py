"""Which rests are landings: sample by sample, from the command and the position.

A landing ends a slide: the command stepped, the stem moved that way visibly under it, and rests again. Then the balance
of the moving stem holds where it rests. No landing is

- a rest of a stem that moved against the last step: a braked stem is held by friction, anywhere in its band,
- a rest at a stop, where the stop bears the rest,
- a rest under a pressure that still moves (`stem_at_rest`), or that is another than the one commanded: of where the
  stem is then nothing is said, and it is waited for.

How long a stem takes to answer is learnt: a stem that has not moved may yet, so it is waited for as long as the longest
answer seen, and for the size of the step (a rate limit). One that answers later still corrects what was learnt, but one
that moves when ten times the longest answer has gone by has been set free by something else: that says nothing of how
long it takes. An answer is as long as it was seen to be: an outage is no slowness of the stem.
"""

from collections.abc import Callable
from math import hypot, inf, isnan, nan, sqrt
from typing import NamedTuple

from config.codes import InhibitReason
from positioner.estimation.landings.seen_time import SeenTime
from positioner.estimation.landings.stem_at_rest import Rest, RestWindow

VISIBLE = 5e-3
"""Of the stroke: a way shorter than this is no slide, but the packing giving way."""
VISIBLE_NOISES = 6.0
UNDER_WAY = 0.01
"""Of the stroke: a stem that went so far before it rests has answered."""
WATCHED_REST_SAMPLES = 400
"""Samples of a rest, after which it is only watched."""
STOP = 0.01
"""Of the stroke: as near as this to an end it may be a stop."""
FIRST_ANSWER_S = 1.0
"""Longest answer, until one was seen."""
PATIENCE = 1.5
"""Longest answers for which a stem must have rested."""
LATE = 10.0
"""Longest answers, or first ones, after which a stem that moves has not answered the command."""
FORGOTTEN = 0.9
"""Factor from answer to answer, so that one slow answer is not waited for ever."""
SAME = 1e-9
"""Of the stroke: positions nearer than this are one."""
FINEST_QUANTUM = 1e-6
"""Of the stroke: a sensor that resolves more has none."""
LARGE, LARGER = 0.5, 2.0
"""Of the largest step: from a smaller one nothing is learnt of a rate limit; one so much larger says more than all
before, for what a small step takes may be a lag, which a large one takes but once."""
CREPT_SINCE = 0.75
"""Of the time, for which `Rest.crept_m` counts: what a stem crept is no slide."""
CREEPS_PER_S, DRIFTS_PER_S = 5e-4, 5e-3
"""Of the stroke: a stem that answers late goes faster; and one that goes on after its answer does not for it."""
CREEP, INSTANTS = 1e-3, 2
"""Of the stroke, for each second that a slide takes beyond two samples: behind a slow pressure the stem creeps into its
rest and sticks, its friction risen, a little before the pressure has come to an end."""
DISTURBED = 4
"""Samples in a row that must be elsewhere."""


class SlideOutcome(NamedTuple):
    """What a change of the command did to a stem at rest: m, Pa, s."""

    time_s: float
    direction: int
    """Of the change: +1 up, -1 down."""
    from_m: float
    command_pa: float
    """Under which it rests now."""
    position_m: float
    std_m: float
    moved: bool
    landing: bool
    """Whether the balance of the moving stem holds here."""
    short_m: float = 0.0
    """How far short of that balance it may have stuck behind a slow pressure: all slides alike, their mean too."""
    from_pa: float | None = None
    """Under which it rested before; None: it did not."""


class Answers(NamedTuple):
    """How long a stem takes to answer, as learnt: s, s/Pa, Pa; 0: not learnt."""

    longest_s: float = 0.0
    slowness_s_per_pa: float = 0.0
    """Of a pressure that moves at a limited rate ..."""
    large_pa: float = 0.0
    """... from steps like this."""


class Supposed(NamedTuple):
    """A rest that may be one under the command: m, Pa."""

    rest: Rest
    command_pa: float
    direction: int
    """In which the stem has visibly come there, 0: it has not moved, or how is not known."""


class LandingDetector:
    """The rests of a stem and how they came about.

    Args:
        stroke_m: full travel, m.
        stops_m: positions of the stops, m; by default 0 and the stroke.
        believed: whether a rest is one under the command in force; by default each is.

    Attributes:
        answers: of the stem.
        rest: of the stem under the command in force; None while it moves or may yet move.
        quantum_m: of the position, whose steps are multiples of it; 0 until a sample differed from the one before it.
        pressure_elsewhere: whether the last rest was not believed to be one under the command.
    """

    def __init__(
        self,
        stroke_m: float,
        stops_m: tuple[float, float] | None = None,
        believed: Callable[[Supposed], bool] = lambda _rest: True,
    ) -> None:
        self._believed = believed
        self._stroke_m, self._finest_m = stroke_m, FINEST_QUANTUM * stroke_m
        self._finer_m = 2 * self._finest_m
        """A divisor of a quantum below this would be finer than the finest."""
        low_m, high_m = stops_m if stops_m is not None else (0.0, stroke_m)
        self._free_m = (low_m + STOP * stroke_m, high_m - STOP * stroke_m)
        self._window = RestWindow(stroke_m)
        self._seen = SeenTime()
        self._clock_s = 0.0
        """Of the last sample; all other times are those for which the stem was seen (`seen_time`)."""
        self._level_pa = nan
        self._sense = 0
        self._running_on = False
        """Whether the command changed while the stem moved: the slide starts from where it turns round."""
        self._position_m = self._from_m = nan
        self._away = 0
        self._known = True
        """Whether what the last change of the command did is known."""
        self._answered = False
        """Whether the stem has answered that: what moves it now is something else."""
        self.answers = Answers()
        self._step_pa = 0.0
        """The longest way to the command in force from where the pressure may have been since the last rest."""
        self._left_pa = (inf, -inf)
        """The least and the most of the commands since then."""
        self._rested_pa: float | None = None
        """The command before the last change, if the stem rested under it."""
        self._level_s = self._interval_s = self._time_s = 0.0
        self.rest: Rest | None = None
        self.quantum_m = 0.0
        self.pressure_elsewhere = False

    def _patience_s(self, rest: Rest) -> float:
        """Return for how long a stem must have been waited for: longer, if it has not moved after a large step."""
        if self._known or abs(rest.position_m - self._from_m) > self._visible_m(rest):
            return PATIENCE * self.answers.longest_s
        return PATIENCE * (self._answers_s or FIRST_ANSWER_S)

    @property
    def _answers_s(self) -> float:
        """How long the stem takes to answer the last change of the command, as far as is learnt, s; 0: it is not."""
        longest_s, slowness_s_per_pa, _ = self.answers
        return max(longest_s, slowness_s_per_pa * self._step_pa)

    @property
    def _late(self) -> bool:
        """Whether the last change of the command is so long ago that what moves the stem is no answer to it."""
        return self._time_s - self._level_s > LATE * max(self._answers_s, FIRST_ANSWER_S)

    def _no_answer_m_per_s(self) -> float:
        """Return how slow a stem must go for that to be no answer to the command any more; 0: it may always be one."""
        if self._answered:
            return DRIFTS_PER_S * self._stroke_m
        return CREEPS_PER_S * self._stroke_m if self._late else 0.0

    @property
    def waits_for(self) -> InhibitReason:
        """Why no rest is known for longer than any stem takes to come to one: it does not, or not by its command."""
        if self.pressure_elsewhere:
            return InhibitReason.PRESSURE_ELSEWHERE
        unsettled = self.rest is None and self._late
        return InhibitReason.NOT_AT_REST if unsettled else InhibitReason.NOTHING

    def _visible_m(self, rest: Rest) -> float:
        noise_m, least_m = VISIBLE_NOISES * rest.noise_m, VISIBLE * self._stroke_m
        return noise_m if noise_m > least_m else least_m

    def update(
        self, time_s: float, position_m: float, command_pa: float, pressure_pa: float, *, arrived: bool = True
    ) -> SlideOutcome | None:
        """Take a sample and the command in force since; return what a change of the command did once it is known.

        A change counts from when its pressure has arrived, where somebody knows that.
        """
        self._clock_s, time_s = time_s, self._seen.at(time_s)
        if not 0.0 < self.quantum_m < self._finer_m:
            self._learn_quantum(position_m)
        if command_pa != self._level_pa:
            self._change_level(time_s, command_pa)
        if self.rest is None and self._running_on:
            self._from_m = max(self._from_m, position_m) if self._sense < 0 else min(self._from_m, position_m)
        self._position_m, self._interval_s, self._time_s = position_m, time_s - self._time_s, time_s
        if not arrived:
            self._level_s = time_s
            self._window.restart(time_s, self._from_m)
        if self.rest is None or self.rest.count < WATCHED_REST_SAMPLES:
            self._window.add(time_s, position_m, pressure_pa, self._no_answer_m_per_s)
        rest, known = self._window.rest, self.rest
        if known is not None:
            self._watch(time_s, position_m, known)
            if self.rest is not None and rest is not None and not rest.crept_m:
                self.rest = rest
            return None
        if rest is None or not self._waited_for(time_s, rest) or not self._under_its_command(rest):
            return None
        self.rest, self._away = rest, 0
        self._window.learn_noise(rest)
        outcome = None if self._known else self._outcome(rest)
        self._answered = self._answered or (outcome is not None and outcome.moved)
        self._known = self._known or self._answered
        return outcome

    @property
    def noise_m(self) -> float:
        """Standard deviation of a sample of the position, m, of the rests so far; 0 before there was one."""
        return self._window.usual_noise_m

    def _waited_for(self, time_s: float, rest: Rest) -> bool:
        """Whether a stem that seems to rest has been waited for long enough."""
        return time_s - self._level_s >= self._patience_s(rest)

    def _under_its_command(self, rest: Rest) -> bool:
        """Whether a rest is one under the command in force; if not, what that did is not known, and is waited for."""
        slid = not self._known and abs(rest.position_m - self._from_m) > self._visible_m(rest)
        self.pressure_elsewhere = not self._believed(Supposed(rest, self._level_pa, self._sense if slid else 0))
        if self.pressure_elsewhere:
            self.interrupt()
        return not self.pressure_elsewhere

    def interrupt(self) -> None:
        """Take note that something else than the commands may have moved the stem: what they did is not known."""
        self._level_pa, self.rest, self._known, self._answered = nan, None, True, False

    def _learn_quantum(self, position_m: float) -> None:
        step_m = abs(position_m - self._position_m)
        if step_m > SAME * self._stroke_m:
            divisor_m = _common_divisor(step_m, self.quantum_m, self._finest_m)
            self.quantum_m = self._window.quantum_m = divisor_m

    def _change_level(self, time_s: float, command_pa: float) -> None:
        """Begin to wait for what a change of the command does; the stem starts from its rest, or from where it is."""
        if self.rest is None and not self._known and self._under_way and not self._late:
            self._learn_answer(time_s - self._level_s)
        least_pa, most_pa = (inf, -inf) if self.rest is not None else self._left_pa
        if not isnan(self._level_pa):
            least_pa, most_pa = min(least_pa, self._level_pa), max(most_pa, self._level_pa)
        self._left_pa, self._step_pa = (least_pa, most_pa), max(command_pa - least_pa, most_pa - command_pa, 0.0)
        self._running_on = self.rest is None
        self._rested_pa = None if self.rest is None or isnan(self._level_pa) else self._level_pa
        self._from_m = nan if isnan(self._level_pa) else self._position_m if self.rest is None else self.rest.position_m
        self._sense = 1 if command_pa > self._level_pa else -1
        self._level_pa, self._level_s = command_pa, time_s
        self.rest, self._known, self._answered = None, isnan(self._from_m), False
        self._window.restart(time_s, self._from_m)

    @property
    def _under_way(self) -> bool:
        """Whether the stem has visibly followed the last change of the command, though it does not rest yet."""
        return self._sense * (self._position_m - self._from_m) > UNDER_WAY * self._stroke_m

    def _watch(self, time_s: float, position_m: float, rest: Rest) -> None:
        """Find a stem that moves: later than was waited for, or moved by something else than the command."""
        if abs(position_m - rest.position_m) <= self._visible_m(rest):
            self._away = 0
            return
        self._away += 1
        if self._away < DISTURBED:
            return
        self.rest = None
        if self._known or self._late:
            self._known, self._answered, self._level_s = True, True, time_s
            self._window.restart(time_s)
        else:
            self._learn_answer(time_s - self._level_s)
            self._window.look_again(time_s)

    def _learn_answer(self, answer_s: float) -> None:
        """Learn how long the stem takes to answer, in all and for a pressure step (a rate limit)."""
        longest_s, slowness_s_per_pa, large_pa = (FORGOTTEN * each for each in self.answers)
        large_pa = max(self._step_pa, large_pa)
        if self._step_pa > LARGER * self.answers.large_pa:
            slowness_s_per_pa = answer_s / self._step_pa
        elif self._step_pa > LARGE * large_pa:
            slowness_s_per_pa = max(answer_s / self._step_pa, slowness_s_per_pa)
        else:
            slowness_s_per_pa = self.answers.slowness_s_per_pa
        self.answers = Answers(max(answer_s, longest_s), slowness_s_per_pa, large_pa)

    def _outcome(self, rest: Rest) -> SlideOutcome:
        slid_m = self._sense * (rest.position_m - self._from_m) - rest.crept_m / CREPT_SINCE
        moved = slid_m > self._visible_m(rest)
        creep_s = max(0.0, rest.came_to_rest_s - INSTANTS * self._interval_s)
        if moved:
            self._learn_answer(rest.came_to_rest_s)
        return SlideOutcome(
            time_s=self._clock_s,
            direction=self._sense,
            from_m=self._from_m,
            command_pa=self._level_pa,
            position_m=rest.position_m,
            std_m=hypot(rest.std_m, rest.crept_m, self.quantum_m / sqrt(12), CREEP * self._stroke_m * creep_s),
            moved=moved,
            landing=moved and self._free_m[0] < rest.position_m < self._free_m[1],
            short_m=rest.short_m if moved else 0.0,
            from_pa=self._rested_pa,
        )


def _common_divisor(larger: float, smaller: float, least: float) -> float:
    """Return the greatest common divisor of two lengths, but for rounding (Euclid's), or the least that counts."""
    while smaller >= least:
        left = larger % smaller
        larger, smaller = smaller, min(left, smaller - left)
    return max(larger, least)
