"""The registers of a daemon on a virtual valve, by name: what a test of registers reads, writes and sees refused."""

from collections.abc import Mapping

import pytest
from pymodbus.constants import ExcCodes

from config.daemon_file import DaemonFile
from config.registers import BY_NAME
from config.slave_file import SlaveFile
from config.travel import Travel
from config.valve_file import shipped_valve
from fieldbus.modbus.function_codes import RegisterError
from positioner.control.requests import Requests
from positioner.control.travel.signal_path import SignalPath
from positioner.daemon.cycle import Cycle
from positioner.daemon.supervisory_registers import SupervisoryRegisters
from positioner.virtual.virtual_cycle import virtual_cycle
from sim.slave.slave import device_of

STROKE_M = 0.1016
LAW = {"b_over_c_pa_per_m": -814e3, "k_over_c_pa": -22e3}


class ByName:
    """A daemon's registers, read and written by their names."""

    registers: SupervisoryRegisters

    def get(self, name: str) -> float:
        register = BY_NAME[name]
        return register.format.decode(self.registers.read("holding", register.address, register.format.words))

    def set(self, name: str, value: float) -> None:
        register = BY_NAME[name]
        self.registers.write(register.address, register.format.encode(value), "test")


class Panel(ByName):
    """Registers of a daemon on a virtual valve, by name."""

    def __init__(self, tables: Mapping[str, object] | None = None) -> None:
        daemon = DaemonFile.model_validate(
            {
                "valve": {"stroke_m": STROKE_M},
                "law": LAW,
                "control": {"law": "seed"},
                "pressure": {"minimum_pa": 0.0, "maximum_pa": 200e3},
            }
            | dict(tables or {})
        )
        slave = SlaveFile.model_validate({"clock": {"mode": "lockstep"}, "initial": {"position_m": 0.02}})
        self.cycle: Cycle = virtual_cycle(daemon, device_of(slave, shipped_valve("seed")), Requests())
        path = SignalPath.of(daemon.travel)
        self.registers = SupervisoryRegisters(self.cycle, Travel(STROKE_M), 0.0, 200e3, path=path)

    def run(self, cycles: int = 1) -> None:
        for _ in range(cycles):
            self.cycle.once()


def refused(panel: Panel, name: str, value: float) -> ExcCodes:
    before = panel.cycle.requests
    with pytest.raises(RegisterError) as caught:
        panel.set(name, value)
    assert panel.cycle.requests == before, "nothing changed"
    return caught.value.code
