"""The supervisory registers: what the DCS reads of the last snapshot, and what its writes ask for.

A request is all or nothing: every value in it is checked before the first is taken. A write that is refused gets a
Modbus exception and one line in the log, and changes nothing:

    2  no such register, a read-only one, or a part of a value
    3  a value outside its range
    6  a value that cannot be taken now (a fault is latched), or the local switch locks out

The cycle thread is never waited for, nor made to wait: it reads `Cycle.requests` once a cycle, and every write
replaces that snapshot whole.
"""

import logging
import math
import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from operator import attrgetter

from pymodbus.constants import ExcCodes

from config.alarm_table import AlarmsTable
from config.codes import Fault, Mode, ServiceState
from config.registers import (
    ALARMS,
    BY_NAME,
    ESTIMATED,
    EXPERIMENT,
    FLOAT_TEST,
    JITTER_BOUNDS_S,
    LONG_TEST,
    MAP_VERSION,
    REGISTERS,
    REQUESTERS,
    SIZE,
    WORD_TEST,
    Register,
)
from config.travel import Travel
from fieldbus.modbus.function_codes import RegisterError, Table
from fieldbus.modbus.request_counts import RequestCounts
from positioner.control.controller_memory import Decision
from positioner.control.requests import Requests
from positioner.control.travel.signal_path import SignalPath
from positioner.daemon.alarms.alarm_list import AlarmList
from positioner.daemon.alarms.alarm_registers import alarm_getters, obey, require_alarm
from positioner.daemon.backoff import LinesPerPeer
from positioner.daemon.cycle import Cycle
from positioner.daemon.cycle_statistics import CycleStatistics
from positioner.daemon.experiment_registers import WriteRejected, experiment_asked, experiment_getters
from positioner.daemon.health import Health, ne107_condition
from positioner.daemon.health.daily_figures import end_trend
from positioner.daemon.local_switch import require_let_in
from positioner.daemon.logs import log_event, logging_valve
from positioner.daemon.service_state import state_by_mode
from positioner.daemon.site_registers import event_getters, site_getters
from positioner.daemon.snapshot import Snapshot

log = logging.getLogger(__name__)

AT = {address: register for register in REGISTERS for address in range(register.address, register.end)}
"""The register that each word belongs to."""

EXPERIMENT_NAMES = frozenset(register.name for register in EXPERIMENT)

SCALE = 10_000
"""Whole numbers per p.u. in the scaled registers."""


class SupervisoryRegisters:
    """The registers of one valve, by its name in the log. `maximum_pa` and `minimum_pa` bound the manual pressure."""

    def __init__(
        self,
        cycle: Cycle,
        travel: Travel,
        minimum_pa: float,
        maximum_pa: float,
        valve: str | None = None,
        state: Callable[[Decision], ServiceState] = state_by_mode,
        requests: RequestCounts | None = None,
        locked: Callable[[], bool] = lambda: False,
        path: SignalPath | None = None,
        alarms: AlarmList | None = None,
    ) -> None:
        self._cycle = cycle
        self._valve = valve
        self._travel = travel
        self._path = path or SignalPath()
        self._alarms = alarms or AlarmList()
        self._minimum_pa = minimum_pa
        self._maximum_pa = maximum_pa
        self._heartbeat = 0
        self._lines = LinesPerPeer()
        self._values = _getters(cycle, travel, self._path) | {"service": lambda s, _: state(s.decision)}
        self._values |= alarm_getters(self._alarms)
        self._values |= site_getters(requests or RequestCounts(), locked)
        self._locked = locked

    def read(self, table: Table, address: int, count: int) -> Sequence[int]:  # noqa: ARG002 - both tables are the same
        """Return words of one snapshot; addresses between registers read 0.

        Raises:
            RegisterError: ILLEGAL_ADDRESS, beyond the map.
        """
        if address + count > SIZE:
            raise RegisterError(ExcCodes.ILLEGAL_ADDRESS)
        snapshot, requests = _as_of_now(self._cycle), self._cycle.requests
        words = [0] * count
        for register in dict.fromkeys(AT[each] for each in range(address, address + count) if each in AT):
            encoded = self._encoded(register, snapshot, requests)
            for offset, word in enumerate(encoded, start=register.address - address):
                if 0 <= offset < count:
                    words[offset] = word
        return words

    def write(self, address: int, words: Sequence[int], peer: str) -> None:
        """Take what is written, all or nothing.

        Raises:
            RegisterError: see the head of this module.
        """
        with logging_valve(self._valve):
            try:
                values = self._decoded(address, words)
                require_let_in(values, self._locked)
                require_alarm(values, self._longest_shelved_s)
                self._cycle.requests = self._requested(values)
                obey(values, self._alarms)
            except WriteRejected as rejected:
                self._say(logging.WARNING, "write refused", peer, address=address, reason=rejected.reason)
                if self._cycle.history is not None:
                    self._cycle.history.refused(peer, rejected.reason)
                raise RegisterError(rejected.code) from None
            level = logging.DEBUG if values.keys() <= {"reference", "reference_scaled", "heartbeat"} else logging.INFO
            self._say(level, "write", peer, **values)
            if self._cycle.history is not None:
                self._cycle.history.wrote(peer, values)

    @property
    def _longest_shelved_s(self) -> float:
        health = self._cycle.health
        return AlarmsTable().shelve_limit_s if health is None else health.settings.alarms.shelve_limit_s

    def _say(self, level: int, event: str, peer: str, **fields: object) -> None:
        """Log what a peer did; of much, some, with how many lines of its host were passed over before."""
        if not log.isEnabledFor(level):
            return
        passed = self._lines.unsaid(peer, time.monotonic())
        if passed is not None:
            log_event(log, level, event, peer=peer, **fields, **({"times_unsaid": passed} if passed else {}))

    def _encoded(self, register: Register, snapshot: Snapshot, requests: Requests) -> list[int]:
        if register.name == "heartbeat":
            return [self._heartbeat]
        value = self._values[register.name](snapshot, requests)
        if register.format.is_float:
            return register.format.encode(value)
        low, high = (-32768, 32767) if register.type == "int16" else (0, (1 << 16 * register.format.words) - 1)
        return register.format.encode(round(min(max(value, low), high)) if math.isfinite(value) else 0)

    def _decoded(self, address: int, words: Sequence[int]) -> dict[str, float]:
        """Return the values written, by name, in the order of their addresses."""
        values: dict[str, float] = {}
        at, end = address, address + len(words)
        while at < end:
            register = AT.get(at)
            if register is None or register.access == "r":
                raise WriteRejected(
                    f"{register.name if register else at}: nothing to write there", ExcCodes.ILLEGAL_ADDRESS
                )
            if register.address != at or register.end > end:
                raise WriteRejected(f"{register.name}: takes {register.format.words} words", ExcCodes.ILLEGAL_ADDRESS)
            value = register.format.decode(words[at - address : register.end - address])
            if problem := register.problem_with(value):
                raise WriteRejected(problem)
            values[register.name] = value
            at = register.end
        return values

    def _requested(self, values: Mapping[str, float]) -> Requests:
        """Return what is asked for after these writes."""
        requests = self._cycle.requests
        if {"reference", "reference_scaled"} & values.keys():
            signal = _signal(values)
            requests = replace(
                requests,
                signal=signal,
                reference_m=self._travel.stem_m(self._path.opening(signal)),
                reference_writes=requests.reference_writes + 1,
            )
        if "mode" in values:
            requests = replace(requests, mode=self._mode(values["mode"]), mode_writes=requests.mode_writes + 1)
        if {"eta_1", "eta_2", "eta_3"} & values.keys():
            eta_1, eta_2, eta_3 = (
                int(values.get(f"eta_{each}", now)) for each, now in enumerate(requests.eta, start=1)
            )
            requests = replace(requests, eta=(eta_1, eta_2, eta_3))
        if "manual_pressure" in values:
            requests = replace(
                requests,
                manual_pa=self._manual_pa(values["manual_pressure"]),
                manual_writes=requests.manual_writes + 1,
            )
        if values.get("acknowledge") == 1:
            requests = replace(requests, acknowledgements=requests.acknowledgements + 1)
        if values.get("health_baseline") == 1:
            self._require_friction()
            requests = replace(requests, baseline_writes=requests.baseline_writes + 1)
        if values.get("health_reset") == 1:
            requests = replace(requests, health_resets=requests.health_resets + 1)
        if values.keys() & EXPERIMENT_NAMES:
            requests = replace(
                requests, experiment=experiment_asked(requests.experiment, values, self._travel.stroke_m)
            )
        if "heartbeat" in values:
            self._heartbeat = int(values["heartbeat"])
            requests = replace(requests, heartbeats=requests.heartbeats + 1)
        return replace(
            requests,
            alpha_pa=values.get("alpha", requests.alpha_pa),
            beta_pa=values.get("beta", requests.beta_pa),
            omega_rad_per_s=values.get("omega", requests.omega_rad_per_s),
        )

    def _mode(self, value: float) -> Mode:
        mode, fault = Mode(int(value)), self._cycle.snapshot.decision.fault
        if mode is not Mode.HOLD and fault is not Fault.NONE:
            raise WriteRejected(f"mode: fault {fault.name} is latched, acknowledge it first", ExcCodes.DEVICE_BUSY)
        return mode

    def _require_friction(self) -> None:
        if self._cycle.snapshot.decision.applied.ratios is None:
            raise WriteRejected("health_baseline: no friction has been identified yet", ExcCodes.DEVICE_BUSY)

    def _manual_pa(self, value: float) -> float:
        if not self._minimum_pa <= value <= self._maximum_pa:
            allowed = f"{self._minimum_pa:g} to {self._maximum_pa:g} Pa"
            raise WriteRejected(f"manual_pressure: allowed is {allowed}, got {value:g}")
        return value


def _signal(values: Mapping[str, float]) -> float:
    """Return the reference as it was written, in one form or in both."""
    scaled = values.get("reference_scaled", math.nan) / SCALE
    reference = values.get("reference", scaled)
    if abs(reference - scaled) > 1 / SCALE:
        raise WriteRejected("reference and reference_scaled disagree in one request")
    return reference


Getter = Callable[[Snapshot, Requests], float]


def _as_of_now(cycle: Cycle) -> Snapshot:
    """Return what the last cycle left. Where none has come since for too long, what the next will find: a stall."""
    snapshot = cycle.snapshot
    stands_still = cycle.since_s(snapshot) > cycle.link.longest_unattended_s
    return snapshot.stalled() if stands_still else snapshot


def _getters(cycle: Cycle, travel: Travel, path: SignalPath) -> dict[str, Getter]:
    """Return, by register, what it serves of a snapshot."""
    getters = {
        **_command_getters(travel, path),
        **_status_getters(cycle, travel, path),
        **_estimate_getters(travel.stroke_m),
        **_statistics_getters(cycle),
        **_identity_getters(),
        **_health_getters(cycle, travel.stroke_m),
        **experiment_getters(travel.stroke_m),
        **event_getters(cycle),
    }
    of_others = {
        "heartbeat",
        "service",
        "locked_out",
        *(each.name for each in ALARMS),
        *(f"requests_{each}" for each in REQUESTERS),
    }
    assert getters.keys() == BY_NAME.keys() - of_others, getters.keys() ^ BY_NAME.keys()
    return getters


def _command_getters(travel: Travel, path: SignalPath) -> dict[str, Getter]:
    def reference(snapshot: Snapshot, requests: Requests) -> float:
        if requests.reference_writes > 0 and requests.signal is not None:
            return requests.signal
        return path.signal(_asked(travel, snapshot, requests))

    return {
        "reference": reference,
        "reference_scaled": lambda s, r: SCALE * reference(s, r),
        "mode": lambda s, _: s.decision.mode,
        "eta_1": lambda _, r: r.eta[0],
        "eta_2": lambda _, r: r.eta[1],
        "eta_3": lambda _, r: r.eta[2],
        "acknowledge": lambda _s, _r: 0,
        "manual_pressure": lambda s, r: r.manual_pa if r.manual_writes else s.decision.command_pa,
        "alpha": lambda _, r: r.alpha_pa,
        "beta": lambda _, r: r.beta_pa,
        "omega": lambda _, r: r.omega_rad_per_s,
    }


def _asked(travel: Travel, snapshot: Snapshot, requests: Requests) -> float:
    """Return the opening that is asked for."""
    return travel.opening(requests.reference_m if requests.reference_writes > 0 else snapshot.decision.reference_m)


def _status_getters(cycle: Cycle, travel: Travel, path: SignalPath) -> dict[str, Getter]:
    return {
        "state": lambda s, _: s.decision.state,
        "fault": lambda s, _: s.decision.fault,
        "quality": lambda s, _: s.sample.quality,
        "why": lambda s, _: s.decision.inhibit_reason,
        "position": lambda s, _: travel.opening(s.sample.position_m),
        "position_scaled": lambda s, _: SCALE * travel.opening(s.sample.position_m),
        "device_status": lambda s, _: s.sample.status,
        "position_m": lambda s, _: math.nan if travel.turns else travel.turned_m(s.sample.position_m),
        "position_deg": lambda s, _: math.degrees(travel.turned_m(s.sample.position_m)) if travel.turns else math.nan,
        "pressure": lambda s, _: s.sample.pressure_pa,
        "command": lambda s, _: s.decision.command_pa,
        "delta_r": lambda s, _: travel.opening_change(s.decision.delta_r_m),
        "sample_age": lambda s, _: s.decision.sample_age_s + cycle.since_s(s),
        "reference_in_force": lambda s, _: travel.opening(s.decision.reference_m),
        "reference_opening": lambda s, r: _asked(travel, s, r),
        "position_signal": lambda s, _: path.signal(travel.opening(s.sample.position_m)),
        "dead_band": lambda s, _: s.decision.dead_band_m / travel.stroke_m,
        "emergency": lambda s, _: s.sample.emergency,
        "restored": lambda s, _: s.decision.restoration.trust,
        "restored_agreed": lambda s, _: s.decision.restoration.ups + s.decision.restoration.downs,
    }


def _estimate_getters(stroke_m: float) -> dict[str, Getter]:
    getters: dict[str, Getter] = {
        "progress": lambda s, _: s.decision.progress,
        "estimate_age": lambda s, _: s.sample.time_s - s.decision.estimates.time_s,
        "b_over_c_applied": lambda s, _: r.b_over_c if (r := s.decision.applied.ratios) else math.nan,
        "k_over_c_applied": lambda s, _: r.k_over_c if (r := s.decision.applied.ratios) else math.nan,
        "sampling": lambda s, _: s.decision.estimates.sampling,
        "offset_applied": lambda s, _: r.offset_pa if (r := s.decision.applied.ratios) else math.nan,
        "landings": lambda s, _: s.decision.static_law.landings,
        "static_residual": lambda s, _: s.decision.static_law.residual_m / stroke_m,
        "identifications": lambda s, _: s.decision.applied.count & 0xFFFF,
        "refusals": lambda s, _: s.decision.applied.refusals & 0xFFFF,
        "refusal": lambda s, _: s.decision.applied.last_refusal,
    }
    for name in (*ESTIMATED, "breakaway"):
        getters |= _estimate_getters_of(name, "estimates", name)
    for name in ("slope", "up", "down"):
        getters |= _estimate_getters_of(f"static_{name}", "static_law", name)
    return getters


def _estimate_getters_of(name: str, found: str, attribute: str) -> dict[str, Getter]:
    """Return the getters of an estimate that is an attribute of what a decision holds under `found`."""
    estimate = attrgetter(f"decision.{found}.{attribute}")
    return {
        f"{name}_e": lambda s, _: estimate(s).value,
        f"{name}_std": lambda s, _: estimate(s).std,
        f"{name}_valid": lambda s, _: estimate(s).valid,
        f"{name}_reason": lambda s, _: estimate(s).reason,
    }


def _statistics_getters(cycle: Cycle) -> dict[str, Getter]:
    statistics, counts = cycle.statistics, cycle.link.counts
    return {
        "cycles": lambda _s, _r: statistics.cycles & 0xFFFFFFFF,
        "missed_periods": lambda _s, _r: statistics.missed_periods,
        "lost_samples": lambda _s, _r: counts.lost_samples,
        "lost_replies": lambda _s, _r: counts.lost_replies,
        "period": lambda _s, _r: statistics.period_s(),
        "jitter_99": lambda _s, _r: statistics.jitter_99_s(),
        "cycle_time": lambda _s, _r: statistics.cycle_time_s(),
        "unrecorded": lambda _s, _r: cycle.recorder.unrecorded if cycle.recorder else 0,
        "jitter_sum": lambda _s, _r: statistics.jitter_sum_us,
        **{f"jitter_within_{name}": _periods_within(statistics, i) for i, name in enumerate(JITTER_BOUNDS_S)},
    }


def _periods_within(statistics: CycleStatistics, bound: int) -> Getter:
    return lambda _s, _r: statistics.periods_within(bound)


def _health_getters(cycle: Cycle, stroke_m: float) -> dict[str, Getter]:
    health = cycle.health or Health.idle(stroke_m)
    operation = health.operation
    return {
        "health_baseline": lambda _s, _r: 0,
        "health_reset": lambda _s, _r: 0,
        "ne107": lambda s, _: ne107_condition(s.decision, health).status,
        "ne107_cause": lambda s, _: ne107_condition(s.decision, health).cause,
        "ne107_causes": lambda s, _: ne107_condition(s.decision, health).bits & 0xFFFF,
        "ne107_causes_high": lambda s, _: ne107_condition(s.decision, health).bits >> 16,
        "friction": lambda _s, _r: health.friction_pa,
        "friction_baseline": lambda _s, _r: health.baseline_pa,
        "friction_ratio": lambda _s, _r: health.friction_ratio,
        "travel": lambda _s, _r: health.record.travel_m / stroke_m,
        "stem_cycles": lambda _s, _r: int(health.record.travel_m / (2 * stroke_m)),
        "reversals": lambda _s, _r: health.record.reversals,
        "stiction_index": lambda _s, _r: health.record.stiction_index,
        "moves_judged": lambda _s, _r: health.record.moves_judged,
        "away_mean": lambda _s, _r: operation.today.away.value,
        "saturated": lambda _s, _r: operation.today.saturated_share,
        "course_deviation": lambda _s, _r: operation.today.course.value,
        "pressure_short": lambda _s, _r: operation.today.short.value,
        "supply_short": lambda _s, _r: operation.today.short_high.value,
        "end_closed": lambda _s, _r: operation.today.shut.value,
        "end_trend": lambda _s, _r: end_trend([each.shut.value for each in operation.days]),
        "exhausted": lambda _s, _r: operation.today.exhausted,
    }


def version_numbers(text: str) -> tuple[float, float, float]:
    """Return major, minor and patch of a version; of "1.0.0rc1", which comes before 1.0.0, these."""
    numbers = re.match(r"(\d+)\.(\d+)\.(\d+)", text)
    assert numbers is not None
    major, minor, patch = map(float, numbers.groups())
    return major, minor, patch


def _identity_getters() -> dict[str, Getter]:
    major, minor, patch = version_numbers(version("positioner"))
    return {
        "map_version": lambda _s, _r: MAP_VERSION,
        "version_major": lambda _s, _r: major,
        "version_minor": lambda _s, _r: minor,
        "version_patch": lambda _s, _r: patch,
        "word_test": lambda _s, _r: WORD_TEST,
        "long_test": lambda _s, _r: LONG_TEST,
        "float_test": lambda _s, _r: FLOAT_TEST,
    }
