"""A pneumatic valve of these tests' own under the daemon's law: behind an I/P, whose supply may fall."""

from collections.abc import Callable
from dataclasses import replace

from config.codes import InhibitReason, Mode
from config.daemon_file import DaemonFile
from positioner.control.requests import QUIET, Requests
from positioner.daemon.health import Health
from positioner.daemon.health.valve_health import HealthSettings
from positioner.virtual.virtual_cycle import virtual_cycle

STROKE_M, AREA_M2, SPRING_N_PER_M, PRELOAD_N, COULOMB_N, STATIC_N = 0.04, 0.07, 140e3, 1400.0, 400.0, 480.0
LAG_S, VISCOUS_NS_PER_M, PERIOD_S, SUBSTEP_S, QUANTUM_M = 0.05, 2100.0, 0.1, 1e-3, 2.5e-6
GOOD_PA = 300e3


class PneumaticValve:
    """A stem without inertia that sticks; behind an I/P whose pressure the supply bounds, and which is measured."""

    sample_counter = 0
    status = 0

    def __init__(self, measured: Callable[[float], float]) -> None:
        self.measured = measured
        self.supply_pa = GOOD_PA
        self.moving = 0
        self.stem_m = self.position_m = 0.5 * STROKE_M
        self.command_pa = self.actuator_pa = self.pressure_pa = (SPRING_N_PER_M * self.stem_m + PRELOAD_N) / AREA_M2

    @property
    def device_time_us(self) -> int:
        return round(1e6 * PERIOD_S * self.sample_counter)

    def tick(self, command_pa: float) -> None:
        self.command_pa = command_pa
        self.sample_counter += 1
        for _ in range(round(PERIOD_S / SUBSTEP_S)):
            self.actuator_pa += (min(command_pa, self.supply_pa) - self.actuator_pa) * SUBSTEP_S / LAG_S
            force_n = AREA_M2 * self.actuator_pa - PRELOAD_N - SPRING_N_PER_M * self.stem_m
            sense = 1 if force_n > 0 else -1
            slides = abs(force_n) > (COULOMB_N if self.moving == sense else STATIC_N)
            self.moving = sense if slides else 0
            speed = (force_n - sense * COULOMB_N) / VISCOUS_NS_PER_M if slides else 0.0
            self.stem_m = min(max(self.stem_m + speed * SUBSTEP_S, 0.0), STROKE_M)
        self.position_m = QUANTUM_M * round(self.stem_m / QUANTUM_M)
        self.pressure_pa = self.measured(self.actuator_pa)


class Loop:
    """The valve under the daemon's own law, in virtual time."""

    def __init__(self, measured: Callable[[float], float] = lambda actuator_pa: actuator_pa) -> None:
        file = DaemonFile.model_validate(
            {
                "valve": {"stroke_m": STROKE_M},
                "cycle": {"pace": "device", "period_s": PERIOD_S},
                "pressure": {"maximum_pa": 140e3},
                "safety": {"stale_after_s": 4 * PERIOD_S},
                "control": {"law": "moves"},
            }
        )
        self.valve = PneumaticValve(measured)
        self.cycle = virtual_cycle(file, self.valve, Requests(mode=Mode.AUTOMATIC, mode_writes=1))
        self.health = Health(HealthSettings.of(file.health, STROKE_M))

    def cycles(self, for_s: float) -> None:
        for _ in range(round(for_s / PERIOD_S)):
            self.cycle.once()

    def begin(self) -> None:
        self.cycle.requests = replace(self.cycle.requests, eta=(0, 0, 0))

    def end(self) -> None:
        self.cycle.requests = replace(self.cycle.requests, eta=QUIET)
        self.cycles(PERIOD_S)

    def identified(self) -> "Loop":
        self.begin()
        self.cycles(200.0)
        self.end()
        assert self.cycle.snapshot.decision.applied.ratios is not None
        return self

    def step_to(self, reference_pu: float, for_s: float) -> float:
        """Return the error in the end, as a share of the stroke."""
        before = self.cycle.requests
        self.cycle.requests = replace(
            before, reference_m=reference_pu * STROKE_M, reference_writes=before.reference_writes + 1
        )
        self.cycles(for_s)
        return self.error_at(reference_pu)

    def error_at(self, reference_pu: float) -> float:
        return self.valve.stem_m / STROKE_M - reference_pu

    @property
    def why(self) -> InhibitReason:
        return self.cycle.snapshot.decision.inhibit_reason
