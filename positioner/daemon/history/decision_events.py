"""Which events lie between two decisions of the controller, and their classes by NAMUR NE 107.

fault      latched, or acknowledged and gone      F, or what table `[supervision]` says
alarm      a monitor's condition holds, or no more
mode, excitation, a played experiment             C while the valve does not follow the DCS
identification applied, refused                   good
what was restored is judged anew                  good, M where a landing contradicts it
"""

from collections.abc import Iterator
from typing import NamedTuple

from config.codes import S3, EventKind, Fault, Mode, Ne107Status, Restored
from positioner.control.controller_memory import Decision
from positioner.daemon.health.ne107 import FaultClasses, class_of


class Happened(NamedTuple):
    """What happened, its class, and its cause as a number of `config.codes.CAUSES` or in words."""

    kind: EventKind
    ne107: Ne107Status = Ne107Status.GOOD
    cause: int = 0
    text: str = ""


def noted(decision: Decision) -> tuple[object, ...]:
    """Return what of a decision makes an event when it changes; compared once a cycle."""
    return (
        decision.fault,
        decision.mode,
        decision.applied,
        decision.alarms,
        decision.state is S3,
        decision.restoration.trust,
        decision.experiment.state,
    )


def events_between(before: Decision, after: Decision, classes: FaultClasses) -> Iterator[Happened]:
    """Yield what happened from one decision to another, the cause of the rest first."""
    yield from _alarms(before, after, classes)
    if before.fault is not after.fault:
        if after.fault is Fault.NONE:
            yield Happened(EventKind.FAULT_GONE, cause=before.fault)
        else:
            yield Happened(EventKind.FAULT, class_of(after.fault, classes), after.fault)
    if before.mode is not after.mode:
        yield Happened(EventKind.MODE, _check(after.mode is not Mode.AUTOMATIC), after.mode)
    yield from _excitation(before, after)
    if after.applied.count > before.applied.count:
        found = after.estimates.sampling
        yield Happened(EventKind.IDENTIFIED, text=f"the device samples {found.text}" if found else "")
    if after.applied.refusals > before.applied.refusals:
        yield Happened(EventKind.NOT_IDENTIFIED, cause=after.applied.last_refusal)
    if (trust := after.restoration.trust) is not before.restoration.trust:
        status = Ne107Status.MAINTENANCE_REQUIRED if trust is Restored.DROPPED else Ne107Status.GOOD
        yield Happened(EventKind.RESTORED, status, trust)
    if (played := after.experiment.state) is not before.experiment.state:
        yield Happened(EventKind.EXPERIMENT, _check(after.experiment.commands), played)


def _alarms(before: Decision, after: Decision, classes: FaultClasses) -> Iterator[Happened]:
    for alarm in sorted(set(after.alarms) - set(before.alarms)):
        yield Happened(EventKind.ALARM, class_of(alarm, classes), alarm)
    for alarm in sorted(set(before.alarms) - set(after.alarms)):
        yield Happened(EventKind.ALARM_GONE, cause=alarm)


def _excitation(before: Decision, after: Decision) -> Iterator[Happened]:
    was, now = (each.state is S3 for each in (before, after))
    if now and not was:
        yield Happened(EventKind.EXCITED, Ne107Status.FUNCTION_CHECK)
    if was and not now:
        yield Happened(EventKind.EXCITATION_ENDED, cause=after.inhibit_reason)


def _check(holds: bool) -> Ne107Status:
    return Ne107Status.FUNCTION_CHECK if holds else Ne107Status.GOOD
