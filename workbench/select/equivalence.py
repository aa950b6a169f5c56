"""What no record of pressure and position tells apart: classes that follow from the equations, never ranked inside.

    A p = k_s x + F_0 + ...,  y = x + b         F_0 = -k_s b: preload and sensor offset are one
    A p = k_s x + ...,        y = g x           k_s / g, F_v / g, m / g: a gain of the sensor is another spring
    |y - x| <= b/2                              between reversals F_c + k_s b / 2, F_s - k_s b / 2

The first two stand in the effects' files, as a confounding with an empty text. The third is the record's. Where a
motion begins with a reversal, the play is taken up first, and from there on

    m y'' = A p - k_s (y + b/2) - F_v y' - F_c      opening: y = x - b/2, a Coulomb friction of F_c + k_s b/2
    A p - k_s y at break-away: F_s - k_s b/2        the stem broke away from x = y - b/2, where it came to rest closing

so that a bare valve does the same but for the moment in which the play is taken up. Where the stem goes on in the
same direction after a rest, the play is taken up already and break-away is at F_s, which tells, unless the command
jumps past both. Hence `undetectable` asks the record itself: it is simulated with growing plays and friction changed
so.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from config.drive import Scale
from config.recording import Column
from config.valve_file import EffectTable, ValveFile, ValveParameters
from signals.moves import slips
from sim.composition import BASE, Composition
from sim.effect import Effect
from sim.interpreted import interpreted
from workbench.data.held_out import Part, Split
from workbench.model.free_run import FreeRun
from workbench.select.selection_thresholds import SELECTION

BACKLASH = "backlash"

STROKE_SHARES = (0.0, 0.1373, 0.3819, 0.6181, 0.8771)
"""Of the stroke: none is a multiple of another, as those of a quantum are."""


@dataclass(frozen=True, slots=True)
class Undetectable:
    """A play that the recordings do not show up to a width, and the parameters that stand in for it."""

    most_m: float
    length: Scale
    """As it is read."""
    name: ClassVar = BACKLASH
    like: ClassVar = ("coulomb_n", "static_n")
    shown_by: ClassVar = "slow restarts in the same direction after a hold"

    @property
    def sentence(self) -> str:
        """Say so."""
        return (
            f"{self.name} of up to {self.length.said(self.most_m, '.2g')} or more would not show: with other values of "
            f"{' and '.join(self.like)} the recordings look the same; {self.shown_by} would tell"
        )


def undetectable(split: Split, valve: ValveFile) -> tuple[Undetectable, ...]:
    """Return what may be there unseen beside the effects of a fitted valve: a play that friction stands in for."""
    if any(each.name == BACKLASH for each in valve.effect) or not valve.valve.spring_n_per_m:
        return ()
    widest_m = 2.0 * valve.valve.coulomb_n / valve.valve.spring_n_per_m
    least_m = SELECTION.least_play * split.scale_m
    if not least_m < widest_m:
        return ()
    most_m, shown_m = 0.0, SELECTION.detectable * split.scale_m
    # The widest would leave no Coulomb friction at all.
    for width_m in np.geomspace(least_m, 0.99 * widest_m, SELECTION.plays_tried).tolist():
        twin = with_backlash(valve, width_m)
        if any(_apart_m(each, valve, twin) > shown_m for each in (split.train, split.test)):
            break
        most_m = width_m
    return (Undetectable(most_m, valve.valve.own.length),) if most_m else ()


def with_backlash(file: ValveFile, width_m: float) -> ValveFile:
    """Return the valve with play that answers as this one does between reversals."""
    valve = file.valve
    shift_n = 0.5 * valve.spring_n_per_m * width_m
    changed = valve.model_copy(update={"coulomb_n": valve.coulomb_n - shift_n, "static_n": valve.static_n + shift_n})
    play = EffectTable.model_validate({"name": BACKLASH, "width_m": width_m})
    return ValveFile(valve=changed, effect=(play, *file.effect))


def _apart_m(part: Part, one: ValveFile, other: ValveFile) -> float:
    """Return the rms distance of two valves' answers, once every play is taken up; infinite in a record too short."""
    record = part.record
    begun = np.zeros(len(record), np.bool_)
    for first, end in record.segments:
        found = slips(np.where(record.valid, record.position_m, np.nan)[first:end], record.scale_m)
        if len(found) > SELECTION.slips_before:
            begun[first + found[SELECTION.slips_before].first : end] = True
    rows = part.counted & begun
    if not rows.any():
        return np.inf
    apart = _answer_m(part, one)[rows] - _answer_m(part, other)[rows]
    return float(np.sqrt(np.nanmean(apart**2)))


def _answer_m(part: Part, file: ValveFile) -> Column:
    composition = Composition.from_file(file)
    return FreeRun(composition, part.record).position_m(composition.theta)


def algebraic_class(name: str, library: Mapping[str, Effect]) -> frozenset[str]:
    """Return the effects and parameters of the bare valve that a record cannot tell from an effect; itself included."""
    members, grown = frozenset[str](), frozenset({name})
    while grown != members:
        members = grown
        grown = members.union(*(_same(each, library) for each in members))
    return members


def bare_parameter(name: str, library: Mapping[str, Effect]) -> str | None:
    """Return the parameter of the bare valve that already does what an effect does, None if there is none."""
    return next((each for each in sorted(algebraic_class(name, library)) if each in BASE), None)


def classes(names: Iterable[str], library: Mapping[str, Effect]) -> list[frozenset[str]]:
    """Return the names gathered into their algebraic classes, in the order of first mention."""
    names = list(names)
    gathered: list[frozenset[str]] = []
    for name in names:
        if not any(name in each for each in gathered):
            gathered.append(algebraic_class(name, library) & frozenset(names))
    return gathered


def distinguishing_record(name: str, other: str, library: Mapping[str, Effect]) -> str:
    """Return what record tells two effects apart, as their files say it; empty if they do not."""
    return library[name].confounded.get(other, "") or library[other].confounded.get(name, "")


def unseen_without_spring(effect: Effect, valve: ValveParameters) -> str:
    """Say why a drive without a spring cannot show an effect; empty if it can, or there is a spring.

    An indication that is off by a constant stands in for a force only where a spring says from where the stem is moved.
    """
    if valve.spring_n_per_m or effect.places != ("sensor",) or effect.memory:
        return ""
    laws = interpreted((effect,))
    theta = [*([0.0] * len(BASE)), *effect.strengths(valve)[0]]
    places_m = [part * valve.stroke_m for part in STROKE_SHARES]
    off_m = [laws.sensor(x, x, 0.0, laws.Stem(0.0, x, 0.0, 0.0), theta, ())[1] - x for x in places_m]
    all_same = max(off_m) - min(off_m) <= SELECTION.same_length * valve.stroke_m
    return "shifts the indication, and a drive without a spring stands anywhere" if all_same else ""


def _same(name: str, library: Mapping[str, Effect]) -> frozenset[str]:
    if name not in library:
        return frozenset(each for each, effect in library.items() if effect.confounded.get(name) == "")
    return frozenset(other for other, text in library[name].confounded.items() if not text) | frozenset(
        each for each, effect in library.items() if effect.confounded.get(name) == ""
    )
