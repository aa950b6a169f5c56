"""A valve's recordings in turn, each held against the model that the one before left; what it complains of, its rank.

unreadable recording    the model stays
as before               the model stays
changed                 the refitted valve is the model from now on
missing                 the valve with the effect is
one of, unexplained, untold   the model stays: nobody knows what it is
"""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime

from config.errors import InputError
from config.loading import validate
from config.valve_file import ValveFile
from sim.effect import UNKNOWN_COMPLAINT, find_effect
from workbench.fleet.examination import AS_BEFORE, CHANGED, UNREADABLE, UNTOLD, Change, Examination
from workbench.fleet.manifest import Entry

STICKS, SPRING_OR_DIAPHRAGM = "sticks", "spring or diaphragm"
COMPLAINTS: Mapping[str, str] = {
    "coulomb_n": STICKS,
    "static_n": STICKS,
    "viscous_ns_per_m": STICKS,
    "spring_n_per_m": SPRING_OR_DIAPHRAGM,
}
"""What an engineer calls a parameter of the bare valve that changed; an effect says it itself."""
NOT_JUDGED, NOTHING_KNOWN = "not judged", "nothing known"
JUDGED = ("missing", "one_of", "unexplained", CHANGED)
"""Outcomes that say what it is, or that the library has nothing for it."""
SPRING, COULOMB = "spring_n_per_m", "coulomb_n"
LIKE_FACTORS = 0.05
"""Relative difference of two factors that are taken for one."""
LEAST_STEPS = 2
"""Changes one way, one after the other, that are a drift."""
GRAVEST = ("missing", "one_of", "unexplained", "untrusted", "unjudged", "unfinished", UNTOLD, CHANGED)
"""Outcomes that are complaints, the gravest first."""
SURE = {"missing": "sure", "one_of": "one of several", CHANGED: "sure"}


@dataclass(frozen=True, slots=True)
class Model:
    """A valve file that was accepted: from when on, by which recording, and why."""

    when: datetime
    recording: str
    found: Examination
    """By which it was accepted."""
    text: str


@dataclass(slots=True)
class ValveCourse:
    """What is known of a valve, as its recordings are examined one after another."""

    name: str
    given: ValveFile | None = None
    """Its file; None: it cannot be read."""
    examined: list[tuple[Entry, Examination]] = field(default_factory=list)
    models: list[Model] = field(default_factory=list)

    def take(self, entry: Entry, found: Examination) -> None:
        """Go on with what came of the next recording."""
        self.examined.append((entry, found))
        if found.model is not None:
            self.models.append(Model(entry.time, entry.recording, found, found.model))

    @property
    def readable(self) -> list[tuple[Entry, Examination]]:
        """The recordings that could be examined."""
        return [(entry, found) for entry, found in self.examined if found.outcome != UNREADABLE]

    def complaints(self) -> Iterator[tuple[Entry, Examination]]:
        """Yield the recordings that changed what is known; that a drawing was first fitted is none."""
        is_known = False
        for entry, found in self.readable:
            if found.outcome in GRAVEST and (is_known or found.outcome != CHANGED):
                yield entry, found
            is_known = is_known or found.model is not None or found.outcome == AS_BEFORE

    @property
    def gravest(self) -> tuple[Entry, Examination] | None:
        """The gravest of them, of equal ones the latest; None: the valve is as it was."""
        found = sorted(self.complaints(), key=lambda each: each[0].time, reverse=True)
        return min(found, key=lambda each: GRAVEST.index(each[1].outcome), default=None)

    @property
    def since(self) -> datetime | None:
        """When the gravest was first seen; None: nothing is wrong, or nothing known."""
        return None if self.gravest is None else self.first_seen(*self.gravest)

    def first_seen(self, entry: Entry, found: Examination) -> datetime:
        """Return when what a recording shows was first seen: in each one since then that could be read.

        What changed has another model from then on: seen before, it was another change.
        """
        since = entry.time
        if found.outcome == CHANGED:
            return since
        for earlier, came in reversed([each for each in self.readable if each[0].time < entry.time]):
            if came.outcome != found.outcome or came.effects != found.effects:
                break
            since = earlier.time
        return since

    @property
    def kind(self) -> str:
        """What an engineer calls it; empty if nothing is wrong, as a recording shows."""
        if self.gravest is None:
            return "" if self.readable else NOTHING_KNOWN
        _, found = self.gravest
        kinds = [complaint_of(name) for name in found.effects] or kinds_of_changes(found.changes)
        return ", ".join(dict.fromkeys([*(["drifts"] if self.drifting else []), *kinds])) or (
            UNKNOWN_COMPLAINT if found.outcome in JUDGED else NOT_JUDGED
        )

    @property
    def drifting(self) -> tuple[str, ...]:
        """Parameters that changed LEAST_STEPS times or more, always one way."""
        ways: dict[str, list[bool]] = {}
        for _, found in self.complaints():
            for each in found.changes if found.outcome == CHANGED else ():
                ways.setdefault(each.name, []).append(each.now > each.before)
        return tuple(name for name, each in ways.items() if len(each) >= LEAST_STEPS and len(set(each)) == 1)

    @property
    def sure(self) -> str:
        """How sure that is, in words."""
        return SURE.get(self.gravest[1].outcome, "not sure what") if self.gravest else ""

    @property
    def cost_share(self) -> float:
        """How far the stem is from where the valve's last good model has it, rms, of the stroke: the gravest's."""
        if self.gravest is None or self.given is None:
            return 0.0
        return (self.gravest[1].error_before_m or 0.0) / self.given.valve.stroke_m

    def order(self) -> tuple[int, float, str]:
        """Sort by this: the gravest outcome first, then what it costs, then the name."""
        place = GRAVEST.index(self.gravest[1].outcome) if self.gravest else len(GRAVEST)
        return place, -self.cost_share, self.name

    def model_before(self, time: datetime) -> ValveFile:
        """Return the model that the recording of a time was held against.

        Raises:
            LookupError: the valve's file cannot be read.
        """
        text = next((each.text for each in reversed(self.models) if each.when < time), None)
        if text is not None:
            return valve_in(text)
        if self.given is None:
            raise LookupError(self.name)
        return self.given

    def model_at(self, time: datetime) -> str | None:
        """Return the text of the model that held at a time; None: still the given file."""
        return next((each.text for each in reversed(self.models) if each.when <= time), None)


def complaint_of(name: str) -> str:
    """Return what an engineer calls an effect, one of its parameters, or one of the bare valve that changed."""
    if name in COMPLAINTS:
        return COMPLAINTS[name]
    try:
        return find_effect(name if name.endswith(".py") else name.partition(".")[0], "model").complaint
    except InputError:  # one of a person's own whose file is elsewhere; another number of the data sheet
        return UNKNOWN_COMPLAINT


def kinds_of_changes(changes: Sequence[Change]) -> list[str]:
    """Return what an engineer calls parameters that changed.

    A spring does not change by itself. Where it seems to and friction with it, by one factor, the pressure that arrives
    is another than was asked for: it is the only force that all others are measured by. Where it seems to alone, the
    position is measured by another scale, or the spring or the diaphragm is another.
    """
    factors = {each.name: each.now / each.before for each in changes if each.before}
    if SPRING not in factors:
        return [complaint_of(each.name) for each in changes]
    if COULOMB in factors and abs(factors[COULOMB] / factors[SPRING] - 1.0) < LIKE_FACTORS:
        return ["air supply or leak"]
    others = [complaint_of(each.name) for each in changes if each.name != SPRING]
    return ["lost calibration", SPRING_OR_DIAPHRAGM, *others]


def valve_in(text: str) -> ValveFile:
    """Return the valve file of a model's text."""
    return validate(ValveFile, tomllib.loads(text), "model")
