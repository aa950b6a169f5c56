"""Valves and recordings with a known truth: 30 s at 100 Hz of holds, ramps and sines, integrated at 10 us."""

import numpy as np

from config.recording import Column, Recording
from config.valve_file import EffectTable, ValveFile, ValveParameters, load_valve, shipped_valve
from sim.composition import Composition
from sim.effect import FINE_STEP_S
from sim.open_loop import respond
from workbench.compare.measures import rms
from workbench.data.record import ready
from workbench.model.free_run import FreeRun

SEED = load_valve(shipped_valve("seed"))
NOISE_M = 5e-5
PERIOD_S = 0.01

SLIM = ValveFile(valve=SEED.valve.model_copy(update={"coulomb_n": 360.0, "static_n": 375.0, "viscous_ns_per_m": 310.0}))
"""Little friction: it slips often."""


def drawn_valve(generator: np.random.Generator) -> ValveFile:
    seed = SEED.valve
    coulomb_n = generator.uniform(250.0, 1424.0)
    drawn = {
        "coulomb_n": coulomb_n,
        "static_n": coulomb_n * generator.uniform(1.05, 1.35),
        "spring_n_per_m": seed.spring_n_per_m * generator.uniform(0.8, 1.2),
        "viscous_ns_per_m": seed.viscous_ns_per_m * generator.uniform(0.5, 3.0),
    }
    return ValveFile(valve=ValveParameters.model_validate(seed.model_dump() | drawn))


def with_effect(file: ValveFile, name: str, **parameters: float) -> ValveFile:
    return ValveFile(valve=file.valve, effect=(EffectTable.model_validate({"name": name, **parameters}),))


def pressures(generator: np.random.Generator, count: int) -> Column:
    seed = SEED.valve
    middle = 0.5 * seed.spring_n_per_m * seed.stroke_m / seed.diaphragm_area_m2
    command = np.empty(count)
    done, last = 0, middle * generator.uniform(0.6, 1.4)
    while done < count:
        length = min(int(generator.uniform(50, 300)), count - done)
        target = middle * generator.uniform(0.1, 1.9)
        t = PERIOD_S * np.arange(length)
        shapes = (
            np.full(length, target),
            np.linspace(last, target, length),
            last + 0.3 * middle * np.sin(2.0 * np.pi * generator.uniform(0.3, 1.5) * t),
        )
        command[done : done + length] = shapes[generator.integers(3)]
        done += length
        last = float(command[done - 1])
    return command


def creeping(count: int = 1600) -> Column:
    """Slow ramps up and down, Pa: (count,): the stem sticks and slips all the way."""
    seed = SEED.valve
    span_pa = seed.spring_n_per_m * seed.stroke_m / seed.diaphragm_area_m2
    corners = span_pa * np.array([0.2, 0.8, 0.3, 0.7])
    return np.interp(np.arange(count), np.linspace(0, count, corners.size), corners)


def record_of(
    file: ValveFile, seed: int, count: int = 3000, *, dirty: bool = False, command_pa: Column | None = None
) -> Recording:
    """Record a valve; dirty: 300 Pa of correlated pressure noise, and 12 bits of position."""
    generator = np.random.default_rng(seed)
    command = pressures(generator, count) if command_pa is None else command_pa
    count = command.size
    drive = command + _correlated(generator, count, 300.0) if dirty else command
    valve = file.valve
    begin_m = float(command[0]) * valve.diaphragm_area_m2 / valve.spring_n_per_m
    composition = Composition.from_file(file)
    response = respond(
        composition,
        composition.theta,
        drive[:-1],
        PERIOD_S,
        position_m=begin_m,
        pressure_pa=float(command[0]),
        step_s=FINE_STEP_S,
    )
    position = response.indicated_m + NOISE_M * generator.standard_normal(count)
    if dirty:
        quantum = valve.stroke_m / 4096
        position = quantum * np.round(position / quantum)
    time_s: Column = np.asarray(PERIOD_S * np.arange(count), np.float64)
    return Recording({"time_s": time_s, "command_pa": command, "position_m": position})


def error_of(file: ValveFile, recording: Recording) -> float:
    """Return the rms error of a valve's free run, m."""
    composition = Composition.from_file(file)
    return rms(FreeRun(composition, ready(recording)).position_m(composition.theta) - recording.position_m)


def _correlated(generator: np.random.Generator, count: int, std: float) -> Column:
    keep = np.exp(-PERIOD_S / 0.1)
    noise = np.zeros(count)
    for i, fresh in enumerate(generator.standard_normal(count - 1), start=1):
        noise[i] = keep * noise[i - 1] + std * np.sqrt(1.0 - keep**2) * fresh
    return noise
