"""Supervision: did the daemon run, is the measurement fresh and plausible, does the DCS live, who commands?

It knows nothing of the law. A fault is latched: the mode falls to hold, the safe action commands, and only an
acknowledgement after its cause is gone frees the way; then a person or the DCS must choose a mode again.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from config.codes import Fault, Mode, Quality
from config.quantities import DeviceStatus
from config.supervision_table import SafeActionName
from positioner.control.requests import Requests
from positioner.control.sample import Sample


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
    heartbeat_action: SafeActionName
    actions: Mapping[Fault, SafeActionName] = field(default_factory=dict)
    """Of faults that have their own."""

    def plausible(self, position_m: float) -> bool:
        """Return whether a stem can be there; NaN is nowhere."""
        margin_m = self.travel_margin * self.stroke_m
        return -margin_m <= position_m <= self.stroke_m + margin_m

    def action_on(self, fault: Fault) -> SafeActionName:
        """Return the safe action that answers a fault."""
        return self.heartbeat_action if fault is Fault.DCS_SILENT else self.actions.get(fault, self.action)


class SupervisionMemory(NamedTuple):
    """What supervision remembers from cycle to cycle; a tuple, for it is made anew in each."""

    mode: Mode = Mode.HOLD
    fault: Fault = Fault.NONE
    bad_in_a_row: int = 0
    good_s: float = -math.inf
    heartbeat_s: float = -math.inf
    mode_writes: int = 0
    acknowledgements: int = 0
    heartbeats: int = 0
    measured: bool = False
    """Whether there was a good measurement since the start."""
    unanswered_pa: tuple[float, ...] = ()
    """Commands given since the last good measurement, which the device may hold or not."""


UNFIT_STATUS = int(DeviceStatus.SENSOR_FAULT | DeviceStatus.NOT_READY | DeviceStatus.COMMUNICATION_LOST)


def usable(sample: Sample, limits: Limits) -> bool:
    """Return whether a sample is new and could be true."""
    return sample.quality is Quality.GOOD and limits.plausible(sample.position_m)


def supervise(
    memory: SupervisionMemory,
    sample: Sample,
    command_pa: float,
    requests: Requests,
    limits: Limits,
    monitored: Fault = Fault.NONE,
) -> SupervisionMemory:
    """Return what is known after this sample; `command_pa` was given last, `monitored` is what monitors found."""
    good = usable(sample, limits)
    bad = not good and sample.quality is not Quality.REPEATED
    first = math.isinf(memory.good_s)
    alive = first or requests.heartbeats != memory.heartbeats
    bad_in_a_row = memory.bad_in_a_row + 1 if bad else 0
    good_s = sample.now_s if good or first else memory.good_s
    heartbeat_s = sample.now_s if alive else memory.heartbeat_s

    # After a reply or two that were lost the device may hold what was given before them; after more it was away.
    short = memory.bad_in_a_row < limits.lost_after_cycles
    given_pa = (*memory.unanswered_pa, command_pa) if short else (command_pa,)

    cause = _cause(sample, given_pa, bad_in_a_row, sample.now_s - good_s, limits) or monitored
    silent = memory.mode is not Mode.HOLD and 0 < limits.heartbeat_timeout_s < sample.now_s - heartbeat_s
    if cause is Fault.NONE and silent:
        cause = Fault.DCS_SILENT
    acknowledged = requests.acknowledgements != memory.acknowledgements
    latched = Fault.NONE if acknowledged else memory.fault
    fault = cause if cause is not Fault.NONE else latched
    return SupervisionMemory(
        mode=_mode(memory, requests, fault),
        fault=fault,
        bad_in_a_row=bad_in_a_row,
        good_s=good_s,
        heartbeat_s=heartbeat_s,
        mode_writes=requests.mode_writes,
        acknowledgements=requests.acknowledgements,
        heartbeats=requests.heartbeats,
        measured=memory.measured or good,
        unanswered_pa=(command_pa,) if good else given_pa,
    )


def _cause(sample: Sample, given_pa: tuple[float, ...], bad_in_a_row: int, age_s: float, limits: Limits) -> Fault:
    if sample.unattended_s > 0 or sample.overwritten:
        return Fault.STALLED if sample.unattended_s > 0 else Fault.OTHER_MASTER
    held_pa = sample.held_pa
    if held_pa is not None and all(abs(held_pa - each) > limits.restart_tolerance_pa for each in given_pa):
        return Fault.RESTARTED
    if bad_in_a_row >= limits.lost_after_cycles:
        return Fault.NO_REPLY if sample.quality is Quality.LOST else Fault.IMPLAUSIBLE
    if sample.quality is not Quality.LOST and sample.status & UNFIT_STATUS:
        return Fault.DEVICE
    if age_s > limits.stale_after_s:  # on a slow line sooner than so many cycles
        by_quality = {Quality.LOST: Fault.NO_REPLY, Quality.NO_NUMBER: Fault.IMPLAUSIBLE}
        return by_quality.get(sample.quality, Fault.STALE)
    return Fault.NONE


def _mode(memory: SupervisionMemory, requests: Requests, fault: Fault) -> Mode:
    if fault is not Fault.NONE:
        return Mode.HOLD
    return requests.mode if requests.mode_writes != memory.mode_writes else memory.mode
