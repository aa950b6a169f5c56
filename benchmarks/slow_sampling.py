"""What `diagnose` says of a valve seen once a second, and its cost: `python -m benchmarks.slow_sampling [NAME ...]`.

The seed's valve with one effect, at 1 kHz. Open loop: steps of the command every 5 s, 300 s. Closed loop: the seed's
law, which knows nothing of the effect, follows a reference that changes every 5 s at no round time, 500 s; of its
commands one a second is seen. Noise 0.05 mm. Each line: the verdict, what is missing, its parameter, how it was
simulated, the rms errors of the best model fitted and held out, time and memory; the first run compiles the kernels,
and the memory is the most so far.

`long` instead of an effect's name: an hour and a week at 1 s, ten hours at 10 Hz, stepped every 20, 60 and 20 s, with
asymmetric friction.
"""

import sys
import time
from collections.abc import Iterator, Mapping
from resource import RUSAGE_SELF, getrusage

import numpy as np

from config.recording import Column, Recording
from config.valve_file import EffectTable, ValveFile, load_valve, shipped_valve
from sim.composition import Composition
from sim.open_loop import respond
from sim.valve import Valve
from workbench.diagnosis.diagnosis import diagnose

SEED = load_valve(shipped_valve("seed"))
SPAN_PA = SEED.valve.spring_n_per_m * SEED.valve.stroke_m / SEED.valve.diaphragm_area_m2
NOISE_M, FINE_S = 5e-5, 1e-3
HIDDEN: Mapping[str, Mapping[str, float]] = {
    "none": {},
    "asymmetric_friction": {"asymmetry": 0.15},
    "preload": {"force_n": 400.0},
    "spring_hardening": {"cubic_n_per_m3": 8e5},
    "position_friction": {"growth": 0.4, "travel_m": 0.1016},
    "rate_limit": {"filling_pa_per_s": 2e4, "venting_pa_per_s": 3e4},
    "ip_lag": {"time_constant_s": 0.7},
}
LONG = {
    "an hour at 1 s": (3600, 1.0, 20.0),
    "a week at 1 s": (604_800, 1.0, 60.0),
    "10 h at 10 Hz": (360_000, 0.1, 20.0),
}
"""Samples, period and how long a command is held, s."""


def hidden(name: str) -> ValveFile:
    """Return the valve with an effect."""
    tables = [{"name": name, **HIDDEN[name]}] if name != "none" else []
    return ValveFile(valve=SEED.valve, effect=tuple(map(EffectTable.model_validate, tables)))


def open_loop(file: ValveFile, count: int = 300, period_s: float = 1.0, held_s: float = 5.0) -> Recording:
    """Record steps of the command, held from sample to sample."""
    generator = np.random.default_rng(0)
    held = round(held_s / period_s)
    command_pa = np.repeat(SPAN_PA * generator.uniform(0.1, 0.9, count // held + 1), held)[:count]
    composition = Composition.from_file(file)
    response = respond(
        composition,
        composition.theta,
        command_pa[:-1],
        period_s,
        position_m=0.5 * SEED.valve.stroke_m,
        pressure_pa=0.5 * SPAN_PA,
        step_s=min(max(FINE_S, count * period_s * 1e-6), composition.step_s),
    )
    time_s: Column = period_s * np.arange(count, dtype=np.float64)
    return recorded(time_s, command_pa, response.indicated_m, generator)


def closed_loop(file: ValveFile, count: int = 500) -> Recording:
    """Record the seed's law once a second; it acts every millisecond."""
    generator = np.random.default_rng(1)
    parameters, valve = file.valve, Valve.from_file(file, step_s=FINE_S)
    middle_m = 0.5 * parameters.stroke_m
    valve.rest_at(middle_m)
    command_pa, changes_s, seen = 0.5 * SPAN_PA, 2.3, []
    for i in range(1000 * count):
        if i % 1000 == 0:
            seen.append((command_pa, valve.indicated_m))
        if i * FINE_S >= changes_s:
            reference_m = parameters.stroke_m * generator.uniform(0.1, 0.9)
            friction_n = parameters.coulomb_n * np.sign(reference_m - valve.indicated_m)
            command_pa = float(parameters.spring_n_per_m * reference_m + friction_n) / parameters.diaphragm_area_m2
            changes_s += generator.uniform(4.0, 6.0)
        valve.advance(command_pa, FINE_S)
    commands, positions_m = np.array(seen).T
    time_s: Column = np.arange(count, dtype=np.float64)
    return recorded(time_s, commands, positions_m, generator)


def recorded(time_s: Column, command_pa: Column, position_m: Column, noise: np.random.Generator) -> Recording:
    """Return the recording, with the sensor's noise."""
    read_m: Column = position_m + NOISE_M * noise.standard_normal(time_s.size)
    return Recording({"time_s": time_s, "command_pa": command_pa, "position_m": read_m})


def diagnosed(what: str, recording: Recording) -> str:
    """Say what comes of a recording."""
    began_s = time.perf_counter()
    found = diagnose(recording, SEED)
    took_s, megabytes = time.perf_counter() - began_s, getrusage(RUSAGE_SELF).ru_maxrss / 1e3
    sets = [" or ".join(each) for each in found.indistinguishable] or [" and ".join(found.missing)]
    fitted = {key: each.value for key, each in found.best.fit.parameters.items() if "." in key}
    values = ", ".join(f"{key} {value:.4g}" for key, value in fitted.items())
    errors = found.best.errors
    return (
        f"{what}: {found.verdict} {'; '.join(sets)} ({values}), {found.best.fit.by.motion}, "
        f"{1e3 * errors.train_rmse_m:.4f} and {1e3 * errors.test_rmse_m:.4f} mm, {took_s:.0f} s, {megabytes:.0f} MB"
    )


def report(names: list[str]) -> Iterator[str]:
    """Yield a line a recording."""
    for name in names or HIDDEN:
        if name == "long":
            for what, (count, period_s, held_s) in LONG.items():
                yield diagnosed(what, open_loop(hidden("asymmetric_friction"), count, period_s, held_s))
            continue
        yield diagnosed(f"{name}, open loop", open_loop(hidden(name)))
        yield diagnosed(f"{name}, closed loop", closed_loop(hidden(name)))


if __name__ == "__main__":
    for line in report(sys.argv[1:]):
        print(line, flush=True)
