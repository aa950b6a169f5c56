"""What a verdict is asked before it is believed: the checks, in their order.

A stem that moves before its command is asked nothing: no model of it can hold (`workbench.data.clock_difference`).
"""

from collections.abc import Callable
from dataclasses import replace

from workbench.diagnosis.command_or_pressure import by_command
from workbench.diagnosis.doubt import Case, Doubt
from workbench.diagnosis.imitating_effect import imitating_effect
from workbench.diagnosis.kept_mass import kept_mass
from workbench.diagnosis.measured_pressure import by_measured_pressure
from workbench.diagnosis.moved_parameters import moved_parameters
from workbench.diagnosis.pressure_scale import driven_at_another_scale

CHECKS: tuple[Callable[[Case], Doubt | None], ...] = (
    driven_at_another_scale,
    by_command,
    kept_mass,
    by_measured_pressure,
    imitating_effect,
    moved_parameters,
)


def with_doubts(case: Case) -> Case:
    """Return a case with what speaks against its verdict, in the order of the checks."""
    for check in () if case.parts.early else CHECKS:
        if doubt := check(case):
            case = replace(case, doubts=(*case.doubts, doubt))
    return case
