"""Estimation: microseconds per sample and per reading, everything on, at 1 ms and N = 50."""

from statistics import median
from time import perf_counter

import numpy as np

from positioner.estimation import Identification, IdentificationSettings

SAMPLES = 800
REPEATS = 5


def _times_us(jitter_s: float) -> list[float]:
    """Time each update of one identification; the stem moves slowly upwards all the time."""
    rng = np.random.default_rng(0)
    t = 1e-3 * np.arange(SAMPLES) + rng.uniform(0, jitter_s, SAMPLES)
    x = 0.016 * t + 1e-3 * np.exp(-t / 9e-3) + rng.normal(0, 1e-5, SAMPLES)
    u = 4e4 + 1.3e4 * np.sin(t)
    identification = Identification(IdentificationSettings(stroke_m=0.1016, pressure_pa=1e5, noise_std_m=1e-5))
    identification.restart()
    times = []
    for time_s, position_m, pressure_pa in zip(t.tolist(), x.tolist(), u.tolist(), strict=True):
        begin = perf_counter()
        identification.update(time_s, position_m, pressure_pa, parameters=True, friction=True)
        times.append(1e6 * (perf_counter() - begin))
    return times[100:]


def report() -> list[str]:
    """Return one line per kind of time stamp."""
    lines = []
    for name, jitter_s in (("even", 0.0), ("jittered", 2e-4)):
        runs = [_times_us(jitter_s) for _ in range(REPEATS)]
        typical = min(median(times) for times in runs)
        mean = min(sum(times) / len(times) for times in runs)
        reading = min(float(np.percentile(times, 99)) for times in runs)
        lines.append(
            f"estimation, {name} time stamps: {typical:.0f} us per sample, "
            f"{reading:.0f} us where (13) is solved (1 in 20), {mean:.0f} us in the mean"
        )
    return lines


if __name__ == "__main__":
    print("\n".join(report()))
