"""A controller that was started anew: what it knew is used, tested on the first landings, confirmed or dropped."""

from dataclasses import replace
from typing import Any

import pytest

from config.codes import Fault, InhibitReason, Mode, Restored, State
from config.daemon_file import DaemonFile
from config.extended_valve import ExtendedValve
from config.slave_file import SlaveFile
from config.valve_file import ValveFile, load_valve, shipped_valve
from positioner.control.controller import Controller
from positioner.control.controller_memory import Decision
from positioner.control.requests import QUIET, Requests
from positioner.control.sample import Sample
from positioner.control.settings import Settings
from positioner.control.valve_knowledge import ValveKnowledge
from positioner.daemon.cycle import Cycle
from positioner.daemon.memory.known_configuration import changed, conditions_of
from positioner.estimation.acceptance import Ratios
from positioner.virtual.virtual_cycle import run_identification, virtual_cycle
from sim.effect import FINE_STEP_S
from sim.slave.simulated_device import Device
from sim.static_inverse import extended_valve
from sim.valve import Valve

VALVE = load_valve(shipped_valve("seed")).valve
STROKE_M = VALVE.stroke_m
PERIOD_S = 0.02
REST_S = 2.0


def changed_valve(**parameters: float) -> ValveFile:
    """The seed's valve with other parameters; `preload_n` is an effect."""
    preload_n = parameters.pop("preload_n", 0.0)
    effects = [{"name": "preload", "force_n": preload_n}] if preload_n else []
    table = VALVE.model_dump() | {name: getattr(VALVE, name) * factor for name, factor in parameters.items()}
    return ValveFile.model_validate({"valve": table, "effect": effects})


class Bench:
    """A valve on its device, and the controllers that come and go."""

    def __init__(
        self,
        file: ValveFile,
        law: str = "slides",
        seed: int = 1,
        extended: ExtendedValve | None = None,
        held_pa: float = 45e3,
    ) -> None:
        self.daemon = DaemonFile.model_validate(
            {
                "valve": {"stroke_m": STROKE_M},
                "cycle": {"pace": "device", "period_s": PERIOD_S},
                "safety": {"stale_after_s": 4 * PERIOD_S},
                "control": {"law": law},
                "excitation": {"kind": "staircase", "travel_window": (0.3, 0.9)},
            }
        )
        slave = SlaveFile.model_validate(
            {
                "clock": {"mode": "lockstep", "period_s": PERIOD_S},
                "sensor": {"noise_std_m": 1e-5, "quantum_m": STROKE_M / 4096, "seed": seed},
                "initial": {"position_m": 0.5 * STROKE_M, "pressure_pa": held_pa},
            }
        )
        self._settings = Settings.of(self.daemon, extended)
        self.valve = Valve.from_file(file, step_s=FINE_STEP_S)
        self.valve.rest_at(0.5 * STROKE_M, held_pa)
        self._device = Device(self.valve, slave, {})

    def start(self, restored: ValveKnowledge | None = None, mode: Mode = Mode.AUTOMATIC) -> None:
        first = Requests(mode=mode, mode_writes=1)
        self.cycle: Cycle = virtual_cycle(self.daemon, self._device, first, self._settings, restored=restored)

    @property
    def decision(self) -> Decision:
        return self.cycle.snapshot.decision

    def trust(self) -> Restored:
        return self.decision.restoration.trust

    def kept(self) -> ValveKnowledge | None:
        found = self.cycle.controller.knowledge
        return None if found is None else found.aged(self.cycle.snapshot.sample.now_s)

    def ask(self, **values: Any) -> None:
        self.cycle.requests = replace(self.cycle.requests, **values)

    def identify(self) -> None:
        for _ in run_identification(self.cycle, 120.0, wait=False):
            pass
        self.ask(eta=QUIET)
        self.run(0.1)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD_S)):
            self.cycle.once()

    def step_to(self, reference: float, seconds: float = REST_S) -> None:
        self.ask(reference_m=reference * STROKE_M, reference_writes=self.cycle.requests.reference_writes + 1)
        self.run(seconds)


@pytest.fixture(scope="module")
def knowledge() -> ValveKnowledge:
    """What an earlier daemon knew of the seed's valve."""
    bench = Bench(changed_valve())
    bench.start()
    assert bench.kept() is None
    bench.identify()
    for at in (0.6, 0.602, 0.5, 0.55):
        bench.step_to(at)
    found = bench.kept()
    assert found is not None
    return found


def test_a_restart_is_bumpless_and_moves_nothing_until_somebody_asks(knowledge: ValveKnowledge) -> None:
    bench = Bench(changed_valve())
    bench.start(knowledge, Mode.HOLD)
    bench.run(1.0)
    assert bench.decision.applied.ratios == knowledge.ratios
    assert (bench.decision.command_pa, bench.trust()) == (45e3, Restored.PROVISIONAL)
    bench.ask(mode=Mode.AUTOMATIC, mode_writes=2)
    bench.run(1.0)
    assert (bench.decision.command_pa, bench.decision.state) == (45e3, State.S0_START)


def test_the_same_valve_confirms_it_and_lands_at_once(knowledge: ValveKnowledge) -> None:
    bench = Bench(changed_valve())
    bench.start(knowledge)
    seen = []
    for at in (0.6, 0.604, 0.5, 0.497):
        bench.step_to(at)
        assert abs(bench.valve.indicated_m / STROKE_M - at) < 1e-3
        assert bench.decision.inhibit_reason is InhibitReason.NOTHING
        seen.append(bench.trust())
    assert seen[0] is Restored.PROVISIONAL
    assert seen[-1] is Restored.CONFIRMED
    assert bench.kept() is not None


def test_what_is_provisional_is_not_written_over_what_was_kept(knowledge: ValveKnowledge) -> None:
    bench = Bench(changed_valve())
    bench.start(knowledge)
    bench.step_to(0.6)
    assert bench.decision.restoration.ups == 1
    assert bench.kept() is None


CHANGED = {
    "preload": {"preload_n": 600.0},
    "preload, the other way": {"preload_n": -400.0},
    "spring": {"spring_n_per_m": 1.2},
    "spring, softer": {"spring_n_per_m": 0.85},
    "friction": {"coulomb_n": 1.3, "static_n": 1.3},
    "less friction": {"coulomb_n": 0.6, "static_n": 0.6},
}


@pytest.mark.parametrize("law", ["slides", "seed"])
@pytest.mark.parametrize("change", CHANGED.values(), ids=CHANGED.keys())
def test_a_changed_valve_is_dropped_before_a_second_wrong_move(
    knowledge: ValveKnowledge, change: dict[str, float], law: str
) -> None:
    bench = Bench(changed_valve(**change), law)
    bench.start(knowledge)
    bench.run(0.5)
    moves, last_m, references = 0, bench.valve.indicated_m, iter((0.62, 0.5, 0.66, 0.45, 0.7))
    for at in references:
        bench.step_to(at, 0.1)  # a DCS that does not wait for the stem
        for _ in range(round(6.0 / PERIOD_S)):
            before = bench.decision.command_pa
            bench.cycle.once()
            if bench.decision.command_pa != before and abs(bench.valve.indicated_m - last_m) > 5e-3 * STROKE_M:
                moves, last_m = moves + 1, bench.valve.indicated_m
        if bench.trust() is Restored.DROPPED:
            break
    decision = bench.decision
    assert decision.restoration.trust is Restored.DROPPED
    assert moves <= 1
    assert (decision.state, decision.inhibit_reason) == (State.S0_START, InhibitReason.RESTORED_CONTRADICTED)
    assert decision.applied.ratios is None
    held_pa = decision.command_pa
    bench.step_to(next(references, 0.55), 4.0)
    assert bench.decision.command_pa == held_pa
    assert bench.kept() is None


@pytest.mark.parametrize(
    "told", [{"held_pa": 24e3}, {"held_pa": 24e3, "unattended_s": 2.0}], ids=["restarted", "stalled"]
)
def test_what_a_device_did_by_itself_is_no_landing_and_drops_nothing(told: dict[str, float]) -> None:
    """`make kills`: a device that was powered up anew elsewhere had a valid file set aside."""
    known = ValveKnowledge(
        Ratios(-800e3, -20e3), covariance=((2e6, 0.0, 0.0), (0.0, 3e3, 0.0), (0.0, 0.0, 1e-6)), residual_m=2e-5
    )
    file = DaemonFile.model_validate({"valve": {"stroke_m": STROKE_M}})
    controller = Controller(Settings.of(file), 50e3, restored=known)
    requests = Requests(mode=Mode.AUTOMATIC, mode_writes=1, acknowledgements=0)

    def run(position_m: float, **sample: Any) -> Decision:
        for n in range(120):
            now_s = clock[0] = clock[0] + 0.01
            seen = Sample(now_s, now_s, position_m + 1e-6 * (n % 3), controller.command_pa)
            decision = controller.step(seen._replace(**sample) if n == 0 else seen, requests)
        return decision

    clock = [0.0]
    assert run(0.05).restoration.trust is Restored.PROVISIONAL
    requests = replace(requests, reference_m=0.06, reference_writes=1)
    run(0.06)
    requests = replace(requests, reference_m=0.04, reference_writes=2)
    agreed = run(0.04).restoration
    assert (agreed.ups, agreed.downs, agreed.trust) == (1, 1, Restored.PROVISIONAL)
    after = run(0.045, **told)
    assert after.fault in (Fault.RESTARTED, Fault.STALLED)
    assert (after.restoration, after.static_law.landings) == (agreed, 2)


@pytest.mark.parametrize("law", ["slides", "seed", "conventional"])
@pytest.mark.parametrize("changed_first", [Mode.AUTOMATIC, Mode.HOLD])
def test_another_valve_is_not_moved_by_what_is_known_of_this_one(
    knowledge: ValveKnowledge, law: str, changed_first: Mode
) -> None:
    """Half its diaphragm: it rests in mid-travel under 90 kPa. A reference 5 % up would send it to its seat."""
    bench = Bench(changed_valve(diaphragm_area_m2=0.5), law, held_pa=90e3)
    bench.start(knowledge, changed_first)
    bench.run(1.0)
    bench.ask(mode=Mode.AUTOMATIC, mode_writes=2)
    for at in (0.55, 0.5, 0.3):
        bench.step_to(at)
    assert (bench.decision.command_pa, bench.trust()) == (90e3, Restored.DROPPED)
    assert bench.decision.inhibit_reason is InhibitReason.RESTORED_CONTRADICTED
    assert bench.valve.indicated_m == pytest.approx(0.5 * STROKE_M, abs=1e-4 * STROKE_M)


def test_identified_anew_it_is_replaced(knowledge: ValveKnowledge) -> None:
    bench = Bench(changed_valve(preload_n=600.0))
    bench.start(knowledge)
    bench.step_to(0.62, 4.0)
    assert bench.trust() is Restored.DROPPED
    bench.identify()
    assert bench.trust() == Restored.REPLACED
    bench.step_to(0.6)
    assert abs(bench.valve.indicated_m / STROKE_M - 0.6) < 1e-3
    assert bench.kept() is not None


def test_a_reference_waits_for_the_landing_that_is_to_confirm(knowledge: ValveKnowledge) -> None:
    bench = Bench(changed_valve())
    bench.start(knowledge)
    bench.run(1.0)
    bench.step_to(0.62, 0.04)
    bench.step_to(0.7, 0.04)
    assert bench.decision.inhibit_reason is InhibitReason.RESTORED_WAITS
    assert bench.decision.reference_m == pytest.approx(0.62 * STROKE_M)
    bench.run(2.0)
    assert abs(bench.valve.indicated_m / STROKE_M - 0.7) < 1e-3


def hardened(strength_n_per_m3: float) -> ValveFile:
    effect = {"name": "spring_hardening", "cubic_n_per_m3": strength_n_per_m3}
    damped = {**VALVE.model_dump(), "viscous_ns_per_m": 2 * VALVE.viscous_ns_per_m}  # so that it does not swing
    return ValveFile.model_validate({"valve": damped, "effect": [effect]})


Learnt = tuple[ExtendedValve, ValveKnowledge]
LEARNT: dict[tuple[float, ...], Learnt] = {}
"""By its references: what was known before the restart does not hang on what the valve is after it."""


def learnt(told: ValveFile, true: ValveFile, references: tuple[float, ...]) -> Learnt:
    """Return the valve that a law is told of, and what it has learnt of the true one."""
    if references not in LEARNT:
        extended = extended_valve(told, "better.toml")
        bench = Bench(true, extended=extended)
        bench.start()
        for at in references:
            bench.step_to(at)
        kept = bench.kept()
        assert kept is not None
        LEARNT[references] = extended, kept
    return LEARNT[references]


@pytest.mark.parametrize(("true_n_per_m3", "trust"), [(4e6, Restored.CONFIRMED), (3.5e6, Restored.DROPPED)])
def test_what_slides_have_taught_of_an_extended_valve_is_held_against_it(true_n_per_m3: float, trust: Restored) -> None:
    """The straight law of so hard a spring is off by far more than a landing may be: the table must say where."""
    extended, kept = learnt(hardened(4e6), hardened(4e6), (0.6, 0.8, 0.4, 0.45))
    after = Bench(hardened(true_n_per_m3), extended=extended)
    after.start(kept)
    for at in (0.85, 0.3, 0.7):
        after.step_to(at)
    assert after.trust() is trust


@pytest.mark.parametrize(
    ("changed", "trust"),
    [
        ({}, Restored.CONFIRMED),
        ({"spring_n_per_m": 1.2}, Restored.DROPPED),
        ({"coulomb_n": 1.3, "static_n": 1.3}, Restored.DROPPED),
    ],
    ids=["the same", "spring", "friction"],
)
def test_a_table_whose_level_landings_follow_is_no_looser_a_test(changed: dict[str, float], trust: Restored) -> None:
    """Its preload is 600 N off, 11 % of stroke: by so much, three times, the first landings might lie elsewhere."""
    told, true = changed_valve(preload_n=600.0, viscous_ns_per_m=2.0), changed_valve(viscous_ns_per_m=2.0)
    extended, kept = learnt(told, true, (0.6, 0.7, 0.5, 0.65, 0.45, 0.5, 0.4))
    after = Bench(changed_valve(viscous_ns_per_m=2.0, **changed), extended=extended)
    after.start(kept)
    for at in (0.65, 0.45, 0.6, 0.5):
        after.step_to(at)
    assert after.trust() is trust


def test_another_extended_valve_is_another_condition() -> None:
    file = Bench(hardened(4e6)).daemon
    bare, one, other = (
        conditions_of(file, extended)
        for extended in (None, *(extended_valve(hardened(each), "better.toml") for each in (4e6, 4.1e6)))
    )
    assert changed(bare, bare) is None
    assert str(changed(one, other)).startswith("the file of law.valve")
    assert str(changed(bare, one)).startswith("the file of law.valve")
