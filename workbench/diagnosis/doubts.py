"""What a verdict is asked before it is believed: the checks, in their order, and the doubt that each may raise.

A stem that moves before its command is asked nothing: no model of it can hold (`workbench.data.clock_difference`).
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

from workbench.diagnosis.command_or_pressure import ByCommand, by_command
from workbench.diagnosis.doubt import Case, Doubt
from workbench.diagnosis.imitating_effect import StandIn, imitating_effect
from workbench.diagnosis.kept_mass import KeptMass, kept_mass
from workbench.diagnosis.measured_pressure import ByMeasuredPressure, by_measured_pressure
from workbench.diagnosis.moved_parameters import MovedParameters, moved_parameters
from workbench.diagnosis.pressure_scale import PressureScale, driven_at_another_scale

CHECKS: Mapping[type[Doubt], Callable[[Case], Doubt | None]] = {
    PressureScale: driven_at_another_scale,
    ByCommand: by_command,
    KeptMass: kept_mass,
    ByMeasuredPressure: by_measured_pressure,
    StandIn: imitating_effect,
    MovedParameters: moved_parameters,
}


def with_doubts(case: Case) -> Case:
    """Return a case with what speaks against its verdict, in the order of the checks."""
    for check in () if case.parts.early else CHECKS.values():
        if doubt := check(case):
            case = replace(case, doubts=(*case.doubts, doubt))
    return case
