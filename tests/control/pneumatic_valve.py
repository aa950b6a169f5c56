"""A pneumatic valve of these tests' own under the daemon's law: behind an I/P, whose supply may fall."""

from collections.abc import Callable
from copy import deepcopy
from functools import cache

from config.codes import State
from config.daemon_file import DaemonFile
from tests.control.virtual_loop import VirtualLoop

STROKE_M, AREA_M2, SPRING_N_PER_M, PRELOAD_N, COULOMB_N, STATIC_N = 0.04, 0.07, 140e3, 1400.0, 400.0, 480.0
LAG_S, VISCOUS_NS_PER_M, PERIOD_S, SUBSTEP_S, QUANTUM_M = 0.05, 2100.0, 0.1, 2e-3, 2.5e-6
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
            before_pa = self.actuator_pa
            self.actuator_pa += (min(command_pa, self.supply_pa) - before_pa) * SUBSTEP_S / LAG_S
            force_n = AREA_M2 * self.actuator_pa - PRELOAD_N - SPRING_N_PER_M * self.stem_m
            sense = 1 if force_n > 0 else -1
            slides = abs(force_n) > (COULOMB_N if self.moving == sense else STATIC_N)
            self.moving = sense if slides else 0
            speed = (force_n - sense * COULOMB_N) / VISCOUS_NS_PER_M if slides else 0.0
            self.stem_m = min(max(self.stem_m + speed * SUBSTEP_S, 0.0), STROKE_M)
            if not slides and self.actuator_pa == before_pa:
                break  # it stands until another command
        self.position_m = QUANTUM_M * round(self.stem_m / QUANTUM_M)
        self.pressure_pa = self.measured(self.actuator_pa)


class Loop(VirtualLoop):
    """The valve under the daemon's own law."""

    def __init__(
        self, measured: Callable[[float], float] = lambda actuator_pa: actuator_pa, law: str = "slides"
    ) -> None:
        file = DaemonFile.model_validate(
            {
                "valve": {"stroke_m": STROKE_M},
                "cycle": {"pace": "device", "period_s": PERIOD_S},
                "pressure": {"maximum_pa": 140e3},
                "safety": {"stale_after_s": 4 * PERIOD_S},
                "control": {"law": law},
                "excitation": {"kind": "staircase"},
            }
        )
        self.valve = PneumaticValve(measured)
        super().__init__(file, self.valve)

    def identified(self) -> "Loop":
        self.begin()
        self.cycles(PERIOD_S)
        while self.decision.progress < 1.0 and self.decision.state is State.S3_IDENTIFY:
            self.cycles(PERIOD_S)
        self.end()
        assert self.decision.applied.ratios is not None
        return self

    def step_to(self, reference_pu: float, for_s: float) -> float:
        """Return the error in the end, as a share of the stroke."""
        self.refer_to(reference_pu, for_s)
        return self.error_at(reference_pu)

    def error_at(self, reference_pu: float) -> float:
        return self.valve.stem_m / STROKE_M - reference_pu


def identified(law: str = "slides") -> Loop:
    """Return a loop of one's own; the one that it is copied from is identified once."""
    return deepcopy(_identified(law))


@cache
def _identified(law: str) -> Loop:
    return Loop(law=law).identified()
