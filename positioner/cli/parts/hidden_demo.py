"""`demo --hidden`: what the workbench finds in the daemon's own recording, put to work on the stem.

The simulated valve is the seed's with an effect that only its own file names. The daemon, which knows the stroke,
identifies it by slides and makes some steps by the seed's law (that of slides finds such an effect by where its slides
land, and needs no file); its recording is diagnosed, starting from the seed's valve file, with a few effects to choose
among; the valve file is extended by what was found; a daemon with `[law] valve` makes the same steps, identifying
nothing. Slave and daemons are processes on the bus that `--bus` names, in lockstep: a busy machine changes nothing. The
sensor has no effect of its own, so that the mean of what is indicated is where the stem is.
"""

import time
from dataclasses import dataclass
from math import sqrt
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING

from config.codes import Fault
from config.errors import CommandFailed
from positioner.cli.parts.children import port_in
from positioner.cli.parts.demo_folder import recording_in
from positioner.cli.parts.output_files import write_json
from positioner.cli.parts.simulated_plant import STROKE_M, BusSetup, daemon_running, slave_running

if TYPE_CHECKING:
    from config.valve_file import ValveFile
    from positioner.dcs import Dcs

HIDDEN = {"name": "position_friction", "growth": 0.6, "travel_m": STROKE_M}
CANDIDATES = ("position_friction", "spring_hardening", "asymmetric_friction", "preload")
STEPS = (0.65, 0.50, 0.72, 0.45, 0.60, 0.35, 0.55, 0.40, 0.68, 0.52)  # p.u.; the whole travel, both ways
HIDDEN_PERIOD_S = 5e-3
HIDDEN_STEP_S, HIDDEN_SETTLED_S = 0.8, 0.1
"""Time for each; its error is the mean over the last part of it."""
IDENTIFIED_WITHIN_S = 120.0
HIDDEN_POLL_S = 0.01
BETTER_BY = 3.0  # times smaller error with the effect than without
LARGEST_AFTER = 1e-3
"""Of the stroke, rms: what must be left at the most once the effect is known."""
DAEMON = """[control]
law = "seed"
[excitation]
kind = "staircase"
[recorder]
folder = "{recordings}"
"""


@dataclass(frozen=True, slots=True)
class HiddenOutcome:
    """What the act saw: errors at the ends of the steps, of the stroke, and what was found."""

    before: list[float]
    after: list[float]
    found: tuple[str, ...]

    @property
    def problems(self) -> list[str]:
        """What does not hold."""
        before, after = rms(self.before), rms(self.after)
        said = []
        if not after <= before / BETTER_BY:
            said.append(f"the error fell from {100 * before:.3f} to {100 * after:.3f} % of stroke only")
        if not after <= LARGEST_AFTER:
            said.append(f"with the effect known {100 * after:.3f} % of stroke is left")
        if self.found != (HIDDEN["name"],):
            said.append(f"found {', '.join(self.found) or 'nothing'}, hidden was {HIDDEN['name']}")
        return said


def rms(errors: list[float]) -> float:
    """Return a root mean square."""
    return sqrt(fmean(each * each for each in errors))


def run_hidden(bus: str, folder: Path, told: Path | None) -> int:
    """Run the act; exit status 1 when the effect is not found or the error does not fall."""
    from config.valve_file import ValveFile, valve
    from config.valve_file_writer import write_valve

    started_s = time.monotonic()
    bare = valve("seed")
    write_valve(
        folder / "hidden.toml", ValveFile.model_validate({"valve": bare.valve.model_dump(), "effect": [HIDDEN]})
    )
    with slave_running(bus, folder, "hidden.toml", lockstep_s=HIDDEN_PERIOD_S) as (setup, slave):
        print(f"slave {slave}: the seed's valve, and an effect that the daemon is not told")
        before = _steps("before", folder, setup, slave)
        found = _extend_valve(recording_in(folder / "before"), bare, folder / "better.toml")
        after = _steps("after", folder, setup, slave, '[law]\nvalve = "better.toml"\n') if found else before
    outcome = HiddenOutcome(before, after, found)
    seconds = time.monotonic() - started_s
    _report(outcome)
    if told is not None:
        told_of = {"before": before, "after": after, "found": found, "problems": outcome.problems, "seconds": seconds}
        write_json(told, told_of, indent=1)
    for problem in outcome.problems:
        print(f"DOES NOT HOLD: {problem}")
    print(f"{'all holds' if not outcome.problems else 'failed'}, {seconds:.0f} s")
    return 1 if outcome.problems else 0


def _steps(recordings: str, folder: Path, setup: BusSetup, slave: str, law: str = "") -> list[float]:
    """Let a daemon make the steps; return their errors, of the stroke. Where it has no law yet it identifies first."""
    from positioner.dcs import Dcs

    tables = DAEMON.format(recordings=recordings) + law
    with (
        daemon_running(folder / f"{recordings}.toml", setup, slave, tables, lockstep=True) as daemon,
        Dcs("127.0.0.1", port_in(daemon)) as dcs,
    ):
        dcs.set("mode", 2)
        if not law:
            problem = dcs.identify({}, IDENTIFIED_WITHIN_S)
            if problem is not None:
                raise CommandFailed(f"identification: {problem}")
            slope, up, down = (dcs.get(f"static_{name}_e") for name in ("slope", "up", "down"))
            print(
                f"identified: {slope / 1e3:.1f} kPa/m, {up / 1e3:.2f} kPa up, {down / 1e3:.2f} kPa down, a straight law"
            )
        errors = []
        for reference in STEPS:
            dcs.set("reference", reference)
            _wait(dcs, HIDDEN_STEP_S - HIDDEN_SETTLED_S)
            errors.append(fmean(_wait(dcs, HIDDEN_SETTLED_S)) - reference)
        if fault := int(dcs.get("fault")):
            raise CommandFailed(f"the daemon has a fault: {Fault(fault).text}; see {recordings}.log")
    print(f"{len(STEPS)} steps, {recordings}: {100 * rms(errors):.3f} % of stroke rms")
    return errors


def _wait(dcs: "Dcs", duration_s: float) -> list[float]:
    """Let time of the device pass; return positions seen meanwhile, of the stroke."""
    end = dcs.get("cycles") + duration_s / HIDDEN_PERIOD_S
    positions: list[float] = []
    while not positions or dcs.get("cycles") < end:
        positions.append(dcs.get("position"))
        time.sleep(HIDDEN_POLL_S)
    return positions


def _extend_valve(recording: Path, bare: "ValveFile", better: Path) -> tuple[str, ...]:
    """Diagnose a recording and write the valve file with what it lacked; return that, by name."""
    from config.recording import read_recording
    from config.valve_file_writer import write_valve
    from workbench.diagnosis.diagnosis import diagnose

    began_s = time.monotonic()
    diagnosis = diagnose(read_recording(recording), bare, effects=CANDIDATES)
    found = tuple(each.name for each in diagnosis.best.fit.valve.effect)
    print(f"diagnosed {recording.name} in {time.monotonic() - began_s:.0f} s: {diagnosis.verdict_line}")
    for table in diagnosis.best.fit.valve.effect:
        print(f"  {table.name}: " + ", ".join(f"{name} = {value:.4g}" for name, value in table.parameters.items()))
    write_valve(better, diagnosis.best.fit.valve, [])
    return found


def _report(outcome: HiddenOutcome) -> None:
    print(f"\n{'reference':>10}{'before, % of stroke':>22}{'extended':>12}")
    for reference, before, after in zip(STEPS, outcome.before, outcome.after, strict=True):
        print(f"{reference:10.3f}{100 * before:+22.3f}{100 * after:+12.3f}")
    print(f"{'rms':>10}{100 * rms(outcome.before):22.3f}{100 * rms(outcome.after):12.3f}\n")
