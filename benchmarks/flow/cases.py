"""A positioner on the simulated valve in a flow loop, in virtual time.

The daemons know the valve from a staircase of slides, whatever their law, so that it is the laws that are compared.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from benchmarks.flow.course import FlowCourse, FlowFigures, course_in, course_of_stem, figures
from benchmarks.flow.loop import FlowController, FlowLoop, FlowProcess
from config.codes import Mode
from config.daemon_file import DaemonFile
from config.errors import CommandFailed
from config.loading import validate
from config.slave_file import SlaveFile
from config.valve_file import load_valve, shipped_valve
from positioner.control.requests import QUIET, Requests
from positioner.control.settings import Settings
from positioner.virtual.virtual_cycle import run_identification, virtual_cycle
from sim.slave.slave import device_of

POSITIONERS = {"conventional": "conventional", "seed": "seed's law", "slides": "slides (ours)"}
"""The laws, and what they are called here."""
VALVE = shipped_valve("seed")
STROKE_M = load_valve(VALVE).valve.stroke_m
DEAD_BAND = 3e-3
NOISE_PU = 1e-4
"""Standard deviation of the position, share of the stroke."""
CLOSED_S = 6.0
"""λ of the DCS's controller: three times the process's time constant, as is usual."""
STALE_PERIODS = 3
PERIODS_S = (0.02, 0.1)
"""Of the cycle."""


@dataclass(frozen=True, slots=True)
class FlowCase:
    """A positioner in the loop."""

    law: str
    period_s: float
    settle_s: float = 90.0
    """One period of the disturbance, before the steady state is measured."""
    measured_s: float = 300.0
    closed_s: float = CLOSED_S
    dead_band: float = DEAD_BAND
    interval_s: float = 0.0
    """Least time between two excursions, of the law of slides."""

    @property
    def title(self) -> str:
        """What it is called."""
        return f"{POSITIONERS[self.law]}, {1e3 * self.period_s:g} ms"


@dataclass(frozen=True, slots=True)
class FlowOutcome:
    """How a case went."""

    case: FlowCase
    course: FlowCourse
    frictionless: FlowCourse
    """The same loop with a stem that is always at its reference ..."""
    alone: FlowCourse
    """... and with one that is left where it is."""

    def figures_of(self, course: FlowCourse) -> FlowFigures:
        """Return the figures of one of them in the steady state."""
        return figures(course, self.frictionless, _controller(self.case).setpoint, self.case.settle_s)

    @property
    def figures(self) -> FlowFigures:
        """Those of the valve."""
        return self.figures_of(self.course)


def virtual_outcome(case: FlowCase, tuned: Callable[[Settings], Settings] = lambda each: each) -> FlowOutcome:
    """Run a case in virtual time, the controller with its settings or those that `tuned` makes of them.

    Raises:
        CommandFailed: the valve could not be identified.
    """
    daemon, slave = flow_files(case)
    first = Requests(mode=Mode.AUTOMATIC, mode_writes=1)
    cycle = virtual_cycle(daemon, device_of(slave, VALVE), first, tuned(Settings.of(daemon)))
    for _ in run_identification(cycle, daemon.excitation.staircase_limit_s, wait=False):
        pass
    applied = cycle.snapshot.decision.applied
    if applied.ratios is None:
        raise CommandFailed(f"{case.title}: not identified: {applied.last_refusal.text}")

    def write(reference_pu: float) -> None:
        before = cycle.requests
        reference_m, writes = reference_pu * STROKE_M, before.reference_writes + 1
        cycle.requests = replace(before, eta=QUIET, reference_m=reference_m, reference_writes=writes)

    loop = FlowLoop(FlowProcess(), _controller(case), cycle.snapshot.sample.time_s)
    course = course_in(cycle, loop, write, STROKE_M, case.settle_s + case.measured_s)
    frictionless, alone = (FlowLoop(FlowProcess(), _controller(case)) for _ in range(2))
    return FlowOutcome(
        case,
        course,
        course_of_stem(frictionless, course.time_s),
        course_of_stem(alone, course.time_s, alone.reference_pu),
    )


def flow_files(case: FlowCase) -> tuple[DaemonFile, SlaveFile]:
    """Return the files that a daemon and a slave would be given for a case."""
    daemon = {
        "valve": {"name": "flow", "stroke_m": STROKE_M},
        "cycle": {"pace": "device", "period_s": case.period_s},
        "safety": {"stale_after_s": STALE_PERIODS * case.period_s},
        "excitation": {"kind": "staircase"},
        "control": {"law": case.law, "dead_band": case.dead_band, "excursion_interval_s": case.interval_s},
    }
    slave = {
        "clock": {"mode": "lockstep", "period_s": case.period_s},
        "sensor": {"noise_std_m": NOISE_PU * STROKE_M, "seed": 1},
    }
    return validate(DaemonFile, daemon, case.title), validate(SlaveFile, slave, case.title)


def _controller(case: FlowCase) -> FlowController:
    return FlowController.tuned(FlowProcess(), case.closed_s)
