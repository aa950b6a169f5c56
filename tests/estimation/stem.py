"""The seed's valve for the tests of estimation: exact motion between samples, Coulomb friction, sticking."""

from collections.abc import Callable
from dataclasses import dataclass
from math import sin

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

from config.valve_file import load_valve, shipped_valve
from positioner.estimation.estimates import Estimates
from positioner.estimation.online import Identification, IdentificationSettings
from positioner.estimation.refiner import InProcessRefiner, Refinement
from sim.valve import Valve

Array = npt.NDArray[np.float64]

PSI = 6894.757
STROKE = 0.1016
MASS, AREA, SPRING, VISCOUS, COULOMB, STATIC = 1.3608, 0.0645, 52538.0, 612.944, 1423.4, 1708.09
A, B, C, K = -VISCOUS / MASS, -SPRING / MASS, AREA / MASS, -COULOMB / MASS
THETA = np.array([A, B, C])
TRUTH = {"a": A, "b": B, "c": C, "k": K, "b_over_c": B / C, "k_over_c": K / C}
NOISE = 1e-4 * STROKE


def swing(time_s: float) -> float:
    """The seed's excitation from t = 0 on."""
    return PSI * (6.4 + 1.92 * sin(time_s)) if time_s >= 0 else 0.0


@dataclass(frozen=True)
class Run:
    """A sampled motion: `pressure_pa` of a sample held since the one before."""

    time_s: Array
    position_m: Array
    pressure_pa: Array

    def noisy(self, rng: np.random.Generator, std_m: float = NOISE) -> "Run":
        return Run(self.time_s, self.position_m + rng.normal(0, std_m, len(self.time_s)), self.pressure_pa)

    def kept(self, keep: npt.NDArray[np.bool_]) -> "Run":
        return Run(self.time_s[keep], self.position_m[keep], self.pressure_pa[keep])

    def samples(self) -> list[tuple[float, float, float]]:
        return list(zip(self.time_s.tolist(), self.position_m.tolist(), self.pressure_pa.tolist(), strict=True))


def run(pressure: Callable[[float], float], time_s: Array, position_m: float = 0.0, fine_s: float = 5e-5) -> Run:
    """Move the stem from rest under a pressure held from one sample to the next."""
    generator = np.array([[0.0, 1.0, 0.0], [B, A, 1.0], [0.0, 0.0, 0.0]])
    x, v, direction = position_m, 0.0, 0
    positions, pressures = [x], [0.0]
    steps: dict[tuple[int, int], Array] = {}
    for begin, end in zip(time_s[:-1].tolist(), time_s[1:].tolist(), strict=True):
        u = pressure(begin)
        parts = max(1, round((end - begin) / fine_s))
        h = (end - begin) / parts
        key = (parts, round(h * 1e12))
        if key not in steps:
            steps[key] = expm(generator * h)
        (p, q, r), (l, m, n) = steps[key][:2].tolist()  # noqa: E741
        for _ in range(parts):
            force = AREA * u - SPRING * x
            if not direction:
                if abs(force) <= STATIC:
                    continue
                direction = 1 if force > 0 else -1
            w = C * u + K * direction
            x, v = p * x + q * v + r * w, l * x + m * v + n * w
            if v * direction <= 0:
                v, direction = 0.0, 0
        positions.append(x)
        pressures.append(u)
    return Run(time_s, np.array(positions), np.array(pressures))


def grid(period_s: float, begin_s: float, end_s: float) -> Array:
    return np.arange(round(begin_s / period_s), round(end_s / period_s) + 1, dtype=np.float64) * period_s


def identified(
    run: Run, *, parameters: bool = True, friction: bool = True, **settings: float | bool | None
) -> Identification:
    """Put a run through a new identification."""
    chosen = IdentificationSettings(**{"stroke_m": STROKE, "pressure_pa": 1e5, "noise_std_m": NOISE} | settings)  # type: ignore[arg-type]
    identification = Identification(chosen)
    identification.restart()
    feed(identification, run, parameters=parameters, friction=friction)
    return identification


class Refined(Identification):
    """An identification with somebody who refines it."""

    def __init__(self, settings: IdentificationSettings) -> None:
        super().__init__(settings)
        self._refiner = InProcessRefiner()

    def update(self, *sample: float, **asked: bool) -> Estimates:  # type: ignore[override]
        """Take a sample, and let what it completes be refined."""
        estimates = super().update(*sample, **asked, refinement=Refinement.of(self._refiner))
        if (job := self.taken_job()) is not None:
            self._refiner.submit(job)
        return estimates


def rested() -> tuple[Valve, Refined]:
    """Return the seed's simulated valve at rest, and an identification of it that has just begun."""
    valve = Valve.from_file(load_valve(shipped_valve("seed")))
    valve.rest_at(0.05)
    identification = Refined(IdentificationSettings(stroke_m=STROKE, pressure_pa=4e5))
    identification.restart()
    return valve, identification


def feed(identification: Identification, run: Run, *, parameters: bool = True, friction: bool = True) -> None:
    for time_s, position_m, pressure_pa in run.samples():
        identification.update(time_s, position_m, pressure_pa, parameters=parameters, friction=friction)
