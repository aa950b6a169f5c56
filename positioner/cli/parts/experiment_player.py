"""Plays experiments on the valve of a running daemon, over its registers, and reads what its recorder wrote."""

import argparse
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from config.codes import ExperimentState, Fault, Mode, State
from config.errors import CommandFailed, InputError
from config.recorder_files import files_of
from config.recording import Recording
from positioner.cli.parts.daemon_address import connect_dcs

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile
    from positioner.dcs import Dcs
    from positioner.tests_on_the_valve.program import Played as PlayedProgram
    from positioner.tests_on_the_valve.program import Program
    from workbench.discriminate.discrimination import Player
    from workbench.discriminate.experiment_design import DesignedExperiment

RECORDED_WITHIN_S, BROKEN_OFF_WITHIN_S = 30.0, 5.0
"""Until the recorder has written an experiment; one that was broken off, for one that was refused has no rows."""
PLAY_POLL_S = 0.3
LANDED_CYCLES, LANDS_WITHIN_S, LANDING_POLL_S = 10, 10.0, 0.05
"""A law that has held its command for so many cycles has landed the stem; one that never holds is not waited for."""
LATEST_FILES = 2
"""Of the recorder, in which an experiment may lie."""
TRIED_BEGINS = 200
"""Places of a recording at which a sequence may begin."""
SAME_PRESSURE_SHARE, LEAST_PLAYED_SHARE = 0.01, 0.95
"""Of the sequence's pressures, and of its length: farther from them, or for less, a recording is of something else."""


def require_ready(file: "DaemonFile", arguments: argparse.Namespace) -> None:
    """Look whether a daemon answers, in automatic, with consent, records, and has its stem where it may play.

    Raises:
        InputError: no recorder in the file, or its folder is not on this machine.
        CommandFailed: no daemon, another mode, no consent, a veto, or the stem elsewhere; says what to do.
    """

    if file.recorder is None:
        raise InputError(
            str(arguments.config), 'recorder: is needed to read experiments: [recorder] folder = "recordings"'
        )
    folder = recordings_of(file, arguments)
    with daemon_of(arguments) as dcs:
        if not folder.is_dir():
            raise InputError(str(folder), "the recorder's folder is not there: run this on the daemon's machine")
        dcs.wait_for_a_cycle()  # a mode that was written just before is decided on by the next
        if dcs.get("mode") != Mode.AUTOMATIC:
            raise CommandFailed(
                "the mode is not automatic, so nothing may move the valve: positioner set mode automatic"
            )
        if not dcs.get("experiment_consent"):
            raise CommandFailed("the DCS has not consented to experiments: positioner set experiment_consent 1")
        if dcs.get("experiment_veto"):
            raise CommandFailed("experiments are vetoed: positioner set experiment_veto 0")
        if dcs.get("experiment_state") in (ExperimentState.UNDER_WAY, ExperimentState.RETURNING):
            raise CommandFailed(
                "an experiment is under way: wait for its end, or end it: positioner set experiment_veto 1"
            )
        least, most = file.experiment.travel_window
        position = float(dcs.get("position"))
        if (least > 0.0 and position < least) or (most < 1.0 and position > most):  # 0 and 1 are the stops
            raise CommandFailed(
                f"the stem is at {position:.3g} of its stroke, outside [experiment] travel_window = "
                f"[{least:g}, {most:g}]: move it there, by positioner set reference"
            )


class RunningValve:
    """The valve of a running daemon, on which the programs of tests are played.

    Args:
        file: the daemon's, with `[recorder]`.
        arguments: of the command: `config`, `name`, `tls`.
    """

    def __init__(self, file: "DaemonFile", arguments: argparse.Namespace) -> None:
        self._file = file
        self._arguments = arguments
        self._folder = recordings_of(file, arguments)

    def command_pa(self) -> float:
        """Return the command in force, Pa, once the law has landed."""
        with daemon_of(self._arguments) as dcs:
            wait_until_landed(dcs)
            return float(dcs.get("command"))

    def stem_m(self) -> float:
        """Return where the stem is, m, as recordings have it: more air, more of it."""
        with daemon_of(self._arguments) as dcs:
            return self._file.valve.travel.stem_m(float(dcs.get("position")))

    def slope_pa_per_m(self) -> float | None:
        """Return the spring rate over the area that the law works with, Pa/m; None while it knows none."""
        with daemon_of(self._arguments) as dcs:
            ratio = float(dcs.get("b_over_c_applied"))
        return -ratio if ratio < 0.0 else None

    def dead_band_pa(self) -> float | None:
        """Return twice the friction over the area that the law works with, Pa; None while it knows none."""
        with daemon_of(self._arguments) as dcs:
            ratio = float(dcs.get("k_over_c_applied"))
        return -2.0 * ratio if ratio < 0.0 else None

    def play(self, program: "Program") -> "PlayedProgram":
        """Play a program and return what the daemon's recorder has of it."""
        from positioner.tests_on_the_valve.program import Played

        within_s = 2.0 * self._file.experiment.limit_s + RECORDED_WITHIN_S
        before = last_excited(self._folder, self._file.valve.name)
        with daemon_of(self._arguments) as dcs:
            turn, band = (each / self._file.valve.stroke_m for each in (program.turn_m, program.band_m))
            state = dcs.play(program.points, within_s, turn=turn, band=band)
            problem = "" if state.played else why_not(state, dcs)
        points = program.points if state is ExperimentState.COMPLETE else ()
        written_s = RECORDED_WITHIN_S if state.played else BROKEN_OFF_WITHIN_S
        recording = read_experiment_rows(self._folder, self._file.valve.name, points, before, written_s)
        if recording is None and not problem:
            problem = f"the recording in {self._folder} is not complete"
        return Played(recording, state, problem)


def player_on(file: "DaemonFile", arguments: argparse.Namespace) -> "Player":
    """Return what plays experiments on the daemon's valve."""
    from positioner.tests_on_the_valve.program import Program
    from workbench.discriminate.discrimination import Played

    valve = RunningValve(file, arguments)

    def play(chosen: "DesignedExperiment") -> Played:
        played = valve.play(Program("experiment", chosen.course.points()))
        whole = played.state is ExperimentState.COMPLETE
        return Played(played.recording if whole else None, played.problem)

    return play


def wait_until_landed(dcs: "Dcs") -> None:
    """Wait for the law, which the test before may have left with a way to go: travels are counted from a rest."""
    due_s = time.monotonic() + LANDS_WITHIN_S
    command_pa, since = dcs.get("command"), dcs.get("cycles")
    while time.monotonic() < due_s and dcs.get("cycles") < since + LANDED_CYCLES:
        time.sleep(LANDING_POLL_S)
        if (now_pa := dcs.get("command")) != command_pa:
            command_pa, since = now_pa, dcs.get("cycles")


def why_not(state: ExperimentState, dcs: "Dcs") -> str:
    """Say why an experiment was not played to its end; of a fault, which."""

    fault = Fault(int(dcs.get("fault"))) if state is ExperimentState.FAULT else Fault.NONE
    return state.text if fault is Fault.NONE else f"fault: {fault.text}"


def read_experiment_rows(
    folder: Path,
    valve: str,
    points: tuple[tuple[float, float], ...],
    before: Recording | None,
    within_s: float,
) -> Recording | None:
    """Return the rows of the experiment that has just ended, once the recorder has written them; None if it does not.

    Without points it may have ended anywhere, so whatever was played since is it; `before` is what was played earlier.

    Raises:
        InputError: a recording cannot be read.
    """
    due_s = time.monotonic() + within_s
    while time.monotonic() < due_s:
        found = last_excited(folder, valve)
        if found and (before is None or found.time_s[-1] != before.time_s[-1]):
            return found if not points or is_of(found, points) else None
        time.sleep(PLAY_POLL_S)
    return None


def last_excited(folder: Path, valve: str) -> Recording | None:
    """Return the last stretch in S3 of the newest recordings, once something follows it; None before."""
    import numpy as np

    from workbench.data.held_out import join_recordings

    newest = files_of(folder, valve)[-LATEST_FILES:]
    parts = [each for each in map(_read, newest) if each is not None]
    if not parts:
        return None
    whole = join_recordings(parts)
    excited = whole.columns["state"] == State.S3_IDENTIFY
    rows = np.flatnonzero(excited)
    if not rows.size or excited[-1]:
        return None
    last = int(rows[-1])
    before = np.flatnonzero(~excited[:last])
    first = int(before[-1]) + 1 if before.size else 0
    return Recording({name: column[first : last + 1] for name, column in whole.columns.items()}, whole.metadata)


def is_of(recording: Recording, points: tuple[tuple[float, float], ...]) -> bool:
    """Whether a recording's commands go through a sequence, wherever in it that begins.

    A sample's command was decided in the cycle that ended with it, however late that was: it is what the sequence asks
    for at some time of that cycle.
    """
    import numpy as np

    at_s, levels_pa = np.array(points).T
    time_s = recording.time_s - recording.time_s[0]
    command_pa = recording.command_pa[1:]
    # The last rows may be missing where cycles were late: what of the sequence is not recorded is not the same.
    begins_s = np.linspace(0.0, max(0.0, float(time_s[-1] - at_s[-1])), TRIED_BEGINS)
    between_s = 0.5 * float(begins_s[1] - begins_s[0])
    rounding_pa = SAME_PRESSURE_SHARE * max(float(np.ptp(levels_pa)), 1.0)

    def share(begin_s: float) -> float:
        cycles_s = time_s[:-1] - begin_s - between_s, time_s[1:] - begin_s + between_s
        first_pa, last_pa = (np.interp(each, at_s, levels_pa) for each in cycles_s)
        low_pa, high_pa = np.minimum(first_pa, last_pa) - rounding_pa, np.maximum(first_pa, last_pa) + rounding_pa
        lasted_s = np.diff(np.clip(time_s - begin_s, 0.0, at_s[-1]))
        return float(np.sum(lasted_s[(low_pa <= command_pa) & (command_pa <= high_pa)]) / at_s[-1])

    return any(share(begin_s) > LEAST_PLAYED_SHARE for begin_s in begins_s.tolist())


def _read(path: Path) -> Recording | None:
    """Read a recording; None for one without a row yet."""

    try:
        return Recording.read(path)
    except InputError as error:
        if error.problem == "holds no samples":
            return None
        raise


def recordings_of(file: "DaemonFile", arguments: argparse.Namespace) -> Path:
    """Return the folder in which a daemon's recorder writes."""
    assert file.recorder is not None
    return Path(arguments.config).parent / file.recorder.folder


@contextmanager
def daemon_of(arguments: argparse.Namespace) -> "Iterator[Dcs]":
    """Connect to the daemon that a command line names."""
    where = {"config": arguments.config, "valve": arguments.name, "tls": arguments.tls}
    with connect_dcs(argparse.Namespace(host=None, port=None, unit=None, **where)) as dcs:
        yield dcs
