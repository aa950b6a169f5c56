"""`positioner play`: the closed loop in virtual time, as fast as it computes."""

import argparse
from dataclasses import dataclass, replace
from itertools import islice, pairwise
from math import nan, sqrt
from pathlib import Path
from typing import TYPE_CHECKING

from config.codes import Mode
from config.errors import CommandFailed, InputError
from config.file_kinds import VALVE_SAID
from config.law_names import DEFAULT_LAW, law_names
from positioner.cli.parts.extended_valves import load_extended_valve
from positioner.cli.parts.model_arguments import read_valve
from positioner.cli.parts.output_files import recording_writable
from positioner.cli.parts.progress import at_work
from positioner.control.requests import QUIET, Requests

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile
    from config.extended_valve import ExtendedValve
    from config.recording import Column, Recording
    from config.slave_file import SlaveFile
    from config.valve_file import ValveParameters
    from positioner.daemon.snapshot import Snapshot
    from positioner.virtual.virtual_cycle import Script

HELP = "simulate valve and controller, faster than real time: identify, then follow a reference"
EXAMPLE = "positioner play seed --reference reference.csv --noise-m 1e-5 -o run.csv"

IDENTIFY_S = 1.5
"""Time given to the identification by a sine before the reference begins; one by slides takes what it takes."""
ROUNDING_S = 1e-9
"""What a sum of periods may fall short of a time by rounding."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("valve", metavar="VALVE.toml", help=VALVE_SAID)
    parser.add_argument(
        "--reference", type=Path, required=True, metavar="REF.csv", help="columns time_s and reference_m"
    )
    parser.add_argument("--law", choices=law_names(), default=DEFAULT_LAW, help="the control law")
    parser.add_argument(
        "--extended",
        type=Path,
        metavar="VALVE.toml",
        help="run twice, without and with this valve file in the law; print both errors",
    )
    parser.add_argument("--period-s", type=float, default=1e-3, help="period of the control loop")
    parser.add_argument("--noise-m", type=float, default=0.0, help="standard deviation of the sensor's noise")
    parser.add_argument("--seed", type=int, default=0, help="seed of the noise")
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="REC.csv", help="the recording")


@dataclass(frozen=True, slots=True)
class Run:
    """One run: what the daemon saw and decided, when the reference began, s, and where the stem really was, m."""

    snapshots: list["Snapshot"]
    begin_s: float
    stem_m: list[float]
    """From the beginning of the reference on."""

    @property
    def references_m(self) -> list[float]:
        """The reference in force, m, with each position of the stem."""
        return [each.decision.reference_m for each in self.snapshots[-len(self.stem_m) :]]

    @property
    def error_m(self) -> float:
        """Root mean square of the stem's error when the reference is about to change, m."""
        following_m = [*self.references_m[1:], nan]
        errors_m = [
            stem - here
            for stem, here, after in zip(self.stem_m, self.references_m, following_m, strict=True)
            if here != after
        ]
        return sqrt(sum(each**2 for each in errors_m) / len(errors_m))


def run(arguments: argparse.Namespace) -> int:
    """Play and write the recording; its time is the reference's, identification lies before it."""
    from config.recording import write_recording
    from config.valve_file import find_valve
    from positioner.cli.parts.csv_series import read_series

    recording_writable(arguments.out, "-o")
    path = find_valve(arguments.valve)
    valve = read_valve(arguments.valve).valve
    time_s, reference_m = read_series(arguments.reference, "reference_m")
    _require_travel(arguments.reference, reference_m, valve.stroke_m)
    extended = None if arguments.extended is None else load_extended_valve(_files(arguments, valve)[0], "--extended")
    what = f"identifying {valve.name} and following {time_s[-1] - time_s[0]:g} s of references"
    with at_work("play", what):
        runs = [_play_daemon(arguments, path, valve, time_s, reference_m, None)]
    applied = runs[0].snapshots[-1].decision.applied
    ratios = applied.ratios
    if ratios is None:
        raise CommandFailed(f"{arguments.valve}: not identified, so not controlled: {applied.last_refusal.text}")
    print(f"identified b/c = {ratios.b_over_c:.6g} Pa/m, k/c = {ratios.k_over_c:.6g} Pa")
    print(_left(runs[0], valve.stroke_m, f"law {arguments.law}, identified"))
    if extended is not None:
        with at_work("play", f"the same, given {arguments.extended}"):
            runs.append(_play_daemon(arguments, path, valve, time_s, reference_m, extended))
        print(_left(runs[1], valve.stroke_m, f"law {arguments.law}, given {arguments.extended}"))
    last = runs[-1]
    write_recording(arguments.out, _recording(last.snapshots, float(time_s[0]) - last.begin_s, valve.name))
    print(f"{arguments.out}: {len(last.snapshots)} samples")
    return 0


def _left(played: Run, stroke_m: float, name: str) -> str:
    """Return what a run leaves, and what it travelled for that: the ends of steps hide a stem that hunts in between."""
    error = f"error of the stem ({name}): {100 * played.error_m / stroke_m:.3f} % of stroke rms"
    travel = f"{_travel_m(played.stem_m) / stroke_m:.2f} strokes travelled"
    return f"{error}, {travel}, {_travel_m(played.references_m) / stroke_m:.2f} by the references"


def _travel_m(places_m: list[float]) -> float:
    """Return how far it is from place to place, m."""
    return sum(abs(after - before) for before, after in pairwise(places_m))


def _play_daemon(
    arguments: argparse.Namespace,
    path: Path,
    valve: "ValveParameters",
    time_s: "Column",
    reference_m: "Column",
    extended: "ExtendedValve | None",
) -> Run:
    """Let the daemon identify the valve, or give it the extended one, and follow the reference."""
    from positioner.control.settings import Settings
    from positioner.virtual.virtual_cycle import play_script, run_identification, virtual_cycle
    from sim.slave.slave import device_of

    daemon, slave = _files(arguments, valve)
    device = device_of(slave, path)
    cycle = virtual_cycle(daemon, device, _first_requests(valve), Settings.of(daemon, extended))
    snapshots = [cycle.snapshot]
    if extended is None:
        within_s = daemon.excitation.staircase_limit_s if daemon.by_slides else IDENTIFY_S
        snapshots = list(run_identification(cycle, within_s, wait=not daemon.by_slides))
    begin_s = snapshots[-1].sample.time_s
    ask = _script(time_s, reference_m, begin_s)
    stem_m = []
    for snapshot in islice(play_script(cycle, ask, begin_s + float(time_s[-1] - time_s[0])), 1, None):
        snapshots.append(snapshot)
        stem_m.append(device.stem_m)
    return Run(snapshots, begin_s, stem_m)


def _require_travel(path: Path, reference_m: "Column", stroke_m: float) -> None:

    wrong = (reference_m < 0) | (reference_m > stroke_m)
    if wrong.any():
        value = reference_m[int(wrong.argmax())]
        raise InputError(str(path), f"reference_m: {value:g} m is outside the travel, allowed is 0 to {stroke_m:g} m")


def _files(arguments: argparse.Namespace, valve: "ValveParameters") -> tuple["DaemonFile", "SlaveFile"]:
    """Return the files that a daemon and a slave would be given for this loop."""
    from config.daemon_file import DaemonFile
    from config.loading import validate
    from config.slave_file import SlaveFile

    most_pa = max(420e3, 1.5 * (valve.static_n + valve.spring_n_per_m * valve.stroke_m) / valve.diaphragm_area_m2)
    daemon = {
        "valve": {"name": valve.name, "stroke_m": valve.stroke_m},
        "cycle": {"pace": "device", "period_s": arguments.period_s},
        "pressure": {"maximum_pa": most_pa},
        "control": {"law": arguments.law},
        **({} if arguments.extended is None else {"law": {"valve": arguments.extended}}),
    }
    slave = {
        "clock": {"mode": "lockstep", "period_s": arguments.period_s},
        "sensor": {"noise_std_m": arguments.noise_m, "seed": arguments.seed},
        "supply": {"maximum_pa": most_pa},
    }
    return (
        validate(DaemonFile, daemon, "--period-s"),
        validate(SlaveFile, slave, "--period-s, --noise-m, --seed"),
    )


def _first_requests(valve: "ValveParameters") -> Requests:
    """Return what an engineer who knows the valve's data sheet asks for: an excitation of a third of the travel."""

    travel_pa = valve.spring_n_per_m * valve.stroke_m / valve.diaphragm_area_m2
    return Requests(
        mode=Mode.AUTOMATIC,
        mode_writes=1,
        alpha_pa=valve.static_n / valve.diaphragm_area_m2 + 0.2 * travel_pa,
        beta_pa=0.15 * travel_pa,
    )


def _script(time_s: "Column", reference_m: "Column", begin_s: float) -> "Script":
    """Return a DCS that writes the reference, from a time of the device on, s."""
    import numpy as np

    def ask(snapshot: "Snapshot", requests: Requests) -> Requests:
        elapsed_s = snapshot.sample.time_s - begin_s + ROUNDING_S
        wanted_m = float(reference_m[int(np.searchsorted(time_s, time_s[0] + elapsed_s, side="right")) - 1])
        new = wanted_m != requests.reference_m or not requests.reference_writes
        return replace(requests, eta=QUIET, reference_m=wanted_m, reference_writes=requests.reference_writes + int(new))

    return ask


def _recording(snapshots: list["Snapshot"], start_s: float, name: str) -> "Recording":
    import numpy as np

    from config.recording import Recording

    columns = {
        "time_s": [start_s + each.sample.time_s for each in snapshots],
        "command_pa": [each.decision.command_pa for each in snapshots],
        "position_m": [each.sample.position_m for each in snapshots],
        "pressure_pa": [each.sample.pressure_pa for each in snapshots],
        "reference_m": [each.decision.reference_m for each in snapshots],
        "state": [each.decision.state for each in snapshots],
    }
    return Recording(
        {column: np.array(values, dtype=np.float64) for column, values in columns.items()},
        {"valve": name, "source": "positioner play"},
    )
