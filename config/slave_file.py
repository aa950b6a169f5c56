"""The file of a simulated slave: `positioner sim CONFIG.toml`."""

import math
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, Tag, model_validator

from config.actuators import Actuator
from config.canopen_device import CanBus
from config.device import Host
from config.drive import ROTARY, in_si, require_degrees
from config.errors import InputError
from config.file_kinds import require_kind
from config.loading import SHIPPED, Many, NonNegative, Port, Positive, Pressure, Schema, choose_by, read_toml, validate
from config.modbus_map import SIMULATED_MAP, ModbusMap
from config.quantities import ActionName
from config.serial_port import RtuUnit, SerialPort
from config.tls_table import Tls
from config.travel import ActionWord
from config.valve_file import shipped_valve


class ModbusTcpBus(Schema):
    """Table `[bus]`: where the slave listens on Modbus TCP."""

    kind: Literal["modbus"] = "modbus"
    host: Host = "127.0.0.1"
    port: Port = 5020
    unit: Annotated[int, Field(ge=1, le=247)] = 1
    tls: Tls | None = None
    """Modbus/TCP Security in place of Modbus TCP; an operator may write, an observer read."""
    map: ModbusMap = SIMULATED_MAP
    """Where it keeps its quantities, in the words of the daemon's `[device.map]`."""


class ModbusRtuBus(Schema):
    """Table `[bus]`: the serial line that the slave is on, on Modbus RTU."""

    kind: Literal["rtu"] = "rtu"
    serial: SerialPort
    unit: RtuUnit = 1
    map: ModbusMap = SIMULATED_MAP


class CanopenBus(CanBus):
    """Table `[bus]`: the CAN bus on which the slave is a CANopen node."""

    kind: Literal["canopen"] = "canopen"


AnyBus = Annotated[
    Annotated[ModbusTcpBus, Tag("modbus")]
    | Annotated[ModbusRtuBus, Tag("rtu")]
    | Annotated[CanopenBus, Tag("canopen")],
    choose_by("kind", "modbus"),
]
"""A slave's place on any bus; `kind` says which."""


class SlaveClock(Schema):
    """Table `[clock]`: in real time, or one period per pressure command received (lockstep)."""

    mode: Literal["real_time", "lockstep"] = "real_time"
    period_s: Positive = 1e-3

    @property
    def period_us(self) -> int:
        """The period in whole microseconds, the unit of the device's clock."""
        return round(self.period_s * 1e6)

    @model_validator(mode="after")
    def _period_is_whole_microseconds(self) -> Self:
        if self.period_us < 1 or abs(self.period_s * 1e6 - self.period_us) > 1e-6 * self.period_us:
            raise ValueError("period_s must be a whole number of microseconds")
        return self


class Sensor(Schema):
    """Table `[sensor]`: the position transmitter. White noise, then rounding to the quantum (0 is none)."""

    noise_std_m: NonNegative = 0.0
    quantum_m: NonNegative = 0.0
    seed: Annotated[int, Field(ge=0)] = 0


class Initial(Schema):
    """Table `[initial]`: the stem at rest when the device is switched on."""

    position_m: float = 0.0
    pressure_pa: NonNegative = 0.0


class Supply(Schema):
    """Table `[supply]`: what the I/P can deliver; vent gives 0, fill gives the maximum."""

    maximum_pa: Pressure = 420e3


class CommunicationTimeout(Schema):
    """Table `[communication]`: the device's own defence against a silent master."""

    timeout_s: NonNegative = 0.0
    action: ActionName = "hold"


class Change(Schema):
    """Table `[[change]]`: parameters that take new values at a time, or drift there over a while."""

    at_s: NonNegative
    over_s: NonNegative = 0.0
    coulomb_n: NonNegative | None = None
    static_n: NonNegative | None = None
    viscous_ns_per_m: NonNegative | None = None
    spring_n_per_m: Positive | None = None

    @property
    def targets(self) -> dict[str, float]:
        """The parameters that change, by name, with their new values."""
        return self.model_dump(exclude={"at_s", "over_s"}, exclude_none=True)

    @model_validator(mode="after")
    def _something_changes(self) -> Self:
        if not self.targets:
            raise ValueError("names no parameter to change")
        return self


class DeviceFault(Schema):
    """Table `[[fault]]`: what goes wrong with the device at a time, s, since it was switched on, and for how long.

    drop      it answers nothing                                   (Modbus: as a gateway says it, exception 11)
    freeze    it answers, but its measurements and its clock stand still
    jump      its position transmitter is off by `by_m`
    drift     the same, by ever more, `by_m` at the end
    nan       its position is no number
    supply    its supply falls to `to_pa`, whatever is commanded
    restart   its clock and its settings begin anew; it takes no time
    """

    kind: Literal["drop", "freeze", "jump", "drift", "nan", "supply", "restart"]
    at_s: NonNegative
    over_s: NonNegative = math.inf
    by_m: float = 0.0
    to_pa: NonNegative | None = None

    @model_validator(mode="after")
    def _says_what_its_kind_needs(self) -> Self:
        if (self.kind in ("jump", "drift")) != (self.by_m != 0.0):
            raise ValueError("by_m, other than 0, belongs with kind 'jump' or 'drift' and with no other")
        if (self.kind == "supply") != (self.to_pa is not None):
            raise ValueError("to_pa belongs with kind 'supply' and with no other")
        if self.kind == "drift" and self.over_s == math.inf:
            raise ValueError("over_s: a drift has an end")
        if self.kind == "restart" and self.over_s != math.inf:
            raise ValueError("over_s: a restart takes no time")
        return self


class SlaveFile(Schema):
    """A whole slave file. `valve` is a path from this file's folder, or the name of a shipped valve."""

    valve: str = "seed"
    actuator: Actuator = "spring_return"
    action: ActionWord = "air_to_open"
    """Its position transmitter counts from the closed end, where `initial` has the stem as pressure drives it."""
    bus: AnyBus = ModbusTcpBus()
    clock: SlaveClock = SlaveClock()
    sensor: Sensor = Sensor()
    initial: Initial = Initial()
    supply: Supply = Supply()
    communication: CommunicationTimeout = CommunicationTimeout()
    change: Many[Change] = ()
    fault: Many[DeviceFault] = ()

    @model_validator(mode="after")
    def _bus_can_show_its_faults(self) -> Self:
        shown = {each.kind for each in self.fault} & {"drop", "restart"}
        if self.bus.kind == "canopen" and shown:
            raise ValueError(f"fault: {', '.join(sorted(shown))} is for Modbus; on CANopen: freeze, jump")
        return self


def load_slave(path: Path) -> SlaveFile:
    """Read a slave file.

    Raises:
        InputError: names file, key, value and what is allowed.
    """
    tables = read_toml(path)
    require_kind(tables, "slave", str(path))
    if _turns(tables.get("valve"), path):
        require_degrees(tables.get("bus"), str(path), "bus")
        tables = in_si(tables, str(path))
    return validate(SlaveFile, tables, str(path), path.parent)


def _turns(valve: object, path: Path) -> bool:
    """Return whether the valve that a slave file names, if there is one, is a rotary valve."""
    name = str(valve)
    file = path.parent / name if name.endswith(".toml") else SHIPPED / "valves" / f"{name}.toml"
    drive = read_toml(file).get("drive") if file.is_file() else None
    return isinstance(drive, dict) and drive.get("kind") == ROTARY.name


def valve_path(slave: SlaveFile, path: Path) -> Path:
    """Return the valve file that a slave file at `path` names.

    Raises:
        InputError: neither a file beside it nor a shipped valve.
    """
    beside = path.parent / slave.valve
    if slave.valve.endswith(".toml"):
        if not beside.is_file():
            raise InputError(str(path), f"valve: no file {slave.valve!r} beside it")
        return beside
    return shipped_valve(slave.valve)
