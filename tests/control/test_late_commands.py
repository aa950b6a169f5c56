"""A loop in real time: commands come into force some periods late, and what S3 finds by its sine is applied.

The pressure is that in force: however late it comes, the stem leaves its rest at its jump.
"""

from collections import deque
from typing import Any

import pytest

from config.codes import Mode, Refusal
from config.daemon_file import DaemonFile
from config.slave_file import SlaveFile
from config.valve_file import load_valve, shipped_valve
from positioner.control.controller_memory import Decision
from positioner.control.requests import Requests
from positioner.estimation.batch import BatchResult
from positioner.estimation.refiner import InProcessRefiner
from positioner.virtual.virtual_cycle import run_identification, virtual_cycle
from sim.slave.simulated_device import Device
from sim.valve import Valve
from tests.cases import few_always

SEED = load_valve(shipped_valve("seed"))
VALVE = SEED.valve


class Late:
    """A device whose commands come into force some periods late."""

    def __init__(self, device: Device, periods: int) -> None:
        self._device = device
        self._on_the_way = deque([device.command_pa] * (periods + 1), maxlen=periods + 1)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._device, name)

    def tick(self, command_pa: float) -> None:
        self._on_the_way.append(command_pa)
        self._device.tick(self._on_the_way[0])


def identified_when_late(periods: int) -> Decision:
    """Return what the cycle has decided when S3 is over: the seed's valve, sine and period, noise of 10 um."""
    daemon = DaemonFile.model_validate(
        {"valve": {"stroke_m": VALVE.stroke_m}, "cycle": {"pace": "device"}, "control": {"law": "seed"}}
    )
    slave = SlaveFile.model_validate({"clock": {"mode": "lockstep"}, "sensor": {"noise_std_m": 1e-5}})
    valve = Valve.from_file(SEED)
    valve.rest_at(0.0, 0.0)
    first = Requests(mode=Mode.AUTOMATIC, mode_writes=1, alpha_pa=44126.0, beta_pa=13238.0)
    cycle = virtual_cycle(daemon, Late(Device(valve, slave, {}), periods), first)
    for _ in run_identification(cycle, 5.0, wait=False):
        pass
    return cycle.snapshot.decision


@pytest.fixture
def reasons(monkeypatch: pytest.MonkeyPatch) -> list[Refusal]:
    """What the fits of the test said of themselves."""
    said: list[Refusal] = []

    def collect(self: InProcessRefiner) -> BatchResult | None:
        if (result := taken(self)) is not None:
            said.append(result.estimates.b_over_c.reason)
        return result

    taken = InProcessRefiner.collect
    monkeypatch.setattr(InProcessRefiner, "collect", collect)
    return said


@pytest.mark.parametrize("periods", few_always([4, 10, 1, 2], 2))
def test_late_commands_are_identified(periods: int, reasons: list[Refusal]) -> None:
    """A record that begins two to five samples before the stem leaves has a rest too short to be known by itself."""
    ratios = identified_when_late(periods).applied.ratios
    assert reasons == [Refusal.VALID]
    assert ratios is not None
    assert -ratios.b_over_c == pytest.approx(VALVE.spring_n_per_m / VALVE.diaphragm_area_m2, rel=1e-3)
    assert -ratios.k_over_c == pytest.approx(VALVE.coulomb_n / VALVE.diaphragm_area_m2, rel=1e-3)
