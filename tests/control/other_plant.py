"""A plant of other equations than the product's simulator, in virtual time: the LuGre stem of `tests.other_device`."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tests.other_device import Parameters, Stem

SEED_LIKE = Parameters(
    stroke_m=0.1016,
    area_m2=0.0645,
    spring_n_per_m=52538.0,
    preload_n=0.0,
    mass_kg=1.3608,
    viscous_ns_per_m=612.944,
    coulomb_n=1423.4,
    static_n=1708.09,
    stribeck_m_per_s=2e-3,
    bristle_n_per_m=2e7,
    bristle_damping_ns_per_m=2e3,
    lag_s=1e-3,
)
"""The seed's valve with bristles in place of a dead zone, behind an I/P of a millisecond."""


def with_friction(parameters: Parameters, factor: float) -> Parameters:
    """Return a valve whose packing is so many times as tight."""
    return replace(parameters, coulomb_n=factor * parameters.coulomb_n, static_n=factor * parameters.static_n)


class OtherPlant:
    """The stem behind a noisy sensor; `sensed` is what becomes of what it would show, m, at a time, s."""

    sample_counter = 0
    status = 0

    def __init__(
        self,
        parameters: Parameters,
        period_s: float,
        *,
        at_pu: float = 0.5,
        noise_std_m: float = 0.0,
        seed: int = 0,
        sensed: Callable[[float, float], float] = lambda _time_s, shown_m: shown_m,
    ) -> None:
        self.stem = Stem(parameters, at_pu * parameters.stroke_m)
        self._period_s, self._noise_std_m, self._sensed = period_s, noise_std_m, sensed
        self._rng = np.random.default_rng(seed)
        self.command_pa = self.stem.pressure_pa
        self._measure()

    @property
    def stem_pu(self) -> float:
        """Where the stem truly is, a share of the stroke."""
        return self.stem.position_m / self.stem.parameters.stroke_m

    @property
    def device_time_us(self) -> int:
        return round(1e6 * self._period_s * self.sample_counter)

    def tick(self, command_pa: float) -> None:
        self.command_pa = command_pa
        self.stem.advance(command_pa, self._period_s)
        self.sample_counter += 1
        self._measure()

    def _measure(self) -> None:
        noise_m = self._noise_std_m * float(self._rng.standard_normal())
        self.position_m = self._sensed(1e-6 * self.device_time_us, self.stem.position_m + noise_m)
        self.pressure_pa = self.stem.pressure_pa
