"""Health of a virtual valve, as the DCS sees it: baseline, ageing friction, wear, NE 107 with its cause."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
from pymodbus.constants import ExcCodes

from config.codes import Fault, InhibitReason, Mode, Ne107Cause, Ne107Status, State
from config.daemon_file import DaemonFile, HealthTable
from config.registers import BY_NAME
from config.slave_file import SlaveFile
from config.supervision_table import SupervisionTable
from config.travel import Travel
from config.valve_file import load_valve, shipped_valve
from fieldbus.modbus.function_codes import RegisterError
from northbound.observer.register_words import ne107_causes
from positioner.control.controller_memory import Decision
from positioner.control.requests import Requests
from positioner.control.sample import Sample
from positioner.control.travel.cutoffs import LOW
from positioner.daemon.alarms.alarm_list import AlarmList
from positioner.daemon.health import Health, HealthKeeper, StoredHealth, ne107_condition
from positioner.daemon.health.ne107 import Ne107Condition
from positioner.daemon.health.valve_health import HealthSettings
from positioner.daemon.supervisory_registers import SupervisoryRegisters
from positioner.estimation.acceptance import Applied, Ratios
from positioner.virtual.virtual_cycle import virtual_cycle
from sim.slave.slave import device_of
from tests.cases import few_always
from tests.daemon.panel import ByName

STROKE_M = 0.1016
LAW = {"b_over_c_pa_per_m": -814e3, "k_over_c_pa": -22e3}
NOISE_M = 1e-5


class Panel(ByName):
    """A daemon on a virtual valve, and its registers by name."""

    def __init__(
        self, law: dict[str, float] | None = None, change: tuple[dict[str, float], ...] = (), **health: float
    ) -> None:
        rest = {"position_m": 0.05, "pressure_pa": 40.7e3}
        tables = {"valve": {"stroke_m": STROKE_M}, "health": health, "control": {"law": "seed"}} | (
            {"law": law} if law else {}
        )
        slave = {"clock": {"mode": "lockstep"}, "initial": rest, "sensor": {"noise_std_m": NOISE_M}, "change": change}
        device = device_of(SlaveFile.model_validate(slave), shipped_valve("seed"))
        self.cycle = virtual_cycle(DaemonFile.model_validate(tables), device, Requests(alpha_pa=70e3, beta_pa=13238.0))
        self.alarms = AlarmList()
        self.registers = SupervisoryRegisters(self.cycle, Travel(STROKE_M), 0.0, 420e3, alarms=self.alarms)
        assert self.cycle.health is not None
        self.health = self.cycle.health

    def set_all(self, values: Mapping[str, float]) -> None:
        words = [word for name, value in values.items() for word in BY_NAME[name].format.encode(value)]
        self.registers.write(BY_NAME[next(iter(values))].address, words, "test")

    def run(self, for_s: float) -> None:
        """Let time pass, and look at the end."""
        for _ in range(round(for_s / 1e-3)):
            self.cycle.once()
        self.health.look(self.cycle.snapshot.sample, self.cycle.snapshot.decision, 1e9)

    def go_on_with(self, stored: StoredHealth) -> None:
        """Begin anew with what was kept, look twice at a command that stands, serve every register, and keep it."""
        self.health = self.cycle.health = Health(self.health.settings, stored.kept.record)
        keeper = HealthKeeper(self.health, lambda: self.cycle.snapshot, "FV-1", stored, alarms=self.alarms)
        for _ in range(2):
            keeper.check()
        for name in BY_NAME:
            self.get(name)
        keeper.stop()

    def identify(self) -> None:
        for name in ("eta_1", "eta_2", "eta_3"):
            self.set(name, 0)
        self.run(1.5)
        for name in ("eta_1", "eta_2", "eta_3"):
            self.set(name, 1)
        self.run(0.1)

    def land_below(self) -> None:
        """Move up, down and up: a sine has seen the stem move upward alone."""
        for reference in (0.85, 0.4, 0.6):
            self.set("reference", reference)
            self.run(1.0)

    @property
    def status(self) -> tuple[Ne107Status, Ne107Cause]:
        return Ne107Status(int(self.get("ne107"))), Ne107Cause(int(self.get("ne107_cause")))


def test_from_start_through_identification_to_good() -> None:
    """C while it does not follow the DCS, S while one direction is known, then good; then there is a baseline, too."""
    panel = Panel()
    assert panel.status == (Ne107Status.FUNCTION_CHECK, Ne107Cause.NOT_AUTOMATIC)
    panel.set("mode", Mode.AUTOMATIC)
    panel.run(0.1)
    assert panel.status == (Ne107Status.FUNCTION_CHECK, Ne107Cause.NOT_IDENTIFIED)
    for name in ("eta_1", "eta_2", "eta_3"):
        panel.set(name, 0)
    panel.run(0.1)
    assert panel.status == (Ne107Status.FUNCTION_CHECK, Ne107Cause.EXCITED)
    panel.identify()
    assert panel.get("identifications") == 1
    assert panel.status == (Ne107Status.OUT_OF_SPECIFICATION, Ne107Cause.ONE_DIRECTION)
    panel.land_below()
    assert panel.status == (Ne107Status.GOOD, Ne107Cause.NONE)
    seed = load_valve(shipped_valve("seed")).valve
    assert panel.get("friction_baseline") == pytest.approx(seed.coulomb_n / seed.diaphragm_area_m2, rel=0.05)
    assert panel.get("friction_ratio") == 1.0


def test_a_move_that_ends_eight_percent_off_is_not_good() -> None:
    """Friction typed too small by so much: the seed's law stops short, and has nothing to say of it."""
    short_pa = 0.08 * STROKE_M * -LAW["b_over_c_pa_per_m"]
    panel = Panel(LAW | {"k_over_c_pa": LAW["k_over_c_pa"] + short_pa})
    panel.set("mode", Mode.AUTOMATIC)
    panel.set("reference", 0.8)
    panel.run(3.0)
    assert panel.get("position") == pytest.approx(0.72, abs=0.01)
    assert panel.status == (Ne107Status.OUT_OF_SPECIFICATION, Ne107Cause.TRAVEL_DEVIATION)


@pytest.mark.long
def test_noise_at_rest_wears_nothing_for_a_minute() -> None:
    panel = Panel(LAW)
    panel.set("mode", Mode.AUTOMATIC)
    panel.run(60.0)
    assert {name: panel.get(name) for name in ("travel", "reversals", "stem_cycles", "moves_judged")} == {
        "travel": 0.0,
        "reversals": 0.0,
        "stem_cycles": 0.0,
        "moves_judged": 0.0,
    }


def test_moves_add_up_to_travel_reversals_and_stiction() -> None:
    """The seed's law makes large moves and none of 1 % from rest."""
    panel = Panel(LAW, settle_s=0.3, stiction_limit=0.2)
    panel.set("mode", Mode.AUTOMATIC)
    panel.run(2.0)
    for reference in (0.8, 0.3, 0.8, 0.3):
        panel.set("reference", reference)
        panel.run(0.5)
    assert panel.get("travel") == pytest.approx((0.8 - 0.05 / STROKE_M) + 3 * 0.5, abs=0.05)
    assert panel.get("reversals") == 3
    assert panel.get("stem_cycles") == int(panel.get("travel") / 2)
    assert (panel.get("stiction_index"), panel.get("moves_judged")) == (0.0, 4)
    for small in range(20):
        panel.set("reference", 0.31 + 0.01 * (small % 2) * 1.2 + 0.0)
        panel.run(0.5)
    assert panel.get("stiction_index") == pytest.approx(0.837, abs=0.01)
    assert panel.status == (Ne107Status.MAINTENANCE_REQUIRED, Ne107Cause.STICTION)
    panel.set("health_reset", 1)
    panel.run(0.01)
    assert [panel.get(name) for name in ("travel", "reversals", "stiction_index", "moves_judged")] == [0, 0, 0, 0]
    assert panel.status == (Ne107Status.GOOD, Ne107Cause.NONE)


@pytest.mark.parametrize(
    ("factor", "alpha_pa", "cause"),
    few_always(
        [
            (1.7, 100e3, Ne107Cause.FRICTION_HIGH),
            (0.4, 70e3, Ne107Cause.FRICTION_LOW),
            (1.2, 90e3, Ne107Cause.NONE),
        ]
    ),
)
def test_a_packing_that_ages_is_found_by_the_next_identification(
    factor: float, alpha_pa: float, cause: Ne107Cause
) -> None:
    seed = load_valve(shipped_valve("seed")).valve
    aged = {"at_s": 3.6, "coulomb_n": factor * seed.coulomb_n, "static_n": factor * seed.static_n}
    panel = Panel(change=(aged,))
    panel.set("mode", Mode.AUTOMATIC)
    panel.identify()
    panel.land_below()
    assert panel.status == (Ne107Status.GOOD, Ne107Cause.NONE)
    panel.set("alpha", alpha_pa)
    panel.identify()
    assert panel.get("identifications") == 2
    assert panel.get("friction_ratio") == pytest.approx(factor, rel=0.1)
    assert panel.status[1] is cause


def test_the_engineer_sets_the_baseline_and_not_before_there_is_friction() -> None:
    panel = Panel()
    with pytest.raises(RegisterError) as refused:
        panel.set("health_baseline", 1)
    assert refused.value.code is ExcCodes.DEVICE_BUSY
    panel = Panel(LAW)
    panel.run(0.01)
    assert panel.get("friction_baseline") != panel.get("friction_baseline"), "a number from a file is no baseline"
    panel.set("health_baseline", 1)
    panel.run(0.01)
    assert panel.get("friction_baseline") == pytest.approx(22e3)


Change = Callable[[Requests], Requests]


def with_friction(panel: Panel, ratio: float) -> Health:
    """The panel's health once an identification has found friction of so many times the baseline."""
    decision = panel.cycle.snapshot.decision
    for count, factor in enumerate((1.0, ratio), start=1):
        applied = Applied(Ratios(-814e3, -22e3 * factor), count)
        panel.health.enter(panel.cycle.snapshot.sample, decision._replace(applied=applied), panel.cycle.requests)
    panel.health.look(panel.cycle.snapshot.sample, decision, 1e9)
    return panel.health


@pytest.mark.parametrize(
    ("ratio", "causes"),
    [
        (1.49, ()),
        (5.0, (Ne107Cause.FRICTION_HIGH,)),
        (0.51, ()),
        (0.2, (Ne107Cause.FRICTION_LOW,)),
    ],
)
def test_friction_far_from_its_baseline_asks_for_maintenance(ratio: float, causes: tuple[Ne107Cause, ...]) -> None:
    panel = Panel(LAW)
    panel.set("mode", Mode.AUTOMATIC)
    panel.run(0.01)
    decision = panel.cycle.snapshot.decision._replace(inhibit_reason=InhibitReason.NO_MOVE_ASKED)
    assert ne107_condition(decision, with_friction(panel, ratio)).causes == causes


def test_the_worst_class_decides_and_every_cause_is_told() -> None:
    panel = Panel(LAW)
    health = with_friction(panel, 5.0)
    decision = panel.cycle.snapshot.decision._replace(
        mode=Mode.HOLD, fault=Fault.NO_REPLY, inhibit_reason=InhibitReason.NOT_AUTOMATIC
    )
    now = ne107_condition(decision, health)
    assert (now.status, now.cause) == (Ne107Status.FAILURE, Ne107Cause.FAULT)
    assert now.causes == (Ne107Cause.FAULT, Ne107Cause.NOT_AUTOMATIC, Ne107Cause.FRICTION_HIGH)
    assert now.bits == 0b10000011


@pytest.mark.parametrize(
    ("fault", "inhibit_reason", "status", "cause"),
    [
        (Fault.DEVICE, InhibitReason.NOT_AUTOMATIC, Ne107Status.FAILURE, Ne107Cause.FAULT),
        (Fault.DCS_SILENT, InhibitReason.NOT_AUTOMATIC, Ne107Status.OUT_OF_SPECIFICATION, Ne107Cause.DCS_SILENT),
        (Fault.NONE, InhibitReason.LAW_BEYOND_LIMITS, Ne107Status.OUT_OF_SPECIFICATION, Ne107Cause.BEYOND_LIMITS),
        (Fault.NONE, InhibitReason.STUCK, Ne107Status.OUT_OF_SPECIFICATION, Ne107Cause.STUCK),
    ],
)
def test_the_class_of_each_fault(
    fault: Fault, inhibit_reason: InhibitReason, status: Ne107Status, cause: Ne107Cause
) -> None:
    panel = Panel(LAW)
    mode = Mode.HOLD if fault else Mode.AUTOMATIC
    decision = panel.cycle.snapshot.decision._replace(mode=mode, fault=fault, inhibit_reason=inhibit_reason)
    now = ne107_condition(decision, Health.idle(STROKE_M))
    assert (now.status, now.cause) == (status, cause)


def in_automatic() -> tuple[Panel, Sample, Decision]:
    """Return a panel of a valve in automatic, its sample and what was decided on it."""
    panel = Panel(LAW)
    panel.set("mode", Mode.AUTOMATIC)
    panel.run(0.01)
    return panel, panel.cycle.snapshot.sample, panel.cycle.snapshot.decision


@pytest.mark.parametrize("reason", [InhibitReason.TRIM_ENDED, InhibitReason.EXCURSION_BEYOND_LIMIT])
@pytest.mark.parametrize(("away", "causes"), [(0.006, (Ne107Cause.TRAVEL_DEVIATION,)), (0.004, ())])
def test_a_move_given_up_away_from_its_reference_is_out_of_specification(
    reason: InhibitReason, away: float, causes: tuple[Ne107Cause, ...]
) -> None:
    """It was good, with the stem 7 % away."""
    panel, sample, decision = in_automatic()
    decision = decision._replace(inhibit_reason=reason, reference_m=sample.position_m + away * STROKE_M)
    panel.health.enter(sample, decision, panel.cycle.requests)
    assert ne107_condition(decision, panel.health).causes == causes


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize(("away", "missed"), [(0.05, False), (0.075, True), (-0.075, True), (0.2, True)])
def test_a_stem_that_stands_6_percent_away_is_never_good_whatever_the_law_says(
    away: float, missed: bool, noise: float
) -> None:
    panel, sample, decision = in_automatic()
    reference_m = sample.position_m + away * STROKE_M
    rng = np.random.default_rng(1)
    for number in range(3000):
        shown_m = sample.position_m + noise * STROKE_M * rng.uniform(-1.0, 1.0)
        now = sample._replace(now_s=sample.now_s + 1e-3 * number, position_m=shown_m)
        panel.health.enter(now, decision._replace(reference_m=reference_m), panel.cycle.requests)
    for reason in InhibitReason:
        of_it = decision._replace(reference_m=reference_m, inhibit_reason=reason)
        assert (Ne107Cause.TRAVEL_DEVIATION in ne107_condition(of_it, panel.health).causes) >= missed, reason
        assert ne107_condition(of_it, panel.health).status is not Ne107Status.GOOD or not missed, reason
    silent = decision._replace(reference_m=reference_m, inhibit_reason=InhibitReason.NOTHING)
    assert (ne107_condition(silent, panel.health).status is Ne107Status.GOOD) == (not missed)


@pytest.mark.parametrize(("state", "mode"), [(State.S3_IDENTIFY, Mode.AUTOMATIC), (State.S0_START, Mode.MANUAL)])
def test_a_stem_that_was_held_elsewhere_on_purpose_has_not_been_left_there(state: State, mode: Mode) -> None:
    """A test ended, and "away from the reference" was latched though the law had commanded for one cycle."""
    panel, sample, decision = in_automatic()
    away = decision._replace(reference_m=sample.position_m + 0.5 * STROKE_M)
    for number in range(3000):
        now = sample._replace(now_s=sample.now_s + 1e-3 * number)
        panel.health.enter(now, away._replace(state=state, mode=mode), panel.cycle.requests)
    panel.health.enter(now._replace(now_s=now.now_s + 1e-3), away, panel.cycle.requests)
    assert ne107_condition(away, panel.health).causes == ()


@pytest.mark.parametrize(
    ("passed_s", "stem", "causes"),
    [
        (2.0, 0.05, (Ne107Cause.TRAVEL_DEVIATION,)),
        (0.5, 0.05, ()),
        (2.0, 0.0, ()),
    ],
    ids=["it stays open", "on its way", "on its seat"],
)
def test_a_stem_that_does_not_go_onto_its_stop_is_out_of_specification(
    passed_s: float, stem: float, causes: tuple[Ne107Cause, ...]
) -> None:
    panel, sample, decision = in_automatic()
    shut = decision._replace(inhibit_reason=InhibitReason.CUT_OFF, reference_m=0.009 * STROKE_M, cut_off=LOW)
    for now_s in (sample.now_s, sample.now_s + passed_s):
        panel.health.enter(sample._replace(now_s=now_s, position_m=stem * STROKE_M), shut, panel.cycle.requests)
    assert ne107_condition(shut, panel.health).causes == causes


def test_an_overrun_is_told_as_itself_beyond_the_sixteenth_cause() -> None:
    """The first word is full: all its bits were set where cause 17 held."""
    panel = Panel(LAW)
    snapshot = panel.cycle.snapshot
    panel.cycle.snapshot = snapshot._replace(decision=snapshot.decision._replace(alarms=(Fault.OVERRUN,)))
    low, high = panel.get("ne107_causes"), panel.get("ne107_causes_high")
    assert ne107_causes(low, high) == ["not automatic", Ne107Cause.OVERRUN.text]


@pytest.mark.parametrize(
    ("table", "fault", "cause"),
    [
        ("sample_age", Fault.STALE, Ne107Cause.FAULT),
        ("plausibility", Fault.IMPLAUSIBLE, Ne107Cause.FAULT),
        ("heartbeat", Fault.DCS_SILENT, Ne107Cause.DCS_SILENT),
        ("command_rate", Fault.COMMAND_RATE, Ne107Cause.COMMAND_RATE),
    ],
)
def test_the_file_says_the_class_of_what_is_watched(table: str, fault: Fault, cause: Ne107Cause) -> None:
    supervision = SupervisionTable.model_validate({table: {"ne107": "M"}})
    health = Health(HealthSettings.of(HealthTable(), STROKE_M, supervision))
    decision = Panel(LAW).cycle.snapshot.decision._replace(mode=Mode.AUTOMATIC, fault=fault)
    assert ne107_condition(decision, health) == Ne107Condition((cause,), Ne107Status.MAINTENANCE_REQUIRED)
    other = decision._replace(fault=Fault.DEVICE)
    assert ne107_condition(other, health).status is Ne107Status.FAILURE


def test_limits_of_travel_and_reversals_of_0_are_none() -> None:
    panel = Panel(LAW, travel_limit_strokes=0.5, reversal_limit=1, settle_s=0.3)
    panel.set("mode", Mode.AUTOMATIC)
    panel.run(2.0)
    for reference in (0.8, 0.3, 0.8):
        panel.set("reference", reference)
        panel.run(0.3)
    decision = panel.cycle.snapshot.decision
    assert ne107_condition(decision, panel.health).causes == (Ne107Cause.TRAVEL, Ne107Cause.REVERSALS)
    free = Health(replace(panel.health.settings, travel_limit_m=0.0, reversal_limit=0), panel.health.record)
    assert ne107_condition(decision, free).causes == ()
