"""`positioner demo --loop flow`: does the positioner stop the oscillation of a flow loop?

Three positioners at two periods of the cycle in virtual time; with `--bus modbus` ours alone, for a minute, on wires.
"""

import time
from argparse import Namespace
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path

from config.errors import InputError
from positioner.cli.parts.flow_cases import CLOSED_S, DEAD_BAND, POSITIONERS, FlowCase, FlowOutcome, virtual_outcome
from positioner.cli.parts.output_files import make_folder, write_json
from positioner.virtual.flow_course import FlowFigures
from positioner.virtual.flow_loop import FlowController, FlowProcess

OURS = "slides"
PERIODS_S = (0.02, 0.1)
CASES = tuple(FlowCase(law, period_s) for period_s in PERIODS_S for law in POSITIONERS)
ON_BUS = FlowCase(OURS, PERIODS_S[0], settle_s=30.0, measured_s=60.0)
HEADINGS = (
    "std, %",
    "peak to peak, %",
    "abs error, % s",
    "valve adds, %",
    "strokes/min",
    "reversals/min",
    "vented/min",
)


def run_flow(arguments: Namespace) -> int:
    """Run it; exit status 1 when ours leaves no less of the oscillation than another."""
    if arguments.bus not in (None, "modbus"):
        raise InputError(f"--bus {arguments.bus}", "with --loop flow allowed is modbus; without --bus, virtual time")
    folder: Path | None = arguments.out
    if folder:
        make_folder(folder)
    started_s = time.monotonic()
    _print_lines(_head(arguments.bus))
    outcomes = list(_printed(_outcomes(arguments.bus)))
    _print_lines(_limits(outcomes[-1]))
    if folder:
        print(f"picture {_picture(folder, outcomes)}")
    problems = problems_of({each.case: each.figures for each in outcomes})
    if arguments.json:
        write_json(arguments.json, _jsonable(outcomes, problems, time.monotonic() - started_s), indent=1)
    _print_lines(f"DOES NOT HOLD: {problem}" for problem in problems)
    print(f"{'failed' if problems else 'all holds'}, {time.monotonic() - started_s:.0f} s")
    return 1 if problems else 0


def problems_of(found: dict[FlowCase, FlowFigures]) -> list[str]:
    """Say where ours leaves no less of the oscillation than another."""
    return [
        f"{case.title} leaves {_percent(ours.deviation_std)} %, {other.title} {_percent(others.deviation_std)} %"
        for case, ours in found.items()
        for other, others in found.items()
        if case.law == OURS and other.law != OURS and other.period_s == case.period_s
        if not ours.deviation_std < others.deviation_std
    ]


def _outcomes(bus: str | None) -> Iterator[FlowOutcome]:
    if bus is None:
        return map(virtual_outcome, CASES)
    from positioner.cli.parts.flow_on_bus import outcome_on_modbus

    return map(outcome_on_modbus, (ON_BUS,))


def _printed(outcomes: Iterable[FlowOutcome]) -> Iterator[FlowOutcome]:
    for outcome in outcomes:
        _print_lines([_row(outcome.case.title, outcome.figures)])
        yield outcome


def _head(bus: str | None) -> list[str]:
    process, controller = FlowProcess(), FlowController.tuned(FlowProcess(), CLOSED_S)
    measured_s = ON_BUS.measured_s if bus else CASES[0].measured_s
    return [
        f"process {process.time_constant_s:g} s; disturbance at its input {100 * process.disturbance:g} % of full "
        f"flow, every {process.disturbance_period_s:g} s",
        f"DCS: PI every {controller.period_s:g} s, gain {controller.gain:.3g}, integral time "
        f"{controller.integral_time_s:g} s; dead band of the positioners {100 * DEAD_BAND:g} %",
        f"{measured_s:g} s in steady state, {f'on {bus}' if bus else 'in virtual time'}; flows in % of full flow",
        f"{'':24}" + "".join(f"{each:>16}" for each in HEADINGS),
    ]


def _limits(outcome: FlowOutcome) -> list[str]:
    """Return what frames the others: the loop without friction, and without a controller."""
    named = {"no friction": outcome.frictionless, "stem left alone": outcome.alone}
    return [_row(name, outcome.figures_of(course)) for name, course in named.items()]


def _row(name: str, found: FlowFigures) -> str:
    shown = (
        _percent(found.deviation_std),
        _percent(found.peak_to_peak, 1),
        _percent(found.absolute_error_s, 0),
        _percent(found.added_std),
        f"{found.strokes_per_minute:.2f}",
        f"{found.reversals_per_minute:.1f}",
        f"{found.vented_per_minute:.2f}",
    )
    return f"{name:24}" + "".join(f"{each:>16}" for each in shown)


def _percent(share: float, digits: int = 2) -> str:
    return f"{100 * share:.{digits}f}"


def _picture(folder: Path, outcomes: list[FlowOutcome]) -> Path:
    from positioner.virtual.flow_picture import draw_flow

    path = folder / "flow_loop.png"
    titles = {
        f"{each.case.title}: std {_percent(each.figures.deviation_std)} %, "
        f"{each.figures.strokes_per_minute:.2f} strokes a minute": each.course
        for each in outcomes
    }
    setpoint = FlowController.tuned(FlowProcess(), CLOSED_S).setpoint
    draw_flow(path, titles, outcomes[0].frictionless, setpoint, outcomes[0].case.settle_s)
    return path


def _jsonable(outcomes: list[FlowOutcome], problems: list[str], seconds: float) -> dict[str, object]:
    cases = [{**asdict(each.case), **asdict(each.figures)} for each in outcomes]
    return {"cases": cases, "problems": problems, "seconds": seconds}


def _print_lines(lines: Iterable[str]) -> None:
    for line in lines:
        print(line, flush=True)
