"""The cycle: what it publishes and what it records."""

from collections.abc import Iterator
from dataclasses import replace

from config.codes import Mode
from config.daemon_file import DaemonFile
from drivers.boundary import Capabilities, NoReply, Reading
from positioner.control.controller import Controller
from positioner.control.requests import Requests
from positioner.control.settings import Settings
from positioner.daemon.cycle import Cycle
from positioner.daemon.link import Link
from positioner.daemon.pacing import DevicePace, Pace, RealTimePace
from positioner.daemon.recorder import Row

DAEMON = DaemonFile.model_validate(
    {"valve": {"stroke_m": 0.1}, "law": {"b_over_c_pa_per_m": -800e3, "k_over_c_pa": -20e3}, "control": {"law": "seed"}}
)


class Device:
    """Answers with counters from a list; None is silence."""

    capabilities = Capabilities(one_transaction=True, device_time=True, sample_counter=True)

    def __init__(self, counters: list[int | None]) -> None:
        self._counters: Iterator[int | None] = iter(counters)
        self._last = 0
        self.sent_pa: list[float] = []

    def open(self) -> float:
        return 40e3

    def read(self) -> Reading:
        return Reading(0.03, 40e3, self._last, self._last * 1e-3)

    def write(self, command_pa: float) -> None:
        self.sent_pa.append(command_pa)

    def exchange(self, command_pa: float) -> Reading:
        self.sent_pa.append(command_pa)
        counter = next(self._counters)
        if counter is None:
            raise NoReply("silent")
        self._last = counter
        return Reading(0.03, command_pa, counter, counter * 1e-3)

    def close(self) -> None:
        pass


class Notes:
    """A recorder that keeps what it is offered."""

    unrecorded = 0

    def __init__(self) -> None:
        self.rows: list[Row] = []

    def offer(self, row: Row) -> None:
        self.rows.append(row)


def run(counters: list[int | None], pace: Pace) -> tuple[list[Row], list[float]]:
    """Cycle once per counter, a step of the reference before the third; return rows recorded and commands sent."""
    device, notes = Device(counters), Notes()
    link = Link(device, pace)
    held_pa, _ = link.open()
    cycle = Cycle(link, Controller(Settings.of(DAEMON), held_pa), pace, Requests(), notes)
    for index in range(1, len(counters)):
        if index == 2:
            cycle.requests = replace(
                cycle.requests, mode=Mode.AUTOMATIC, mode_writes=1, reference_m=0.05, reference_writes=1
            )
        cycle.once()
    return notes.rows, device.sent_pa


def test_only_new_samples_are_recorded() -> None:
    rows, _ = run([1, 2, 2, None, 3, 4, 5], DevicePace())  # after the loss it only looks
    assert [row[0] for row in rows] == [1e-3, 2e-3, 3e-3, 4e-3]


def test_a_rows_command_acts_from_its_sample_on() -> None:
    """Decided on sample 3: sent with the next exchange. A device in lockstep waits for it, a real one does not."""
    in_lockstep, sent_pa = run([1, 2, 3, 4, 5], DevicePace())
    assert sent_pa == [40e3, 40e3, 40e3, 60e3, 60e3]
    assert [row[1] for row in in_lockstep] == [40e3, 40e3, 60e3, 60e3, 60e3]
    in_real_time, sent_pa = run([1, 2, 3, 4, 5], RealTimePace(1e-3))
    assert [row[1] for row in in_real_time] == sent_pa
