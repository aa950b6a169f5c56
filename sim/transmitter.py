"""The position transmitter: white noise, then rounding to the quantum of its converter.

    y_n = q round((x + sigma w_n) / q),   w_n ~ N(0, 1) independent, from a seeded generator; q = 0 rounds nothing

What bends the signal before that (backlash, lag, gain error) are effects of the valve: `sim.effects`.
"""

from collections.abc import Iterator

import numpy as np

from config.slave_file import Sensor

BLOCK = 4096
"""Noise values drawn at once."""


class Transmitter:
    """Measures a position. The same seed gives the same noise, sample by sample."""

    def __init__(self, sensor: Sensor) -> None:
        self._quantum_m = sensor.quantum_m
        self._noise_std_m = sensor.noise_std_m
        self._generator = np.random.default_rng(sensor.seed)
        self._drawn_m: Iterator[float] = iter(())

    def measure(self, position_m: float) -> float:
        """Return what is measured of a position, in m."""
        measured_m = position_m + self._noise_m()
        if self._quantum_m:
            measured_m = self._quantum_m * round(measured_m / self._quantum_m)
        return measured_m

    def _noise_m(self) -> float:
        noise_m = next(self._drawn_m, None)
        if noise_m is None:
            self._drawn_m = iter((self._noise_std_m * self._generator.standard_normal(BLOCK)).tolist())
            noise_m = next(self._drawn_m)
        return noise_m
