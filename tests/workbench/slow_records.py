"""Records of the seed's valve, seen once a second."""

import numpy as np

from config.recording import Column, Recording
from config.valve_file import ValveFile
from sim.composition import Composition
from sim.open_loop import respond
from tests.workbench.valves import NOISE_M, SEED
from workbench.data.noise_floor import with_noise

SPAN_PA = SEED.valve.spring_n_per_m * SEED.valve.stroke_m / SEED.valve.diaphragm_area_m2


def once_a_second(file: ValveFile, count: int = 200, held_s: float = 5.0, offset_s: float = 0.0) -> Recording:
    """Record steps of the command, simulated at 1 kHz; with an offset they fall between the samples, which see both."""
    generator = np.random.default_rng(0)
    time_s = 1e-3 * np.arange(1000 * count)
    levels = SPAN_PA * generator.uniform(0.1, 0.9, int(count / held_s) + 2)
    command: Column = levels[((time_s + held_s - offset_s) / held_s + 1e-9).astype(np.int64)]
    composition = Composition.from_file(file)
    begin_m = 0.5 * SEED.valve.stroke_m
    response = respond(
        composition, composition.theta, command[:-1], 1e-3, position_m=begin_m, pressure_pa=0.5 * SPAN_PA, step_s=1e-3
    )
    rows = slice(None, None, 1000)
    position_m: Column = response.indicated_m[rows] + NOISE_M * generator.standard_normal(count)
    seen: Column = np.arange(count, dtype=np.float64)
    recording = Recording({"time_s": seen, "command_pa": command[rows], "position_m": position_m})
    return with_noise(recording, NOISE_M)
