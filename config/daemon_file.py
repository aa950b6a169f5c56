"""The file of the daemon: `positioner run CONFIG.toml`.

One valve is table `[valve]`, with the other tables beside it. Several are `[[valve]]`, each with a `unit`: the other
tables then say what the valves have in common, and `[valve.device]`, `[valve.safety]` and so on what is this one's,
key by key (save a device on another bus, which has all its keys itself). They share the log and the supervisory server,
where the unit tells them apart.
"""

import math
from collections import Counter
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, IPvAnyNetwork, model_validator

from config.actuators import Actuator
from config.alarm_table import AlarmsTable
from config.bus_plugins import AnyDevice
from config.device import Host, ModbusDevice, ModbusTcpDevice
from config.drive import ROTARY, VALVE, Kind, Scale, as_written, in_si, require_degrees
from config.errors import InputError
from config.file_kinds import require_kind
from config.law_names import DEFAULT_LAW, one_of_the_laws
from config.loading import (
    FolderName,
    Fraction,
    Label,
    Many,
    NearFile,
    NonNegative,
    Pair,
    Positive,
    Pressure,
    Schema,
    Stroke,
    read_toml,
    validate,
    wide,
)
from config.record_tables import HistoryTable, RecorderTable
from config.supervision_table import SafetyTable, SupervisionTable
from config.tls_table import Tls
from config.travel import ActionWord, Travel
from config.travel_table import TravelTable


def _check_network(network: object) -> object:
    if isinstance(network, int | float):  # which would be an address by its number
        raise ValueError("must be the address of a host or a network")
    return network


Network = Annotated[IPvAnyNetwork, BeforeValidator(_check_network)]


class ValveTable(Schema):
    """Table `[valve]`: what the controller must know of the valve before it identifies anything."""

    name: Label = "valve"
    stroke_m: Stroke
    """From end to end; of a rotary valve its travel, rad, which the file has as `travel_deg`."""
    travel_deg: Annotated[float, Field(ge=1, le=3600)] | None = None
    """What a rotary valve turns from end to end: a quarter turn is 90."""
    action: ActionWord = "air_to_open"
    """What more air does; openings count from the closed end (`config.travel`)."""
    actuator: Actuator = "spring_return"
    breakaway_pa: Pressure | None = None
    """F_s / A where it is known: the excitation's constant part must exceed it."""

    @model_validator(mode="before")
    @classmethod
    def _turns_or_goes(cls, table: Any) -> Any:
        if not isinstance(table, dict) or table.get("travel_deg") is None:
            return table
        if "stroke_m" in table:
            raise ValueError("travel_deg is of a valve that turns, stroke_m of one with a stem: allowed is one of them")
        turned = table["travel_deg"]
        known = isinstance(turned, int | float) and not isinstance(turned, bool)
        return table | {"stroke_m": math.radians(turned) if known else 1.0}

    @property
    def kind(self) -> Kind:
        """Its names and units: those of a stem, or of what turns."""
        return VALVE if self.travel_deg is None else ROTARY

    @property
    def length(self) -> str:
        """The key that says its travel."""
        return "stroke_m" if self.travel_deg is None else "travel_deg"

    @property
    def place(self) -> str:
        """The key of a device's map that says where the reading of its position is."""
        return as_written(self.kind, "position_m", 0.0)[0]

    @property
    def plain(self) -> Scale:
        """How a position is read in the units of these files: m, or degrees."""
        return Scale(1.0, "m") if self.travel_deg is None else self.kind.length

    @property
    def travel(self) -> Travel:
        """Where the stem stands at which opening."""
        return Travel(self.stroke_m, self.action == "air_to_close", self.kind.turns)


class CycleTable(Schema):
    """Table `[cycle]`: in real time, or as fast as a device in lockstep answers, on the device's clock."""

    pace: Literal["real_time", "device"] = "real_time"
    period_s: Annotated[float, Field(ge=2e-4, le=10)] = 1e-3
    """Of the loop in real time; a device in lockstep has its own."""
    shadow: bool = False
    """Read the device and never write to it: what would be commanded is served and recorded, not given."""


class PressureTable(Schema):
    """Table `[pressure]`: every command lies between these."""

    minimum_pa: NonNegative = 0.0
    maximum_pa: Pressure = 420e3

    @model_validator(mode="after")
    def _minimum_is_below_maximum(self) -> Self:
        if self.minimum_pa >= self.maximum_pa:
            raise ValueError(f"minimum_pa must be below maximum_pa ({self.maximum_pa:g} Pa)")
        return self


class IdentificationTable(Schema):
    """Table `[identification]`: the window of the algebraic identifier, its derivative filters, the sensors' noise."""

    window_s: Positive = 0.8
    minimum_window_s: Positive = 0.4
    derivative_window_s: Positive = 0.05
    noise_std_m: Positive | None = None
    """Standard deviation of the position sensor's noise; measured at rest where nobody has said."""
    pressure_noise_std_pa: NonNegative = 0.0
    pressure_held: bool = True
    """Whether the pressure is held between samples; false for an actuator that lags: then it runs on linearly."""

    @model_validator(mode="after")
    def _windows_nest(self) -> Self:
        if self.minimum_window_s > self.window_s:
            raise ValueError(f"minimum_window_s must be at most window_s ({self.window_s:g} s)")
        return self


BY_A_SINE = "seed"
"""The law that identifies by a sine, as its paper does, where nobody says; all others by a staircase of slides."""
NARROWEST_WINDOW = 0.2
"""Of the stroke, for a staircase."""
TravelWindow = Annotated[Pair[Fraction], wide(NARROWEST_WINDOW)]
"""Where a test may take the stem, as shares of the stroke."""


class ExcitationTable(Schema):
    """Table `[excitation]`: what S3 applies until the DCS writes otherwise, and how long at the most."""

    alpha_pa: NonNegative = 0.0
    beta_pa: NonNegative = 13238.0
    omega_rad_per_s: Positive = 1.0
    limit_s: Positive = 10.0
    kind: Literal["sine", "staircase"] | None = None
    """A sine for a fast loop, a staircase of slides for any; where nobody says, the law chooses."""
    travel_window: TravelWindow = (0.1, 0.9)
    """Where the staircase may take the stem, as shares of the stroke."""
    staircase_limit_s: Positive = 600.0
    """The staircase ends by itself after this."""
    permitted_travel: TravelWindow | None = None
    """S3 begins inside it and is broken off beyond it, as shares of the stroke; wherever it is where nobody says."""
    consent: bool = False
    """Whether S3 needs register `experiment_consent` beside eta_1 = 0."""


class ExperimentTable(Schema):
    """Table `[experiment]`: what an experiment that the DCS consents to must stay inside."""

    travel_window: TravelWindow = (0.05, 0.95)
    """Beyond it the experiment is broken off, as shares of the stroke; 0 and 1 are the stops themselves."""
    minimum_pa: NonNegative | None = None
    """Those of `[pressure]` where nobody says."""
    maximum_pa: Positive | None = None
    rate_limit_pa_per_s: Positive = 100e3
    limit_s: Positive = 60.0


class LawTable(Schema):
    """Table `[law]`: what the law knows before anything is identified: an extended valve, or an earlier identification.

    Either spares the valve an excitation at a restart. They exclude each other.
    """

    valve: NearFile | None = None
    """A valve file, effects and all, as `positioner extend` writes it: the law works with its static inverse."""
    b_over_c_pa_per_m: Annotated[float, Field(lt=0)] | None = None
    k_over_c_pa: Annotated[float, Field(lt=0)] | None = None
    offset_pa: float = 0.0
    """Of the balance, from a preload or from unlike friction up and down."""

    @model_validator(mode="after")
    def _one_or_the_other(self) -> Self:
        typed = self.model_fields_set - {"valve"}
        if self.valve is not None and typed:
            raise ValueError(f"valve is given, so {min(typed)} must not be: the pressures come from one of them")
        if self.valve is None:
            for key in ("b_over_c_pa_per_m", "k_over_c_pa"):
                if getattr(self, key) is None:
                    raise ValueError(f"{key} is required and missing, unless valve is given")
        return self


LEAST_DEAD_BAND = 5e-4
"""Of the stroke: finer is no use to a loop, and wears the packing."""
EXCURSION_BUDGET = 100.0
"""Strokes a day: a packing that is good for 100 000 of them then lasts three years."""


class ControlTable(Schema):
    """Table `[control]`: which law follows the reference, and what it may do."""

    law: Annotated[str, AfterValidator(one_of_the_laws)] = DEFAULT_LAW
    dead_band: Annotated[float, Field(gt=0, le=0.1)] | Literal["auto"] = LEAST_DEAD_BAND
    """Error at rest that is left alone, as a fraction of the stroke; "auto": by noise and friction as identified."""
    cutoff_low: Annotated[float, Field(gt=0, le=0.25)] | None = None
    """Reference below which the stem is pressed onto its lower stop, as a fraction of the stroke; else it never is."""
    cutoff_high: Annotated[float, Field(ge=0.75, lt=1)] | None = None
    """Reference above which it is pressed onto its upper stop."""
    cutoff_hysteresis: Annotated[float, Field(ge=0, le=0.1)] = 0.005
    """How far the reference must come back from a cut-off before the stem is positioned again."""
    excursion_limit: Fraction = 0.2
    """How far the law of slides may take the stem beyond a small move, as a share of the stroke."""
    excursion_interval_s: NonNegative = 0.0
    """Least time between two such excursions."""
    excursion_budget_strokes_per_day: NonNegative = EXCURSION_BUDGET
    """Travel of the packing that such excursions may cost, beyond that of the moves themselves; 0: no limit."""

    @property
    def least_dead_band(self) -> float:
        """The dead band before anything is identified, as a share of the stroke."""
        return LEAST_DEAD_BAND if self.dead_band == "auto" else self.dead_band


class SupervisoryTable(Schema):
    """Table `[supervisory]`: where the DCS finds the registers. Port 0 takes any free one; the daemon says which."""

    host: Host = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 5502
    unit: Annotated[int, Field(ge=1, le=247)] = 1
    most_clients: Annotated[int, Field(ge=1, le=1000)] = 64
    clients_per_host: Annotated[int, Field(ge=1, le=1000)] = 56
    allowed_networks: Many[Network] = ()
    """Addresses or networks whence clients may come; empty: from anywhere."""
    reserved_hosts: Many[Host] = ()
    """Addresses of the DCS: where all places are taken, another's is made free for them."""
    requests_per_s: NonNegative = 1000.0
    """Of each reserved host, and of all others together, who share it evenly; more wait. 0 is no limit."""
    idle_s: NonNegative = 0.0
    """A client that asks for nothing for so long is disconnected; 0 is never."""
    local_switch: NearFile | None = None
    """While this file is there and does not begin with 0, all writes but heartbeats are refused."""
    tls: Tls | None = None
    """Modbus/TCP Security in place of Modbus TCP; its registered port is 802."""


class HealthTable(Schema):
    """Table `[health]`: what counts as wear, from where on it calls for maintenance, and where its counts are kept.

    A limit of 0 is none.
    """

    folder: FolderName | None = None
    """One small file for each valve there keeps counts and baseline over restarts; without it they begin anew."""
    dead_band: Annotated[float, Field(gt=0, le=0.1)] = 0.005
    """Motion that does not count as travel, as a fraction of the stroke; widened to 12 times the noise."""
    settle_s: Positive = 1.0
    """A reference must stand for so long before the move to it is judged."""
    friction_high: Annotated[float, Field(ge=0)] = 1.5
    """Friction over its baseline, above which the packing is too tight."""
    friction_low: Annotated[float, Field(ge=0, lt=1)] = 0.5
    """Friction over its baseline, below which the packing leaks."""
    stiction_limit: Fraction = 0.5
    travel_limit_strokes: NonNegative = 0.0
    reversal_limit: Annotated[int, Field(ge=0)] = 0

    @model_validator(mode="after")
    def _high_is_above_the_baseline(self) -> Self:
        if 0 < self.friction_high <= 1:
            raise ValueError(f"friction_high must be above 1, or 0 for no limit, got {self.friction_high:g}")
        return self


class MemoryTable(Schema):
    """Table `[memory]`: where what is known of a valve is kept over restarts."""

    folder: FolderName | None = None
    """One small file for each valve there; without it each start knows nothing of the last."""


class LogTable(Schema):
    """Table `[log]`: JSON lines on standard error."""

    level: Literal["debug", "info", "warning", "error"] = "info"


class ServiceTable(Schema):
    """Table `[service]`: the processes of the daemon."""

    processes: Annotated[int, Field(ge=1, le=64)] | None = None
    """Among which the valves are shared; where nobody says, as few as their cycles need, at most one a processor."""


class DaemonFile(Schema):
    """A whole daemon file."""

    valve: ValveTable
    device: AnyDevice = ModbusTcpDevice()
    cycle: CycleTable = CycleTable()
    pressure: PressureTable = PressureTable()
    safety: SafetyTable = SafetyTable()
    supervision: SupervisionTable = SupervisionTable()
    identification: IdentificationTable = IdentificationTable()
    excitation: ExcitationTable = ExcitationTable()
    experiment: ExperimentTable = ExperimentTable()
    law: LawTable | None = None
    control: ControlTable = ControlTable()
    travel: TravelTable = TravelTable()
    supervisory: SupervisoryTable = SupervisoryTable()
    recorder: RecorderTable | None = None
    health: HealthTable = HealthTable()
    alarms: AlarmsTable = AlarmsTable()
    memory: MemoryTable = MemoryTable()
    history: HistoryTable | None = None
    log: LogTable = LogTable()
    service: ServiceTable = ServiceTable()

    @model_validator(mode="after")
    def _safe_pressure_is_known(self) -> Self:
        watched = (getattr(self.supervision, name).action for name in SupervisionTable.model_fields)
        safe_pa = self.safety.safe_pressure_pa
        if "safe" in (self.safety.action, self.safety.heartbeat_action, *watched) and safe_pa is None:
            raise ValueError('safety.safe_pressure_pa is required by the action "safe" and missing')
        if safe_pa is not None and not self.pressure.minimum_pa <= safe_pa <= self.pressure.maximum_pa:
            allowed = f"{self.pressure.minimum_pa:g} to {self.pressure.maximum_pa:g} Pa ([pressure])"
            raise ValueError(f"safety.safe_pressure_pa: allowed is {allowed}, got {safe_pa:g}")
        return self

    @model_validator(mode="after")
    def _device_waits_for_a_cycle(self) -> Self:
        alone_s = self.device.acts_alone_after_s
        if self.cycle.pace == "real_time" and alone_s <= self.cycle.period_s:
            raise ValueError(
                f"device.communication_timeout_s must be more than cycle.period_s ({self.cycle.period_s:g} s), "
                f"or the device acts by itself between two cycles, it is {alone_s:g} s"
            )
        return self

    @model_validator(mode="after")
    def _device_rests_within_a_cycle(self) -> Self:
        pause_s = self.device.pause_s if isinstance(self.device, ModbusDevice) else 0.0
        if self.cycle.pace == "real_time" and pause_s >= self.cycle.period_s:
            raise ValueError(
                f"device.pause_s: allowed is less than cycle.period_s ({self.cycle.period_s:g} s), got {pause_s:g}"
            )
        return self

    @property
    def stale_after_s(self) -> float:
        """After how long a measurement that is not renewed is stale, s: never before so many cycles were lost."""
        return max(self.safety.stale_after_s, self.safety.lost_after_cycles * self.cycle.period_s)

    @property
    def longest_unattended_s(self) -> float:
        """For how long the device may be without a command before the daemon counts as having stood still.

        That is a cycle with all that its exchange may take, late by `safety.stale_after_s`; or the time-out after which
        the device acts by itself, where that is shorter. A device in lockstep waits for ever.
        """
        if self.cycle.pace == "device":
            return math.inf
        exchange_s = max(self.cycle.period_s, self.device.longest_exchange_s)
        return min(exchange_s + self.safety.stale_after_s, self.device.acts_alone_after_s)

    @property
    def samples_after(self) -> bool:
        """Whether a reply shows the pressure of the command that it answers: in lockstep it has obeyed for a period."""
        return self.device.sampling == "after" and self.cycle.pace != "device"

    @property
    def by_slides(self) -> bool:
        """Whether S3 excites by a staircase of slides.

        Where nobody says, all laws but the seed's do: at any period, and whatever the valve has that its model lacks.
        """
        asked = self.excitation.kind or ("sine" if self.control.law == BY_A_SINE else "staircase")
        return asked == "staircase"


SHARED = frozenset({"supervisory", "history", "log", "service"})
"""Tables that the valves of a daemon have together."""
OWN = frozenset(DaemonFile.model_fields) - SHARED - {"valve"}
"""Tables that each valve of several may have for itself."""


def load_daemon(path: Path, valve: str | None = None) -> DaemonFile:
    """Read the file of a daemon and return the valve of that name; without a name, the only one.

    Raises:
        InputError: names file, key, value and what is allowed; or which valves there are.
    """
    files = load_valves(path)
    names = [file.valve.name for file in files]
    if valve is None and len(files) > 1:
        raise InputError(str(path), f"has several valves, say which: {', '.join(names)}")
    if valve is not None and valve not in names:
        raise InputError(str(path), f"valve: allowed are {', '.join(names)}, got {valve}")
    return files[0 if valve is None else names.index(valve)]


def load_valves(path: Path) -> tuple[DaemonFile, ...]:
    """Read the file of a daemon; return each of its valves as if it were alone in it.

    Raises:
        InputError: names file, key, value and what is allowed.
    """
    tables, source = read_toml(path), str(path)
    require_kind(tables, "daemon", source)
    if not tables.get("valve") or not isinstance(tables["valve"], list):
        return (_validate(tables, source, path.parent),)
    numbered = enumerate(tables["valve"], 1)
    each_valve = (_tables_of_one(tables, entry, f"{source}: valve {number}") for number, entry in numbered)
    files = tuple(_validate(each, where, path.parent) for each, where in each_valve)
    if problem := _conflict(files) or find_crowded_line(files):
        raise InputError(source, problem)
    return tuple(_beside_others(file, files) for file in files)


def _validate(tables: dict[str, Any], source: str, folder: Path) -> DaemonFile:
    """Return one valve's file; what a rotary valve has in degrees is in rad inside."""
    valve = tables.get("valve")
    if isinstance(valve, dict) and "travel_deg" in valve:
        require_degrees(tables.get("device"), source, "device")
        tables = {key: table if key == "valve" else in_si(table, source, key) for key, table in tables.items()}
    return validate(DaemonFile, tables, source, folder)


def _tables_of_one(tables: dict[str, Any], entry: Any, where: str) -> tuple[dict[str, Any], str]:
    """Return the tables that would describe this valve alone, and what to call it in a complaint."""
    if not isinstance(entry, dict):
        raise InputError(where, "is not a table")
    where = f"{where} ({entry['name']})" if "name" in entry else where
    allowed = {*ValveTable.model_fields, "unit", *OWN}
    if unknown := entry.keys() - allowed:
        raise InputError(where, f"valve.{min(unknown)}: unknown key; allowed here: {', '.join(sorted(allowed))}")
    for key in ("name", "unit"):
        if key not in entry:
            raise InputError(where, f"valve.{key}: is required and missing")
    own = {key: _merge(tables.get(key, {}), entry[key]) for key in entry.keys() & OWN}
    supervisory = tables.get("supervisory", {})
    if not isinstance(supervisory, dict):
        raise InputError(where, f"supervisory: must be a table, got {supervisory!r}")
    if "unit" in supervisory:
        raise InputError(where, "supervisory.unit: each of several valves has its own unit, in [[valve]]")
    valve = {key: value for key, value in entry.items() if key in ValveTable.model_fields}
    return {**tables, **own, "valve": valve, "supervisory": {**supervisory, "unit": entry["unit"]}}, where


def _merge(common: Any, own: Any) -> Any:
    """Return a table with what is this valve's put over what is everybody's; what is no table is left to the schema."""
    if not isinstance(common, dict) or not isinstance(own, dict):
        return own
    # A device on another bus has nothing in common with the others'.
    return own if own.get("bus") not in (None, common.get("bus", "modbus")) else {**common, **own}


def _conflict(files: Sequence[DaemonFile]) -> str | None:
    """Say which two valves cannot be told apart, or are one."""
    for first, second in combinations(files, 2):
        names = f"{first.valve.name} and {second.valve.name}"
        if first.valve.name == second.valve.name:
            return f"valve.name: two valves have {first.valve.name!r}, allowed is one each"
        if first.supervisory.unit == second.supervisory.unit:
            return f"valve.unit: {names} have {first.supervisory.unit}, allowed is one each"
        if problem := first.device.conflict_with(second.device):
            return f"valve.device: {names} have {problem}, allowed is one each"
    return None


def _beside_others(file: DaemonFile, files: Sequence[DaemonFile]) -> DaemonFile:
    """Return a valve's file that knows whether its device shares a gateway's line with another's."""
    device = file.device
    if not isinstance(device, ModbusTcpDevice) or device.shared_line is not None:
        return file
    shares = sum(device.is_beside(each.device) for each in files) > 1
    return file.model_copy(update={"device": device.model_copy(update={"shared_line": shares})})


def find_crowded_line(files: Sequence[DaemonFile]) -> str | None:
    """Say which valve has too short a cycle for the line that it shares with others.

    Each gets an equal share of the period, so that one that does not answer takes time from nobody but itself.
    """
    users = Counter(file.device.line for file in files)
    for file in files:
        line, exchange_s = file.device.line, file.device.longest_exchange_s
        if line is None or users[line] == 1:
            continue
        if file.cycle != (first := next(each for each in files if each.device.line == line)).cycle:
            return f"{file.valve.name}: cycle must be that of {first.valve.name}, which is on the same line {line}"
        share_s = file.cycle.period_s / users[line]
        if file.cycle.pace == "real_time" and exchange_s > share_s:
            least_s = users[line] * exchange_s
            return (
                f"{file.valve.name}: cycle.period_s must be at least {least_s:.3g} s, for {users[line]} "
                f"valves on line {line} of which each may take {exchange_s:.3g} s, got {file.cycle.period_s:g}"
            )
    return None
