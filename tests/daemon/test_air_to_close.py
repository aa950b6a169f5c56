"""A valve that air closes, as its shipped profiles have it: identified, positioned, shut, and left open without air."""

from dataclasses import replace

import pytest

from config.codes import Mode, Ne107Status
from config.daemon_file import DaemonFile, load_daemon
from config.loading import SHIPPED
from config.registers import BY_NAME
from config.slave_file import load_slave
from config.travel import Travel
from config.valve_file import shipped_valve
from positioner.control.requests import Requests
from positioner.daemon.memory.known_configuration import conditions_of
from positioner.daemon.supervisory_registers import SupervisoryRegisters
from positioner.virtual.virtual_cycle import run_identification, virtual_cycle
from sim.slave.slave import device_of

PROFILES = SHIPPED / "profiles"


class AirToClose:
    """The shipped daemon on the shipped slave, in virtual time, behind its registers."""

    def __init__(self) -> None:
        file, slave = (
            load_daemon(PROFILES / "daemon_air_to_close.toml"),
            load_slave(PROFILES / "slave_air_to_close.toml"),
        )
        clock = slave.clock.model_copy(update={"period_s": file.cycle.period_s})
        self.device = device_of(slave.model_copy(update={"clock": clock}), shipped_valve(slave.valve))
        self.cycle = virtual_cycle(file, self.device, Requests())
        self.travel = file.valve.travel
        self.registers = SupervisoryRegisters(self.cycle, self.travel, 0.0, file.pressure.maximum_pa)

    def get(self, name: str) -> float:
        place = BY_NAME[name]
        return place.format.decode(self.registers.read("holding", place.address, place.format.words))

    def set(self, name: str, value: float) -> None:
        place = BY_NAME[name]
        self.registers.write(place.address, place.format.encode(value), "test")

    def asked(self, opening: float) -> float:
        """Ask for an opening and return the one that the stem truly has ten seconds later."""
        self.set("reference", opening)
        for _ in range(500):
            self.cycle.once()
        return self.travel.opening(self.device.stem_m)


@pytest.fixture(scope="module")
def valve() -> AirToClose:
    valve = AirToClose()
    valve.set("mode", Mode.AUTOMATIC)
    list(run_identification(valve.cycle, 600.0, wait=False))
    valve.cycle.requests = replace(valve.cycle.requests, eta=(1, 1, 1))
    assert valve.cycle.snapshot.decision.applied.count == 1
    return valve


def test_without_air_it_is_open() -> None:
    valve = AirToClose()
    assert valve.get("position") == pytest.approx(1.0, abs=0.001)
    assert valve.get("position_m") == pytest.approx(0.040, abs=4e-5)


def test_openings_count_from_the_closed_end_for_whoever_writes_and_reads(valve: AirToClose) -> None:
    before_pa = {}
    for opening in (0.7, 0.2, 0.4):
        assert valve.asked(opening) == pytest.approx(opening, abs=0.003)
        before_pa[opening] = valve.device.command_pa
        assert valve.get("position") == pytest.approx(opening, abs=0.003)
        assert valve.get("reference_in_force") == pytest.approx(opening, abs=1e-6)
        assert valve.get("reference_scaled") == round(1e4 * opening)
    assert before_pa[0.2] > before_pa[0.7], "air closes it"
    assert valve.get("delta_r") == pytest.approx(0.2, abs=1e-6)
    assert valve.get("ne107") == Ne107Status.GOOD


def test_tight_shut_off_takes_all_the_air_there_is(valve: AirToClose) -> None:
    assert valve.asked(0.005) == pytest.approx(0.0, abs=0.001)
    assert valve.device.command_pa == 140e3


@pytest.mark.parametrize("closes", [False, True])
def test_opening_and_stem_are_each_others_inverse_and_a_window_stays_one(closes: bool) -> None:
    travel = Travel(0.04, closes)
    for opening in (-0.1, 0.0, 0.3, 1.0):
        assert travel.opening(travel.stem_m(opening)) == pytest.approx(opening)
        assert travel.turned_m(travel.turned_m(opening)) == pytest.approx(opening)
    low_m, high_m = travel.window_m((0.1, 0.7))
    assert low_m < high_m
    assert sorted(travel.opening(each) for each in (low_m, high_m)) == pytest.approx([0.1, 0.7])


def test_what_was_learnt_with_air_to_open_is_not_taken_for_one_that_air_closes() -> None:
    opens, closes = (
        conditions_of(DaemonFile.model_validate({"valve": {"stroke_m": 0.04, "action": action}}))
        for action in ("air_to_open", "air_to_close")
    )
    assert closes.items() - opens.items() == {("valve.action", '"air_to_close"')}
    assert not opens.items() - closes.items()
