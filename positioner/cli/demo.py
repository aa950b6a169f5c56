"""`positioner demo`: a sticking valve identified and controlled over a real bus, by two laws, in under a minute.

A simulated valve runs as a process on the bus that `--bus` names (`parts.simulated_plant`). Two daemons drive it, one
after the other, and this command plays the DCS over Modbus TCP:

    the paper's law   identification by a sine, steps up and down; the packing ages by 30 %; the steps again,
                      identification anew, the steps, and small steps, which this law cannot make
    slides            a new daemon with a cycle of 10 ms: identification by slides, two steps, the small steps

What a daemon identified is compared with the truth here, where it is known; no daemon ever has it.

`--loop flow`, in a clone alone, says what each law makes of a flow loop in virtual time (`benchmarks/flow`).
"""

import argparse
import math
import shlex
import shutil
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from config.codes import Fault, InhibitReason, Mode, Refusal
from config.errors import InputError
from config.registers import STATISTICS
from positioner.cli.parts.children import port_in
from positioner.cli.parts.clone_only import benchmark
from positioner.cli.parts.demo_folder import demo_folder, recording_in
from positioner.cli.parts.output_files import write_json
from positioner.cli.parts.passing_line import passing
from positioner.cli.parts.simulated_plant import (
    AGEING,
    AGES_AT_S,
    BUSES,
    RECORDER,
    THE_PAPERS_LAW,
    ageing,
    daemon_running,
    slave_running,
)

if TYPE_CHECKING:
    from config.valve_file import ValveParameters
    from positioner.dcs import Dcs

HELP = "show two control laws on a simulated sticking valve, over a real bus, in about a minute"
EXAMPLE = "positioner demo --out demo-out"

PSI = 6894.757  # Pa
ALPHA_PA, BETA_PA = 6.4 * PSI, 1.92 * PSI
"""The seed's excitation."""
AGED_ALPHA_PA = 11.5 * PSI
"""Enough for the aged packing to break away from where the stem is then."""
PAPER_STEPS = (0.65, 0.40, 0.80, 0.50, 0.40)
"""This valve's spring has no preload: without pressure it pulls the stem down only to F_c / k_s, 0.27 to 0.35 p.u."""
SLIDES_STEPS = (0.65, 0.40)  # p.u.; both ways by the law of slides
SMALL_STEPS = (0.41, 0.405, 0.43)
"""All below the 5.3 % of stroke from which on the paper's law moves this stem; after the last of `PAPER_STEPS`."""
BAR_CELLS = 20  # characters of the bar that shows the stem
PAPER_STEP_S = 0.5
SLIDES_STEP_S = 1.5
"""Slides leave small errors alone while references change within 1.2 s of each other."""
SLIDES_PERIOD_S = 10e-3
"""Of the second daemon's cycle: as gateways poll; slides do not hang on the period."""
SLIDES_REPLY_TIMEOUT_S = 0.2
SLIDES_TABLES = """[safety]
lost_after_cycles = 30
stale_after_s = 0.5
[recorder]
folder = "slides"
"""
"""Beside its law, which is the default: slides wait for a late reply, so a busy machine need be no fault."""
STAIRCASE_WITHIN_S = 60.0
BEGUN_S, SETTLED_S = 0.1, 0.2
"""Of a step: until it is seen what the law does; the last part, over which the mean is its error."""
IDENTIFICATIONS = 3
"""At most in a phase: a machine that is held up for a moment loses samples, and what they leave is refused."""
STEP_TRIES = 2
"""Of a step in which a fault was latched."""
ACKNOWLEDGEMENTS = 10
"""At most in a row, half a second apart: on a machine that is that busy replies are lost for seconds."""
MOST_MISSED = 0.02
"""Of the periods: a machine that misses more is busy with something else."""
NEW = "new"
"""The phase before the packing ages."""
SMALL = "small steps"
"""The phase of steps that the paper's law cannot make."""
SLIDES = "slides"
"""The phase under the law of slides."""
LARGEST_ERROR_PU = 0.01
"""By the paper."""
LARGEST_SLIDES_ERROR_PU = 0.001  # of a step by slides
BY_STEPS = ", the first move down: by steps, to where this law can move it no nearer"
LARGEST_RATIO_ERROR = 0.01  # of b/c and k/c
PAPER = "paper"
"""Beside `SLIDES`, the law of a daemon."""
SAMPLES_LOST = "lost_samples"
"""Said of the paper's law alone: a cycle of 10 ms passes over nine of ten samples by itself."""
COUNTS = {
    "missed periods": "missed_periods",
    "samples of the device that no cycle looked at": SAMPLES_LOST,
    "lost replies": "lost_replies",
    "not recorded": "unrecorded",
}
RATIOS = ("b_over_c", "k_over_c", "static_slope", "static_up", "static_down")
"""What a law needs."""
PROGRAM = "positioner"


@dataclass(frozen=True, slots=True)
class StepOutcome:
    """One step of the reference and where the stem came to rest."""

    phase: str
    reference_pu: float
    error_pu: float
    limit_pu: float | None
    """Of the error; None: the law is not held to it here."""
    by_steps: bool = False
    """Whether it went in a direction that no sine had seen."""


@dataclass(frozen=True, slots=True)
class ComparedEstimate:
    """One number of one identification, against the truth."""

    phase: str
    name: str
    value: float
    std: float
    true: float
    refusal: str

    @property
    def deviation(self) -> float | None:
        """Relative deviation from the truth; None without a value."""
        return self.value / self.true - 1 if math.isfinite(self.value) else None


@dataclass(frozen=True, slots=True)
class DemoOutcome:
    """What the demo saw."""

    steps: list[StepOutcome]
    identified: list[ComparedEstimate]
    cycles: dict[str, dict[str, float]]
    """Statistics of each daemon's cycle, by its law."""

    @property
    def problems(self) -> list[str]:
        """What does not hold; at last that the machine was too busy, where it was."""
        found = self._found
        return [*found, self._busy] if found and self._busy else found

    @property
    def _busy(self) -> str:
        made, missed, lost = (
            sum(each[name] for each in self.cycles.values()) for name in ("cycles", "missed_periods", "lost_replies")
        )
        share = missed / max(missed + made, 1.0)
        if not lost and share <= MOST_MISSED:
            return ""
        return (
            f"the machine is too busy for the demo: {100 * share:.0f} % of the periods were missed, {lost:.0f} replies "
            "lost; run it again when nothing else runs"
        )

    @property
    def _found(self) -> list[str]:
        return (
            [
                f"step to {step.reference_pu:g} p.u. ({step.phase}) ended {step.error_pu:+.4f} p.u. off"
                for step in self.steps
                if step.limit_pu is not None and not abs(step.error_pu) <= step.limit_pu
            ]
            + [
                f"{each.name} ({each.phase}): {_percent(each.deviation)} off the truth"
                for each in self.identified
                if each.name in RATIOS and (each.deviation is None or abs(each.deviation) > LARGEST_RATIO_ERROR)
            ]
            + [
                f"the packing aged before the step to {step.reference_pu:g} p.u. ({step.phase}) was over: the "
                "machine is too busy for the demo's times, run it again"
                for step in self.steps
                if step.phase == NEW and step.limit_pu is None
            ][:1]
        )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("--bus", choices=tuple(BUSES), default="modbus", help="the fieldbus")
    parser.add_argument(
        "--loop", choices=("flow",), help="simulate each law in a flow loop, faster than real time; needs a clone"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for picture, recordings, files and logs")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the result as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run it; exit status 1 when a step ends too far off, or a ratio is identified too badly."""
    if arguments.loop:
        if arguments.json:
            raise InputError("--json", "with --loop flow there is none")
        flow = benchmark("flow", "--loop flow")
        status: int = flow.compared(flow.CASES, arguments.out)
        return status
    return _run_steps(arguments)


def _run_steps(arguments: argparse.Namespace) -> int:
    from config.valve_file import load_valve, shipped_valve

    valve = load_valve(shipped_valve("seed")).valve
    with _folder(arguments.out) as folder:
        started_s = time.monotonic()
        outcome = _both_laws(arguments.bus, folder, valve)
        _report(outcome)
        picture = _picture(folder, outcome)
        if arguments.out:
            _print_line(f"picture {picture}, recordings {_recording(folder)}, {_recording(folder, SLIDES)}")
            print("in a browser:", *page_commands(_recording(folder)), sep="\n  ")
        if arguments.json:
            write_json(arguments.json, _jsonable(outcome, time.monotonic() - started_s), indent=1)
        print(_summary(outcome))
        for problem in outcome.problems:
            print(f"DOES NOT HOLD: {problem}")
        print(f"{'all holds' if not outcome.problems else 'failed'}, {time.monotonic() - started_s:.0f} s")
    return 1 if outcome.problems else 0


@contextmanager
def _folder(asked: Path | None) -> Iterator[Path]:
    """Give the folder to work in: the one asked for, or one that goes away."""
    import tempfile

    if asked is None:
        with tempfile.TemporaryDirectory() as name:
            yield Path(name)
        return
    with demo_folder(asked):
        yield asked


def _both_laws(bus: str, folder: Path, valve: "ValveParameters") -> DemoOutcome:
    """Run the valve, and on it a daemon for each law."""

    _print_line("starting a simulated valve and the daemon")
    with slave_running(bus, folder, "seed", ageing(valve)) as (setup, slave):
        powered_s = time.monotonic()
        with daemon_running(folder / "daemon.toml", setup, slave, RECORDER + THE_PAPERS_LAW) as daemon:
            _print_line(f"slave {slave}; daemon {daemon}; the paper's law")
            paper = _play_paper(port_in(daemon), valve, powered_s)
        slower = replace(setup, period_s=SLIDES_PERIOD_S, reply_timeout_s=SLIDES_REPLY_TIMEOUT_S)
        with daemon_running(folder / "slides.toml", slower, slave, SLIDES_TABLES) as daemon:
            _print_line(f"the same valve; another daemon {daemon}; slides, the default law")
            slides = _play_slides(port_in(daemon), _age_packing(valve))
    return DemoOutcome(
        paper.steps + slides.steps,
        paper.identified + slides.identified,
        {**paper.cycles, **slides.cycles},
    )


def _age_packing(valve: "ValveParameters") -> "ValveParameters":
    return valve.model_copy(update={"coulomb_n": AGEING * valve.coulomb_n, "static_n": AGEING * valve.static_n})


def _play_paper(port: int, valve: "ValveParameters", powered_s: float) -> DemoOutcome:
    """Be the DCS of the paper's law."""
    from positioner.dcs import Dcs

    with Dcs("127.0.0.1", port) as dcs:
        _begin(dcs)
        identified = identify(dcs, NEW, ALPHA_PA, valve)
        steps = _steps(
            dcs,
            NEW,
            PAPER_STEPS,
            limit_pu=LARGEST_ERROR_PU,
            by_steps_pu=by_steps_pu(valve),
            until_s=powered_s + AGES_AT_S,
        )
        observe(dcs, AGES_AT_S + 0.5 - (time.monotonic() - powered_s), "the packing ages by 30 %")
        steps += _steps(dcs, "aged", PAPER_STEPS, limit_pu=None)
        aged = _age_packing(valve)
        identified += identify(dcs, "aged", AGED_ALPHA_PA, aged)
        steps += _steps(dcs, "identified anew", PAPER_STEPS, limit_pu=LARGEST_ERROR_PU, by_steps_pu=by_steps_pu(aged))
        steps += _steps(dcs, SMALL, SMALL_STEPS, limit_pu=None)
        return DemoOutcome(steps, identified, {PAPER: _statistics(dcs)})


def by_steps_pu(valve: "ValveParameters") -> float:
    """Return how far off a first landing in a direction may be left, p.u.

    The stem slides by its own jump (F_s - F_c)/k_s and by the step that broke it loose, which is the least near the
    reference (`positioner.control.unseen_direction`); what is left then is less than the paper's law can move.
    """
    from positioner.control.unseen_direction import LEAST_STEP

    return (valve.static_n - valve.coulomb_n) / (valve.spring_n_per_m * valve.stroke_m) + LEAST_STEP


def _play_slides(port: int, valve: "ValveParameters") -> DemoOutcome:
    """Be the DCS of the law of slides."""
    from positioner.dcs import Dcs
    from positioner.virtual.true_parameters import truth

    true = truth(valve)
    true = {"static_slope": -true["b_over_c"], "static_up": -true["k_over_c"], "static_down": -true["k_over_c"]}
    with Dcs("127.0.0.1", port) as dcs:
        _begin(dcs)
        identified = _identify(dcs, SLIDES, {}, STAIRCASE_WITHIN_S, true)
        steps = _steps(
            dcs, SLIDES, (*SLIDES_STEPS, *SMALL_STEPS), limit_pu=LARGEST_SLIDES_ERROR_PU, step_s=SLIDES_STEP_S
        )
        return DemoOutcome(steps, identified, {SLIDES: _statistics(dcs)})


def _begin(dcs: "Dcs") -> None:
    """Look on while nothing moves; then choose automatic."""
    observe(dcs, 0.5, "S0, nothing moves")
    acknowledge_faults(dcs)
    dcs.set("mode", Mode.AUTOMATIC)


def _statistics(dcs: "Dcs") -> dict[str, float]:

    return dcs.get_all(*(register.name for register in STATISTICS))


def acknowledge_faults(dcs: "Dcs") -> bool:
    """Acknowledge, as an operator would, what a busy machine has latched, and say it; return whether anything was."""

    for number in range(ACKNOWLEDGEMENTS):
        if not (fault := int(dcs.get("fault"))):
            return number > 0
        _print_line(f"acknowledged: {Fault(fault).text}")
        dcs.set("acknowledge", 1)
        observe(dcs, 0.5, "S0, nothing moves")
    return True


def _resume_automatic(dcs: "Dcs") -> None:
    """Choose automatic again after a fault, from where the stem is; where it comes back meanwhile, it stays so."""
    from positioner.dcs import DcsError

    position_pu = dcs.get("position") if acknowledge_faults(dcs) else math.nan
    if math.isfinite(position_pu):
        with suppress(DcsError):
            dcs.set("reference", min(max(position_pu, 0.0), 1.0))
            dcs.set("mode", Mode.AUTOMATIC)


def identify(dcs: "Dcs", phase: str, alpha_pa: float, valve: "ValveParameters") -> list[ComparedEstimate]:
    """Have the valve identified by a sine, anew where that is refused; return what was found against the truth."""
    from positioner.virtual.true_parameters import truth

    return _identify(dcs, phase, {"alpha": alpha_pa, "beta": BETA_PA, "omega": 1.0}, 5.0, truth(valve))


def _identify(
    dcs: "Dcs", phase: str, excitation: dict[str, float], within_s: float, true: dict[str, float]
) -> list[ComparedEstimate]:
    def show(progress: float) -> None:
        _show_passing(f"identifying ({phase}): {100 * progress:3.0f} %")

    for _ in range(IDENTIFICATIONS):
        _resume_automatic(dcs)
        problem = dcs.identify(excitation, within_s, show)
        _print_line(f"identified ({phase})" if problem is None else f"identification ({phase}) failed: {problem}")
        if problem is None:
            break
    return [_compare_estimate(dcs, phase, name, value) for name, value in true.items()]


def _compare_estimate(dcs: "Dcs", phase: str, name: str, true: float) -> ComparedEstimate:

    now = dcs.get_all(f"{name}_e", f"{name}_std", f"{name}_reason")
    reason = Refusal(int(now[f"{name}_reason"]))
    refusal = "" if reason is Refusal.VALID else reason.text
    return ComparedEstimate(phase, name, now[f"{name}_e"], now[f"{name}_std"], true, refusal)


def _steps(
    dcs: "Dcs",
    phase: str,
    references_pu: Sequence[float],
    *,
    limit_pu: float | None,
    by_steps_pu: float | None = None,
    until_s: float = math.inf,
    step_s: float = PAPER_STEP_S,
) -> list[StepOutcome]:
    """Make the steps; what is over after the packing has aged does not count for the packing that was identified."""
    steps = []
    for reference_pu in references_pu:
        for _ in range(STEP_TRIES):
            _resume_automatic(dcs)
            settled_pu, by_steps = _step(dcs, phase, reference_pu, step_s)
            if not dcs.get("fault"):
                break
        limit_now_pu = (by_steps_pu if by_steps else limit_pu) if time.monotonic() < until_s else None
        steps.append(StepOutcome(phase, reference_pu, settled_pu - reference_pu, limit_now_pu, by_steps))
    _print_line(f"{phase}: {len(steps)} steps, worst {max(abs(step.error_pu) for step in steps):.4f} p.u.")
    return steps


def _step(dcs: "Dcs", phase: str, reference_pu: float, step_s: float) -> tuple[float, bool]:
    """Make a step of the reference; return where the stem settles, p.u., and whether it went there by steps."""

    dcs.set("reference", reference_pu)
    label = f"{phase}: step to {reference_pu:g} p.u."
    observe(dcs, BEGUN_S, label)
    by_steps = False
    while int(dcs.get("why")) == InhibitReason.ONE_DIRECTION:  # the sine has seen the stem move upward alone
        by_steps = True
        observe(dcs, BEGUN_S, label)
    observe(dcs, step_s - SETTLED_S - BEGUN_S, label)
    return observe(dcs, SETTLED_S, label), by_steps


def observe(dcs: "Dcs", duration_s: float, label: str) -> float:
    """Look on for a while; return the mean position, p.u."""
    end_s = time.monotonic() + duration_s
    positions = []
    while True:
        now = dcs.get_all("state", "position", "reference_in_force", "command")
        positions.append(now["position"])
        _show_passing(format_step(label, now))
        if time.monotonic() >= end_s:
            return sum(positions) / len(positions)
        time.sleep(0.02)


def format_step(label: str, now: dict[str, float]) -> str:
    """Return what a terminal of 80 columns has room for."""
    return f"{label:34} {_bar(now)} S{now['state']:.0f} {now['command'] / 1e3:5.1f} kPa"


def _bar(now: dict[str, float]) -> str:
    """Draw stem (#) and reference (|) over the travel; a stem that nobody measures is none."""
    position, reference = now["position"], now["reference_in_force"]
    stem = round(min(max(position, 0.0), 1.0) * BAR_CELLS) if math.isfinite(position) else 0
    cells = ["#"] * stem + ["."] * (BAR_CELLS - stem)
    if math.isfinite(reference):
        cells[min(round(reference * BAR_CELLS), BAR_CELLS - 1)] = "|"
    return f"[{''.join(cells)}] {position:z.3f}"


def _show_passing(text: str) -> None:
    """Show a passing line on a terminal."""
    if sys.stdout.isatty():
        print(passing(text, sys.stdout), end="", flush=True)


def _print_line(text: str) -> None:
    """Print a line that stays."""
    _show_passing("")
    print(text, flush=True)


def _percent(share: float | None) -> str:
    return "none" if share is None else f"{100 * share:+.2f} %"


def _report(outcome: DemoOutcome) -> None:
    print(f"\n{'':17}{'':10}{'identified':>13}{'std':>11}{'true':>13}{'deviation':>12}")
    for each in outcome.identified:
        print(
            f"{each.phase:17}{each.name:10}{each.value:13.6g}{each.std:11.2g}{each.true:13.6g}"
            f"{_percent(each.deviation):>12}{'  refused' if each.refusal else ''}"
        )
    for refusal in dict.fromkeys(each.refusal for each in outcome.identified if each.refusal):
        names = [each.name for each in outcome.identified if each.refusal == refusal]
        print(f"  refused ({', '.join(dict.fromkeys(names))}): {refusal}")
    print(f"\n{'':17}{'reference':>10}{'final error, p.u.':>20}")
    for step in outcome.steps:
        limit = "(no limit)" if step.limit_pu is None else f"(limit {step.limit_pu:.3g})"
        limit += BY_STEPS * step.by_steps
        print(f"{step.phase:17}{step.reference_pu:10.3f}{step.error_pu:+20.5f}  {limit}")
    print()
    for law, cycle in outcome.cycles.items():
        counted = {said: name for said, name in COUNTS.items() if law == PAPER or name != SAMPLES_LOST}
        counts = ", ".join(f"{said} {cycle[name]:.0f}" for said, name in counted.items())
        print(
            f"{law}: {cycle['cycles']:.0f} cycles, median period {1e3 * cycle['period']:.3f} ms, 99 % within "
            f"{1e6 * cycle['jitter_99']:.0f} us of it, {1e6 * cycle['cycle_time']:.0f} us each; {counts}"
        )


def _summary(outcome: DemoOutcome) -> str:
    """Return what the two laws leave of the same small steps."""
    small = [step.error_pu for step in outcome.steps if step.phase == SMALL]
    slides = [step.error_pu for step in outcome.steps if step.phase == SLIDES][-len(SMALL_STEPS) :]
    return (
        f"small steps of {_sizes()} % of stroke, worst error: "
        f"the paper's law {100 * _worst(small):.2f} %, slides {100 * _worst(slides):.3f} %"
    )


def _sizes() -> str:
    changes = [abs(now - then) for then, now in pairwise((PAPER_STEPS[-1], *SMALL_STEPS))]
    return ", ".join(f"{100 * change:.1f}" for change in changes)


def _worst(errors_pu: Sequence[float]) -> float:
    return max(map(abs, errors_pu))


def _jsonable(outcome: DemoOutcome, seconds: float) -> dict[str, object]:
    return {
        "steps": outcome.steps,
        "identified": [{**asdict(each), "deviation": each.deviation} for each in outcome.identified],
        "cycles": outcome.cycles,
        "problems": outcome.problems,
        "seconds": seconds,
    }


def page_commands(recording: Path) -> Iterator[str]:
    """Yield what to type to see the recording, and a running valve, from the folder where this was typed."""
    from config.loading import SHIPPED

    profiles, here = SHIPPED / "profiles", Path.cwd()
    near = profiles.relative_to(here) if profiles.is_relative_to(here) else profiles
    slave, daemon = str(near / "slave.toml"), str(near / "daemon.toml")
    called = _as_called()
    yield shlex.join([called, "workbench", str(recording), "--valve", "seed"])
    yield f"{shlex.join([called, 'sim', slave])} & {shlex.join([called, 'run', daemon])} &"
    yield shlex.join([called, "page", "--config", daemon])


def _as_called() -> str:
    """Return how this program was called where its name alone would not be found: in a fresh clone by its path."""
    called = Path(sys.argv[0])
    return str(called) if called.name == PROGRAM and shutil.which(PROGRAM) is None else PROGRAM


def _recording(folder: Path, of: str = "recordings") -> Path:
    return recording_in(folder / of)


def _picture(folder: Path, outcome: DemoOutcome) -> Path:
    from config.recording import read_recording
    from config.valve_file import load_valve, shipped_valve
    from positioner.virtual.run_picture import draw_runs

    path = folder / "run.png"
    worst = {
        phase: f"{phase} {_worst([step.error_pu for step in outcome.steps if step.phase == phase]):.4f}"
        for phase in dict.fromkeys(step.phase for step in outcome.steps)
    }
    slides = worst.pop(SLIDES)
    runs = {
        f"the paper's law; worst error, p.u. of stroke:\n{', '.join(worst.values())}": read_recording(
            _recording(folder)
        ),
        f"slides, the default law; worst error:\n{slides}": read_recording(_recording(folder, SLIDES)),
    }
    draw_runs(path, runs, load_valve(shipped_valve("seed")).valve.stroke_m)
    return path
