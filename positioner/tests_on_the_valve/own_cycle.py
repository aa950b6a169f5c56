"""The valve of a cycle that this process turns itself: on a device in real time, in lockstep, or in virtual time.

It asks as a DCS would, by the requests, and takes the rows that a recorder would write.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from config.codes import ExperimentState
from config.drive import VALVE, Kind
from config.recorder_files import COLUMNS
from config.recording import Recording, of_kind
from positioner.daemon.cycle import Cycle
from positioner.daemon.recorder import Row
from positioner.tests_on_the_valve.program import Played, Program


class Rows:
    """Takes the rows of a cycle while something is played."""

    unrecorded = 0

    def __init__(self, kind: Kind) -> None:
        self._rows: list[Row] = []
        self._said = of_kind(kind)

    def offer(self, row: Row) -> None:
        """Take a row."""
        self._rows.append(row)

    def taken(self) -> Recording | None:
        """Return what was taken since the last time; None without a row."""
        rows, self._rows = self._rows, []
        if not rows:
            return None
        columns = np.array(rows, dtype=np.float64).T
        return Recording(dict(zip(COLUMNS, columns, strict=False)), self._said)


class OwnCycle:
    """A valve on whose cycle programs are played.

    Args:
        cycle: in automatic, with consent.
        turn: has it run once; `cycle.once` in virtual time, `cycle.turn` on a clock.
        kind: of the valve.
    """

    def __init__(self, cycle: Cycle, turn: Callable[[], None] | None = None, kind: Kind = VALVE) -> None:
        self.cycle = cycle
        self.turn = turn or cycle.once
        self._rows = Rows(kind)
        cycle.recorder = self._rows

    def command_pa(self) -> float:
        """Return the command in force, Pa."""
        return self.cycle.snapshot.decision.command_pa

    def watch(self, for_s: float) -> Recording | None:
        """Return what is measured for a while under the command that is held; None without a good sample."""
        self._rows.taken()
        until_s = self.cycle.snapshot.sample.now_s + for_s
        while self.cycle.snapshot.sample.now_s < until_s:
            self.turn()
        return self._rows.taken()

    def play(self, program: Program) -> Played:
        """Play a program, to its end or until it is broken off."""
        cycle, asked = self.cycle, self.cycle.requests
        cycle.requests = replace(
            asked,
            experiment=replace(
                asked.experiment,
                points=program.points,
                starts=asked.experiment.starts + 1,
                turn_m=program.turn_m,
                band_m=program.band_m,
            ),
        )
        self._rows.taken()
        try:
            self._to_its_end()
        except BaseException:
            self._break_off()
            raise
        state = cycle.snapshot.decision.experiment.state
        return Played(self._rows.taken(), state, "" if state.played else self._why(state))

    def _to_its_end(self) -> None:
        self.turn()
        while self.cycle.snapshot.decision.experiment.commands:
            self.turn()

    def _break_off(self) -> None:
        """Veto what is played, and go back to the command before; whoever interrupts that, leaves it where it is."""
        asked = self.cycle.requests
        self.cycle.requests = replace(asked, experiment=replace(asked.experiment, vetoed=True))
        self._to_its_end()
        self.cycle.requests = asked

    def _why(self, state: ExperimentState) -> str:
        fault = self.cycle.snapshot.decision.fault
        return f"fault: {fault.text}" if state is ExperimentState.FAULT else state.text
