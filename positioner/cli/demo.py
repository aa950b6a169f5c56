"""`positioner demo`: a sticking valve identified and controlled over a real bus, in under a minute.

A simulated slave and the daemon run as processes of their own, on the bus that `--bus` names
(`parts.simulated_plant`); this command plays the DCS over Modbus TCP: start, identification, steps up and down, ageing
of the packing by 30 %, the same steps once more, identification anew, and the steps again. What the daemon identified
is compared with the truth here, where it is known; the daemon never has it.

`--hidden` gives the valve an effect that nobody has told the daemon, finds it in the daemon's own recording, gives the
daemon the extended valve and makes the same steps again (`parts.hidden_demo`).

`--loop flow` is another one: what the laws make of a flow loop, in virtual time (`parts.flow_demo`).
"""

import argparse
import math
import shlex
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from positioner.cli.parts.demo_folder import demo_folder, recording_in
from positioner.cli.parts.output_files import writable, write_json
from positioner.cli.parts.passing_line import passing
from positioner.cli.parts.simulated_plant import AGEING, AGES_AT_S, BUSES, started

if TYPE_CHECKING:
    from config.valve_file import ValveParameters
    from positioner.dcs import Dcs

HELP = "identify and control a simulated sticking valve over a real bus, in under a minute; or its flow loop"
EXAMPLE = "positioner demo --out demo-out"

PSI = 6894.757
ALPHA_PA, BETA_PA = 6.4 * PSI, 1.92 * PSI
"""The seed's excitation."""
AGED_ALPHA_PA = 11.5 * PSI
"""Enough for the aged packing to break away from where the stem is then."""
STEPS = (0.65, 0.40, 0.80, 0.50, 0.40)
"""This valve's spring has no preload: without pressure it pulls the stem down only to F_c / k_s, 0.27 to 0.35 p.u."""
STEP_S = 0.5
SETTLED_S = 0.2
"""The error of a step is the mean over this last part of it."""
IDENTIFICATIONS = 3
"""At most in a phase: a machine that is held up for a moment loses samples, and what they leave is refused."""
ACKNOWLEDGEMENTS = 10
"""At most at the start, half a second apart: on a machine that is that busy replies are lost for seconds."""
NEW = "new"
"""The phase before the packing ages."""
LARGEST_ERROR_PU = 0.01
LARGEST_RATIO_ERROR = 0.01
RATIOS = ("b_over_c", "k_over_c")
PROGRAM = "positioner"


@dataclass(frozen=True, slots=True)
class StepOutcome:
    """One step of the reference and where the stem came to rest."""

    phase: str
    reference_pu: float
    error_pu: float
    counted: bool


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
    cycle: dict[str, float]

    @property
    def problems(self) -> list[str]:
        """What does not hold."""
        return (
            [
                f"step to {step.reference_pu:g} p.u. ({step.phase}) ended {step.error_pu:+.4f} p.u. off"
                for step in self.steps
                if step.counted and not abs(step.error_pu) <= LARGEST_ERROR_PU
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
                if step.phase == NEW and not step.counted
            ][:1]
        )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("--bus", choices=tuple(BUSES), help="the fieldbus (modbus; of a loop: none, in virtual time)")
    parser.add_argument("--loop", choices=("flow",), help="in place of steps: does the positioner calm a flow loop?")
    parser.add_argument(
        "--hidden",
        action="store_true",
        help="in place of ageing: a valve with an effect that the daemon finds in its own recording and then knows",
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="keep picture, recording, configs and logs there")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the outcome there")


def run(arguments: argparse.Namespace) -> int:
    """Run it; exit status 1 when a step ends too far off, or a ratio is identified too badly."""
    writable(arguments.json, "--json")
    if arguments.loop:
        from positioner.cli.parts.flow_demo import run_flow

        return run_flow(arguments)
    if arguments.hidden:
        from positioner.cli.parts.hidden_demo import run_hidden

        with _folder(arguments.out) as folder:
            return run_hidden(arguments.bus or "modbus", folder.resolve(), arguments.json)
    return _run_steps(arguments)


def _run_steps(arguments: argparse.Namespace) -> int:

    from config.valve_file import load_valve, shipped_valve
    from positioner.cli.parts.children import port_in

    valve = load_valve(shipped_valve("seed")).valve
    with _folder(arguments.out) as folder:
        started_s = time.monotonic()
        _print_line("starting a simulated valve and the daemon")
        with started(arguments.bus or "modbus", folder, valve) as pair:
            _print_line(f"slave {pair.slave}; daemon {pair.daemon}")
            outcome = _play(port_in(pair.daemon), valve, pair.powered_s)
        _report(outcome)
        picture = _picture(folder, outcome)
        if arguments.out:
            _print_line(f"picture {picture}, recording {_recording(folder)}")
            print("in a browser:", *_in_a_browser(_recording(folder)), sep="\n  ")
        if arguments.json:
            write_json(arguments.json, _jsonable(outcome, time.monotonic() - started_s), indent=1)
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


def _play(port: int, valve: "ValveParameters", powered_s: float) -> DemoOutcome:
    """Be the DCS."""
    from config.registers import STATISTICS
    from positioner.dcs import Dcs

    aged = valve.model_copy(update={"coulomb_n": AGEING * valve.coulomb_n, "static_n": AGEING * valve.static_n})
    with Dcs("127.0.0.1", port) as dcs:
        _observe(dcs, 0.5, "S0, nothing moves")
        _acknowledge(dcs)
        dcs.set("mode", 2)
        identified = identify(dcs, NEW, ALPHA_PA, valve)
        steps = _steps(dcs, NEW, counted_until_s=powered_s + AGES_AT_S)
        _observe(dcs, AGES_AT_S + 0.5 - (time.monotonic() - powered_s), "the packing ages by 30 %")
        steps += _steps(dcs, "aged", counted_until_s=-math.inf)
        identified += identify(dcs, "aged", AGED_ALPHA_PA, aged)
        steps += _steps(dcs, "identified anew")
        cycle = dcs.get_all(*(register.name for register in STATISTICS))
    return DemoOutcome(steps, identified, cycle)


def _acknowledge(dcs: "Dcs") -> None:
    """Acknowledge, as an operator would, what was latched while the processes began on a busy machine; say it."""
    from config.codes import Fault

    for _ in range(ACKNOWLEDGEMENTS):
        if not (fault := int(dcs.get("fault"))):
            return
        _print_line(f"acknowledged: {Fault(fault).text}")
        dcs.set("acknowledge", 1)
        _observe(dcs, 0.5, "S0, nothing moves")


def identify(dcs: "Dcs", phase: str, alpha_pa: float, valve: "ValveParameters") -> list[ComparedEstimate]:
    """Have the valve identified, anew where that is refused; return what was identified against the truth."""
    from positioner.virtual.true_parameters import truth

    def show(progress: float) -> None:
        _show_passing(f"identifying ({phase}): {100 * progress:3.0f} %")

    for _ in range(IDENTIFICATIONS):
        problem = dcs.identify({"alpha": alpha_pa, "beta": BETA_PA, "omega": 1.0}, 5.0, show)
        _print_line(f"identified ({phase})" if problem is None else f"identification ({phase}) failed: {problem}")
        if problem is None:
            break
    return [_compared(dcs, phase, name, true) for name, true in truth(valve).items()]


def _compared(dcs: "Dcs", phase: str, name: str, true: float) -> ComparedEstimate:
    from config.codes import Refusal

    now = dcs.get_all(f"{name}_e", f"{name}_std", f"{name}_reason")
    reason = Refusal(int(now[f"{name}_reason"]))
    refusal = "" if reason is Refusal.VALID else reason.text
    return ComparedEstimate(phase, name, now[f"{name}_e"], now[f"{name}_std"], true, refusal)


def _steps(dcs: "Dcs", phase: str, counted_until_s: float = math.inf) -> list[StepOutcome]:
    """Make the steps; what is over after the packing has aged does not count for the packing that was identified."""
    steps = []
    for reference_pu in STEPS:
        dcs.set("reference", reference_pu)
        label = f"{phase}: step to {reference_pu:g} p.u."
        _observe(dcs, STEP_S - SETTLED_S, label)
        settled_pu = _observe(dcs, SETTLED_S, label)
        counted = time.monotonic() < counted_until_s
        steps.append(StepOutcome(phase, reference_pu, settled_pu - reference_pu, counted))
    _print_line(f"{phase}: {len(steps)} steps, worst {max(abs(step.error_pu) for step in steps):.4f} p.u.")
    return steps


def _observe(dcs: "Dcs", duration_s: float, label: str) -> float:
    """Look on for a while; return the mean position, p.u."""
    end_s = time.monotonic() + duration_s
    positions = []
    while True:
        now = dcs.get_all("state", "position", "reference_in_force", "command")
        positions.append(now["position"])
        _show_passing(shown_step(label, now))
        if time.monotonic() >= end_s:
            return sum(positions) / len(positions)
        time.sleep(0.02)


def shown_step(label: str, now: dict[str, float]) -> str:
    """Return what a terminal of 80 columns has room for."""
    return f"{label:34} {_bar(now)} S{now['state']:.0f} {now['command'] / 1e3:5.1f} kPa"


def _bar(now: dict[str, float], width: int = 20) -> str:
    """Draw stem (#) and reference (|) over the travel."""
    stem = round(min(max(now["position"], 0.0), 1.0) * width)
    cells = ["#"] * stem + ["."] * (width - stem)
    cells[min(round(now["reference_in_force"] * width), width - 1)] = "|"
    return f"[{''.join(cells)}] {now['position']:z.3f}"


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
        limit = f"  (limit {LARGEST_ERROR_PU:g})" if step.counted else "  (not counted: the packing has aged)"
        print(f"{step.phase:17}{step.reference_pu:10.2f}{step.error_pu:+20.5f}{limit}")
    cycle = outcome.cycle
    print(
        f"\ncycle: {cycle['cycles']:.0f} run, median period {1e3 * cycle['period']:.3f} ms, "
        f"99 % within {1e6 * cycle['jitter_99']:.0f} us of it, {1e6 * cycle['cycle_time']:.0f} us each"
    )
    counts = {
        "missed periods": "missed_periods",
        "samples of the device that no cycle looked at": "lost_samples",
        "lost replies": "lost_replies",
        "not recorded": "unrecorded",
    }
    print(", ".join(f"{said} {cycle[name]:.0f}" for said, name in counts.items()))


def _jsonable(outcome: DemoOutcome, seconds: float) -> dict[str, object]:
    return {
        "steps": outcome.steps,
        "identified": [{**asdict(each), "deviation": each.deviation} for each in outcome.identified],
        "cycle": outcome.cycle,
        "problems": outcome.problems,
        "seconds": seconds,
    }


def _in_a_browser(recording: Path) -> Iterator[str]:
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


def _recording(folder: Path) -> Path:
    return recording_in(folder / "recordings")


def _picture(folder: Path, outcome: DemoOutcome) -> Path:
    from config.recording import read_recording
    from config.valve_file import load_valve, shipped_valve
    from positioner.virtual.run_picture import draw_run

    path = folder / "run.png"
    stroke_m = load_valve(shipped_valve("seed")).valve.stroke_m
    errors = ", ".join(
        f"{phase} {max(abs(step.error_pu) for step in outcome.steps if step.phase == phase):.4f}"
        for phase in dict.fromkeys(step.phase for step in outcome.steps)
    )
    draw_run(path, read_recording(_recording(folder)), stroke_m, f"worst final error, p.u. of stroke: {errors}")
    return path
