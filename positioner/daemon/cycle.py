"""The cycle: exchange, decide, publish, record; then wait for the next.

    sample_n = exchange(command_(n-1))         one transaction: the command out, the measurement back
    command_n = decide(sample_n, requests)     supervision, S0 to S3, the law
    publish, record                            after the deadline that matters

In real time command_n reaches the wire with the exchange of cycle n + 1, one period of delay. A device in lockstep
answers with the sample at the end of the period for which it has obeyed command_(n-1).
"""

import logging
import time
from collections.abc import Sequence
from threading import Event

from config.codes import GOOD
from positioner.control.controller import Controller
from positioner.control.controller_memory import Decision
from positioner.control.requests import Requests
from positioner.control.sample import Sample
from positioner.daemon.cycle_statistics import CycleStatistics
from positioner.daemon.health import Health
from positioner.daemon.history.valve_history import ValveHistory
from positioner.daemon.link import Link
from positioner.daemon.logs import log_event, logging_valve
from positioner.daemon.pacing import Pace
from positioner.daemon.recorder import Row, RowSink
from positioner.daemon.snapshot import Snapshot

log = logging.getLogger(__name__)


class Cycle:
    """Runs the controller on a device. One thread calls `turn`; others read `snapshot` and replace `requests`.

    The first cycle runs at once: it commands what the device holds, so it moves nothing. `valve` names it in the log.
    """

    def __init__(
        self,
        link: Link,
        controller: Controller,
        pace: Pace,
        requests: Requests,
        recorder: RowSink | None,
        valve: str | None = None,
        health: Health | None = None,
        history: ValveHistory | None = None,
    ) -> None:
        self.requests = requests
        self.statistics = CycleStatistics(pace.period_s)
        self.link = link
        self.recorder = recorder
        self.health = health
        self.history = history
        self.controller = controller
        self.pace = pace
        self._valve = valve
        sent_pa = controller.command_pa
        self.snapshot = self._decided(sent_pa, link.exchange(sent_pa))

    def prepare(self) -> None:
        """Make the calling thread, which takes the turns, as punctual as can be."""
        with logging_valve(self._valve):
            self.pace.prepare()
            self.link.begin()
            self.controller.begin()

    def turn(self) -> None:
        """Wait until the next cycle is due and run it."""
        with logging_valve(self._valve):
            missed = self.pace.wait()
            started_s = time.monotonic()
            self.once()
            self.statistics.enter(started_s, time.monotonic() - started_s, missed)

    def whole(self) -> None:
        """Run one cycle, now."""
        with logging_valve(self._valve):
            self.once()

    def ask(self) -> int | None:
        """Begin a cycle by asking the device; return what is ready when it answers. None: `whole` does it all."""
        return self.link.ask(self.controller.command_pa)

    def answer(self, *, late: bool) -> bool:
        """End a cycle that has asked, if the answer has come, or the time for it is over; return whether it has."""
        with logging_valve(self._valve):
            sent_pa = self.controller.command_pa
            sample = self.link.answer(late=late)
            if sample is not None:
                self._conclude(sent_pa, sample)
        return sample is not None

    def since_s(self, snapshot: Snapshot) -> float:
        """Return how long ago a snapshot was made. Called by any thread."""
        return self.pace.since_s(snapshot.sample.now_s)

    def once(self) -> None:
        """Run one cycle."""
        sent_pa = self.controller.command_pa
        self._conclude(sent_pa, self.link.exchange(sent_pa))

    def _conclude(self, sent_pa: float, sample: Sample) -> None:
        """Decide on what came back, and say what has changed."""
        before = self.snapshot.decision
        self.snapshot = self._decided(sent_pa, sample)
        decision = self.snapshot.decision
        if decision is before:
            return
        if _logged_fields(before) != _logged_fields(decision):
            _log_decision(decision)
        if self.history is not None:
            self.history.enter(before, decision)

    def _decided(self, sent_pa: float, sample: Sample) -> Snapshot:
        decision = self.controller.step(sample, self.requests)
        if self.recorder is not None and sample.quality is GOOD:
            # A device that was only looked at has got nothing.
            given_pa = sent_pa if sample.held_pa is None else sample.held_pa
            in_force_pa = self.pace.in_force_pa(given_pa, decision.command_pa)
            self.recorder.offer(_row(sample, decision, in_force_pa, self.link.counts.lost_samples))
        if self.health is not None:
            self.health.enter(sample, decision, self.requests)
        return Snapshot(sample, decision, None if self.history is None else self.history.newest)


def run_in_turn(cycles: Sequence[Cycle], stop: Event) -> None:
    """Run cycles, those of one line, one after another until `stop` is set."""
    for cycle in cycles:
        cycle.prepare()
    while not stop.is_set():
        for cycle in cycles:
            cycle.turn()


def _logged_fields(decision: Decision) -> tuple[object, ...]:
    trust = decision.restoration.trust
    return decision.state, decision.mode, decision.fault, decision.inhibit_reason, decision.applied, trust


def _log_decision(decision: Decision) -> None:
    log_event(
        log,
        logging.WARNING if decision.fault else logging.INFO,
        "decision",
        state=decision.state.name,
        mode=decision.mode.name,
        fault=decision.fault.name,
        why=decision.inhibit_reason.name,
        command_pa=decision.command_pa,
        identifications=decision.applied.count,
        refusal=decision.applied.last_refusal.name,
        singly=decision.estimates.b.reason.name,
        sampling=decision.estimates.sampling.name,
        restored=decision.restoration.trust.name,
    )


def _row(sample: Sample, decision: Decision, in_force_pa: float, lost_samples: int) -> Row:
    return (
        sample.time_s,
        in_force_pa,
        sample.position_m,
        sample.pressure_pa,
        decision.reference_m,
        int(decision.state),
        lost_samples,
    )
