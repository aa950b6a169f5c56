"""Does the positioner stop the oscillation of a flow loop? Three positioners at two periods, in virtual time.

python -m benchmarks.flow [--out DIR] [--tunings | --rivals]
"""

import argparse
import sys
import time
from collections.abc import Iterable
from pathlib import Path

from benchmarks.flow.cases import CLOSED_S, DEAD_BAND, PERIODS_S, POSITIONERS, FlowCase, FlowOutcome, virtual_outcome
from benchmarks.flow.course import FlowFigures
from benchmarks.flow.loop import FlowController, FlowProcess
from benchmarks.flow.picture import draw_flow
from benchmarks.flow.tunings import rivals, tunings

OURS = "slides"
CASES = tuple(FlowCase(law, period_s) for period_s in PERIODS_S for law in POSITIONERS)
HEADINGS = (
    "std, %",
    "peak to peak, %",
    "abs error, % s",
    "valve adds, %",
    "strokes/min",
    "reversals/min",
    "vented/min",
)


def main() -> int:
    """Print the table; exit status 1 when ours leaves no less of the oscillation than another."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, metavar="DIR", help="draw the courses there")
    parser.add_argument("--tunings", action="store_true", help="other tunings of ours and of the conventional one")
    parser.add_argument("--rivals", action="store_true", help="published compensators, each at its best")
    parser.add_argument("--period-ms", type=float, default=1e3 * PERIODS_S[0], help="of the cycle, with --rivals")
    arguments = parser.parse_args()
    if arguments.tunings or arguments.rivals:
        _print_lines(rivals(1e-3 * arguments.period_ms) if arguments.rivals else tunings())
        return 0
    return compared(CASES, arguments.out)


def compared(cases: Iterable[FlowCase], out: Path | None) -> int:
    """Print the table of some cases and draw them in a folder, if any; return the exit status."""
    started_s = time.monotonic()
    _print_lines(_head())
    outcomes = []
    for case in cases:
        outcomes.append(virtual_outcome(case))
        _print_lines([_row(case.title, outcomes[-1].figures)])
    _print_lines(_limits(outcomes[-1]))
    if out:
        out.mkdir(parents=True, exist_ok=True)
        print(f"picture {_picture(out, outcomes)}")
    problems = problems_of({each.case: each.figures for each in outcomes})
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


def _head() -> list[str]:
    process, controller = FlowProcess(), FlowController.tuned(FlowProcess(), CLOSED_S)
    return [
        f"process {process.time_constant_s:g} s; disturbance at its input {100 * process.disturbance:g} % of full "
        f"flow, every {process.disturbance_period_s:g} s",
        f"DCS: PI every {controller.period_s:g} s, gain {controller.gain:.3g}, integral time "
        f"{controller.integral_time_s:g} s; dead band of the positioners {100 * DEAD_BAND:g} %",
        f"{CASES[0].measured_s:g} s in steady state, in virtual time; flows in % of full flow",
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
    path = folder / "flow_loop.png"
    titles = {
        f"{each.case.title}: std {_percent(each.figures.deviation_std)} %, "
        f"{each.figures.strokes_per_minute:.2f} strokes a minute": each.course
        for each in outcomes
    }
    setpoint = FlowController.tuned(FlowProcess(), CLOSED_S).setpoint
    draw_flow(path, titles, outcomes[0].frictionless, setpoint, outcomes[0].case.settle_s)
    return path


def _print_lines(lines: Iterable[str]) -> None:
    for line in lines:
        print(line, flush=True)


if __name__ == "__main__":
    sys.exit(main())
