"""The process beside the daemon: does its jobs, survives bad ones, and its death is no more than a refusal."""

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from positioner.daemon import refinement_process as room
from positioner.daemon.refinement_process import ProcessRefiner, RefinementProcess
from positioner.estimation.batch import BatchSettings
from positioner.estimation.refiner import RefinementJob
from tests.estimation.stem import NOISE, TRUTH, grid, run, swing

pytestmark = pytest.mark.patient


def job() -> RefinementJob:
    moved = run(swing, grid(1e-3, -0.1, 0.8)).noisy(np.random.default_rng(1))
    return RefinementJob(
        moved.time_s, moved.position_m, moved.pressure_pa, BatchSettings(noise_std_m=NOISE, pressure_held=True)
    )


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine may take long to start a process."""
    monkeypatch.setattr(room, "LONGEST_WAIT_S", 100.0)


@pytest.fixture(scope="module")
def process() -> Iterator[RefinementProcess]:
    made = RefinementProcess()
    yield made
    made.stop()


def test_a_job_is_done_elsewhere_exactly_as_here(process: RefinementProcess) -> None:
    refiner = process.refiner(blocking=True)
    assert refiner.submit(job())
    assert refiner.pending
    assert not refiner.submit(job()), "one at a time"
    result, here = refiner.collect(), job().run()
    assert result is not None
    assert result.estimates == here.estimates
    assert result.estimates.b.value == pytest.approx(TRUTH["b"], rel=0.01)
    assert refiner.collect() is None, "a result is given once"


def test_it_is_started_before_there_is_a_job_and_ends_at_once() -> None:
    made = RefinementProcess()
    until = time.monotonic() + 60
    while made.child is None and time.monotonic() < until:
        time.sleep(0.005)
    assert made.child is not None
    assert made.child.poll() is None
    child, begin = made.child, time.monotonic()
    made.stop()
    assert child.poll() is not None
    assert time.monotonic() - begin < 2.0


def test_asking_does_not_wait(process: RefinementProcess) -> None:
    refiner = process.refiner()
    assert refiner.submit(job())
    begin = time.perf_counter()
    refiner.collect()
    assert time.perf_counter() - begin < 0.02
    assert until_collected(refiner)


def test_a_job_that_makes_no_sense_fails_alone(process: RefinementProcess) -> None:
    refiner = process.refiner(blocking=True)
    bad = job()
    assert refiner.submit(RefinementJob(bad.time_s, bad.position_m[:-1], bad.pressure_pa, bad.settings))
    assert refiner.collect() is None
    assert not refiner.pending
    assert refiner.submit(job())
    assert refiner.collect() is not None


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGSTOP])
def test_a_process_that_dies_or_does_not_answer_is_told_and_started_again(
    end: signal.Signals, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    process = RefinementProcess()
    refiner = process.refiner(blocking=True)
    assert refiner.submit(job())
    assert refiner.collect() is not None
    assert process.child is not None
    before = process.child
    with monkeypatch.context() as impatient:
        impatient.setattr(room, "ANSWER_WITHIN_S", 0.2)
        impatient.setattr(room, "FIRST_S", 1e6)
        os.kill(before.pid, end)
        refiner.submit(job())
        assert refiner.collect() is None
        assert not refiner.submit(job()), "not before the back-off is over"
    assert caplog.messages == ["the refinement process is gone"]
    process.again_s = 0.0
    assert refiner.submit(job())
    assert refiner.collect() is not None
    assert process.child is not before
    assert before.poll() is not None, "nothing is left of it"
    process.stop()


def test_a_process_that_is_killed_while_idle_is_said_and_none_is_left_of_it(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(room, "LOOK_EVERY_S", 0.01)
    process = RefinementProcess()
    until = time.monotonic() + 60
    while process.child is None and time.monotonic() < until:
        time.sleep(0.005)
    assert process.child is not None
    child = process.child
    os.kill(child.pid, signal.SIGKILL)
    while process.child is not None and time.monotonic() < until:
        time.sleep(0.005)
    assert child.returncode == -signal.SIGKILL, "it was waited for: no zombie"
    assert not Path(f"/proc/{child.pid}").exists()
    process.stop()
    assert caplog.messages == ["the refinement process is gone"]


def test_it_is_started_ever_more_seldom(monkeypatch: pytest.MonkeyPatch) -> None:
    process = RefinementProcess()
    process.stop()
    monkeypatch.setattr(room, "time", SimpleNamespace(monotonic=lambda: 0.0))
    waits = []
    for _ in range(12):
        process.give_up("it ended")
        waits.append(process.again_s)
    assert waits[:4] == [1.0, 2.0, 4.0, 8.0]
    assert waits[-1] == room.LONGEST_S


def until_collected(refiner: ProcessRefiner) -> bool:
    until = time.monotonic() + 60
    while time.monotonic() < until:
        if refiner.collect() is not None:
            return True
        time.sleep(0.005)
    return False
