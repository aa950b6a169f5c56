"""Supervision: did the daemon run, is the measurement fresh and plausible, does the DCS live, who commands?

What one sample shows is judged here, as a measurement that repeats itself (`positioner/daemon/link.py` marks it). What
must hold for some time is judged in `monitors.py`: a frozen sensor, a jump of the position, a stem away from its
reference.

It knows nothing of the law. A fault is latched: the mode falls to hold, the safe action commands, and only an
acknowledgement after its cause is gone frees the way; then a person or the DCS must choose a mode again. A fault whose
action is manual leaves the valve to an operator instead: the mode falls to manual, unless it was hold, and the pressure
is held until they write one.

A device that has not answered yet since the cycles began is not there yet. That is a fault while it lasts, and is not
latched: nothing was commanded. What the device holds when it is found is held.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from config.codes import GOOD, HOLD, LOST, MANUAL, NO_NUMBER, REPEATED, Fault, Mode
from config.quantities import DeviceStatus
from config.supervision_table import FaultActionName, SafeActionName
from positioner.control.keyword_records import by_name
from positioner.control.requests import Requests
from positioner.control.sample import Sample

NO_FAULT = Fault.NONE


@dataclass(frozen=True, slots=True)
class Limits:
    """What supervision holds a sample against."""

    stroke_m: float
    travel_margin: float
    lost_after_cycles: int
    stale_after_s: float
    heartbeat_timeout_s: float
    restart_tolerance_pa: float
    """A device that comes back with a command farther than this from ours was restarted."""
    action: SafeActionName
    heartbeat_action: FaultActionName
    actions: Mapping[Fault, FaultActionName] = field(default_factory=dict)
    """Of faults that have their own."""

    def plausible(self, position_m: float) -> bool:
        """Return whether a stem can be there; NaN is nowhere."""
        margin_m = self.travel_margin * self.stroke_m
        return -margin_m <= position_m <= self.stroke_m + margin_m

    def action_on(self, fault: Fault) -> FaultActionName:
        """Return the action that answers a fault."""
        return self.actions.get(fault, self.heartbeat_action if fault is Fault.DCS_SILENT else self.action)


class SupervisionMemory(NamedTuple):
    """What supervision remembers from cycle to cycle; a tuple, for it is made anew in each."""

    mode: Mode = HOLD
    fault: Fault = NO_FAULT
    bad_in_a_row: int = 0
    lost_in_a_row: int = 0
    """Of those, the last that were not answered; the others were, with no number or an impossible position."""
    good_s: float = -math.inf
    heartbeat_s: float = -math.inf
    mode_writes: int = 0
    acknowledgements: int = 0
    heartbeats: int = 0
    position_m: float | None = None
    """Of the stem at the last good measurement; None before the first since the cycles began."""
    unanswered_pa: tuple[float, ...] = ()
    """Commands given since the last good measurement, which the device may hold or not."""

    def begun(self) -> "SupervisionMemory":
        """Return what is known where the cycles begin: what was seen before, while the valve was set up, is too old."""
        return self._replace(bad_in_a_row=0, lost_in_a_row=0, good_s=-math.inf, position_m=None, unanswered_pa=())

    @property
    def awaited(self) -> bool:
        """Whether the device has not given one good measurement yet: it is not there yet, and nothing was told it."""
        return self.position_m is None

    def failed(self, limits: Limits) -> "SupervisionMemory":
        """Return what is known where the daemon itself has failed: what was to be commanded is not finite."""
        fault = Fault.COMMAND_NOT_FINITE
        by_hand = self.mode is not HOLD and limits.action_on(fault) == "manual"
        return self._replace(mode=MANUAL if by_hand else HOLD, fault=fault)


supervision_of = by_name(SupervisionMemory)

UNFIT_STATUS = sum(DeviceStatus)
"""Every bit of it: none is set of a device that measures and obeys."""


def usable(sample: Sample, limits: Limits) -> bool:
    """Return whether a sample is new and could be true."""
    return sample.quality is GOOD and limits.plausible(sample.position_m)


def supervise(
    memory: SupervisionMemory,
    sample: Sample,
    command_pa: float,
    requests: Requests,
    limits: Limits,
    *,
    good: bool,
    monitored: Fault = NO_FAULT,
) -> SupervisionMemory:
    """Return what is known after this sample.

    Args:
        memory: after the sample before.
        sample: the latest; `good` says whether it is `usable`.
        command_pa: given last.
        requests: of the DCS.
        limits: of the valve.
        good: as said.
        monitored: what monitors found.
    """
    now_s, quality = sample.now_s, sample.quality
    first = memory.good_s == -math.inf
    alive = first or requests.heartbeats != memory.heartbeats
    bad_in_a_row = 0 if good or quality is REPEATED else memory.bad_in_a_row + 1
    lost_in_a_row = memory.lost_in_a_row + 1 if quality is LOST else 0
    good_s = now_s if good or first else memory.good_s
    heartbeat_s = now_s if alive else memory.heartbeat_s

    # After a reply or two that were lost the device may hold what was given before them; after more it was away.
    short = memory.bad_in_a_row < limits.lost_after_cycles
    given_pa = (*memory.unanswered_pa, command_pa) if short else (command_pa,)

    unheard = lost_in_a_row >= limits.lost_after_cycles
    given_pa = (sample.held_pa,) if memory.awaited and sample.held_pa is not None else given_pa
    cause = _cause(sample, given_pa, bad_in_a_row, now_s - good_s, limits, unheard=unheard)
    cause = cause or monitored
    # Who chooses a mode meanwhile gets it for no cycle: one would be a command, and the fault would hold that.
    commanding = memory.mode is not HOLD or (requests.mode_writes != memory.mode_writes and requests.mode is not HOLD)
    silent = 0 < limits.heartbeat_timeout_s < now_s - heartbeat_s and commanding
    if silent and not cause:
        cause = Fault.DCS_SILENT
    not_there_yet = memory.awaited and memory.fault is Fault.NO_REPLY
    acknowledged = requests.acknowledgements != memory.acknowledgements
    fault = cause or (NO_FAULT if acknowledged or not_there_yet else memory.fault)
    return supervision_of(
        mode=_mode(memory, requests, fault, limits),
        fault=fault,
        bad_in_a_row=bad_in_a_row,
        lost_in_a_row=lost_in_a_row,
        good_s=good_s,
        heartbeat_s=heartbeat_s,
        mode_writes=requests.mode_writes,
        acknowledgements=requests.acknowledgements,
        heartbeats=requests.heartbeats,
        position_m=sample.position_m if good else memory.position_m,
        unanswered_pa=(command_pa,) if good else given_pa,
    )


def _cause(
    sample: Sample, given_pa: tuple[float, ...], bad_in_a_row: int, age_s: float, limits: Limits, *, unheard: bool
) -> Fault:
    if sample.unattended_s > 0 or sample.overwritten:
        return Fault.STALLED if sample.unattended_s > 0 else Fault.OTHER_MASTER
    held_pa = sample.held_pa
    another = held_pa is not None and all(abs(held_pa - each) > limits.restart_tolerance_pa for each in given_pa)
    if another or sample.restarted:
        return Fault.RESTARTED
    if bad_in_a_row >= limits.lost_after_cycles:
        return Fault.NO_REPLY if unheard else Fault.IMPLAUSIBLE
    if (unfit := sample.status & UNFIT_STATUS) and sample.quality is not LOST:
        return Fault.COMMUNICATION_LOST if unfit == DeviceStatus.COMMUNICATION_LOST else Fault.DEVICE
    if age_s > limits.stale_after_s:  # on a slow line sooner than so many cycles
        by_quality = {LOST: Fault.NO_REPLY, NO_NUMBER: Fault.IMPLAUSIBLE}
        return by_quality.get(sample.quality, Fault.STALE)
    return NO_FAULT


def _mode(memory: SupervisionMemory, requests: Requests, fault: Fault, limits: Limits) -> Mode:
    written = requests.mode_writes != memory.mode_writes
    if not fault:
        return requests.mode if written else memory.mode
    by_hand = memory.mode is not HOLD and limits.action_on(fault) == "manual"
    return MANUAL if by_hand and not (written and requests.mode is HOLD) else HOLD
