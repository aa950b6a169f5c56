"""How a record is simulated: by how far apart its samples are, and by whether its command changed between them.

    t_s = tau log(L / sigma)      a slide over the stroke L comes to within the noise sigma of its end in that time
    tau = F_v / k_s, or 2 m / F_v where that is longer

    s = exp(-pi zeta / sqrt(1 - zeta^2)),  zeta = F_v / (2 sqrt(k_s m))
                                  the share of its way by which a stem with little damping swings past its balance, to
                                  stick there

dynamic       samples closer than t_s: with inertia; and where s L is more than the noise, for where a slide ends hangs
              on it, whether or not the slide is seen
quasi-static  samples farther apart: without (`sim.quasi_static`), a step a sample; of a set point in shorter ones, for
              its positioner acts between samples
landings      the same, and the command changed between samples, perhaps several times: a stem that moves in the very
              sample in which the recorded command changes began before it could have known. What the pressure did
              meanwhile is not known, so the measured positions say when the stem went which way, and the model where
              it lands, by the pressure of the rest. Only rests are judged.

A movement that begins from rest is early if the recorded command goes its way by more in this sample than it did in the
two before together: as a held command that acts from its sample on never makes it. A command that ramps evenly, as that
of an integrating controller, never does that; there where slides end tells (`command_between_samples`). Where
slides are seen it is early in the same way, if a logger reads commands that change in between: when one changed is
known to a sample then, which mistimes its slide by as much, and no model explains that.
"""

from dataclasses import dataclass, field, replace
from enum import StrEnum
from math import exp, log, pi, sqrt
from typing import NamedTuple

import numpy as np

from config.recording import Column
from config.valve_file import ValveParameters
from signals.moves import Rest, rests
from sim.effect import Effect
from workbench.data.record import Record
from workbench.model.command_between_samples import PartOfTheWay, part_of_the_way

EARLY, FEWEST_EARLY = 0.3, 3
"""Share and number of movements that begin early, from which the command changed between samples."""
MOST_WITH_INERTIA = 20_000
"""Samples: a longer record, seen so slowly, is simulated without."""
EARLY_SEEN = 0.1
"""The same share where slides are seen: in a part of a sample few stems have moved by more than the noise."""
MOVED = 6.0
"""Noises by which a stem that left its rest has moved."""
NEGLIGIBLE_N = 0.02
"""Of F_c: a change of the pressure force that moves nothing."""
ALIKE_PERIOD_SHARE = 0.05
"""Relative difference of the periods of records that are sampled alike."""
SETTLED_M = 3.0
"""Noises, or that share of F_c, that a rest may shift with what the pressure still does in its first samples."""
MORE_LANDINGS = (
    "export the command's changes with their times, or record samples closer than slides last, or steps held until the "
    "stem has rested for some samples"
)
"""What record would tell, where the command changed between samples."""
NO_LANDING = (
    "the command changed between samples, and no slide is seen to end in a rest of three samples, by which alone it "
    f"could be judged: {MORE_LANDINGS}"
)


class Motion(StrEnum):
    """How it is simulated."""

    DYNAMIC = "dynamic"
    QUASI_STATIC = "quasi-static"
    LANDINGS = "landings"


@dataclass(frozen=True, slots=True)
class Sampling:
    """How a record is simulated, and a sentence why."""

    motion: Motion
    sentence: str
    held: bool = True
    """Whether a command acts from its sample on until the next; else it is known at its sample alone."""
    period_s: float = 0.0
    """Of the record that it was chosen for,"""
    valve: ValveParameters | None = field(default=None, repr=False)
    """and by whose numbers: not those that a fit comes to, lest two models be judged by other rows."""
    sure: bool = True
    """Whether the record tells that its command was held, or that it was not; else it is taken for held."""

    @property
    def slow(self) -> bool:
        """Whether the stem is simulated without inertia."""
        return self.motion is not Motion.DYNAMIC

    def of(self, other: Record, valve: ValveParameters) -> "Sampling":
        """Return how another record is simulated: as this one if it is sampled alike."""
        alike = abs(other.period_s - self.period_s) <= ALIKE_PERIOD_SHARE * self.period_s
        return self if alike else sampling(other, self.valve or valve)

    def told(self) -> "Sampling":
        """Return that of a held command by which the stem lands if it went as the measured one did."""
        return replace(self, motion=Motion.LANDINGS, sentence="every rest judged by itself", held=True)

    def left_out(self, effect: Effect) -> str:
        """Say why an effect cannot show in a record of such a sampling; empty if it can."""
        if self.slow and effect.only_in_motion:
            return "acts on a moving stem alone, and the samples lie farther apart than slides last"
        if not self.held and effect.in_time:
            return "acts in time, and what happened between samples is not known"
        return ""


DYNAMIC = Sampling(Motion.DYNAMIC, "")


def sampling(record: Record, valve: ValveParameters) -> Sampling:
    """Choose how a record of a valve is simulated."""
    period_s, slide_s = record.period_s, slide_time_s(valve, record.scale_m)
    if not period_s > slide_s:
        return _with_slides_seen(record, valve)
    why = f"samples every {period_s:.3g} s cannot see slides of {slide_s:.2g} s"
    if record.by_setpoint:
        return Sampling(Motion.QUASI_STATIC, f"simulated without inertia: {why}", True, period_s, valve)
    early, begun = _early(record, valve)
    if early >= max(FEWEST_EARLY, EARLY * begun):
        changed = f"{early} of {begun} movements began before the command that is recorded with their start"
        return _by_landings(record, valve, changed, why)
    part = part_of_the_way(record)
    if part is not None and part.between:
        return _by_landings(record, valve, _ends_ahead(part), why)
    if affords_inertia(record) and swing_m(valve) > record.scale_m:
        return with_inertia(record, valve)
    sentence, sure = f"simulated without inertia, a step a sample: {why}", part is None or part.held
    if not sure:
        sentence += "; the command is taken as held from sample to sample, which the recording does not show"
    return Sampling(Motion.QUASI_STATIC, sentence, True, period_s, valve, sure)


def _with_slides_seen(record: Record, valve: ValveParameters) -> Sampling:
    """Return that of a record which shows slides; whether its commands are known to better than a sample, it tells."""
    seen = with_inertia(record, valve)
    early, begun = (0, 0) if record.by_setpoint else _early(record, valve)
    if early < max(FEWEST_EARLY, EARLY_SEEN * begun):
        return seen
    sentence = (
        f"the command changed between samples ({early} of {begun} movements had begun by the sample in which it is "
        "first recorded): when, is known to a sample, and it is taken for held"
    )
    return replace(seen, sentence=sentence, sure=False)


def _by_landings(record: Record, valve: ValveParameters, changed: str, why: str) -> Sampling:
    """Return that of a command which changed between samples, as so much shows."""
    found = landings(record, valve)
    judged = sum(each.settled for each in found)
    return Sampling(
        Motion.LANDINGS,
        f"the command changed between samples ({changed}): the pressure in between is not known, so the model is held "
        f"against {judged} landings of {len(found)}, by the pressure at rest, without inertia: {why}",
        False,
        record.period_s,
        valve,
    )


def _ends_ahead(part: PartOfTheWay) -> str:
    return (
        f"{part.moves} movements end {part.part:.2g} of the way, give or take {part.std:.1g}, from where the command "
        "before them puts the stem to where the one after them does"
    )


def slide_time_s(valve: ValveParameters, noise_m: float) -> float:
    """Return t_s, s; infinite for a stem that nothing damps or brings back."""
    if not (valve.viscous_ns_per_m > 0.0 and valve.spring_n_per_m > 0.0):
        return np.inf
    slowest_s = max(valve.viscous_ns_per_m / valve.spring_n_per_m, 2.0 * valve.mass_kg / valve.viscous_ns_per_m)
    return slowest_s * log(max(valve.stroke_m / (noise_m or 1e-6 * valve.stroke_m), np.e))


def with_inertia(record: Record, valve: ValveParameters) -> Sampling:
    """Return how a record is simulated whose stem swings, as far as it was commanded by what is held."""
    return replace(DYNAMIC, period_s=record.period_s, valve=valve)


def affords_inertia(record: Record) -> bool:
    """Whether a record is short enough to be simulated with inertia, if its stem swings."""
    return len(record) <= MOST_WITH_INERTIA


def swing_m(valve: ValveParameters) -> float:
    """Return s L, m; none for what has no spring to swing on."""
    if not valve.spring_n_per_m > 0.0:
        return 0.0
    zeta = valve.viscous_ns_per_m / (2.0 * sqrt(valve.spring_n_per_m * valve.mass_kg))
    return valve.stroke_m * exp(-pi * zeta / sqrt(1.0 - zeta**2)) if zeta < 1.0 else 0.0


def _early(record: Record, valve: ValveParameters) -> tuple[int, int]:
    """Return how many movements from rest begin early, and how many there are."""
    early = begun = 0
    least_pa = NEGLIGIBLE_N * valve.coulomb_n / valve.diaphragm_area_m2
    for each in _rests(record):
        last = each.end - 1
        end = _segment_end(record, last)
        if each.end >= end or each.first > last - 2:
            continue
        way = np.sign(record.position_m[each.end] - each.position_m)
        if not abs(record.position_m[each.end] - each.position_m) > MOVED * record.scale_m:
            continue
        now_pa = way * float(record.command_pa[last + 1] - record.command_pa[last])
        before_pa = way * float(record.command_pa[last] - record.command_pa[last - 2])
        begun += 1
        early += now_pa > max(before_pa, 0.0) + least_pa
    return early, begun


def _segment_end(record: Record, row: int) -> int:
    return next(end for first, end in record.segments if first <= row < end)


class Landing(NamedTuple):
    """A rest that a slide ended in, by the record's rows; whether the pressure had settled then."""

    rest: Rest
    settled: bool


def landings(record: Record, valve: ValveParameters) -> tuple[Landing, ...]:
    """Return the landings of a record, in order."""
    allowed_n = max(SETTLED_M * record.scale_m * valve.spring_n_per_m, NEGLIGIBLE_N * valve.coulomb_n)
    pressure_pa = record.command_pa if record.pressure_pa is None else record.pressure_pa
    return tuple(
        Landing(each, float(np.ptp(pressure_pa[each.first : each.first + 2])) * valve.diaphragm_area_m2 <= allowed_n)
        for each in _rests(record)
        if each.direction
    )


def _rests(record: Record) -> list[Rest]:
    """Return the rests of a record, by its rows."""
    position_m: Column = np.where(record.valid, record.position_m, np.nan)
    return [
        each._replace(first=first + each.first, end=first + each.end)
        for first, end in record.segments
        for each in rests(position_m[first:end], record.scale_m)
    ]
