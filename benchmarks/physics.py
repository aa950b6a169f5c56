"""How many times faster than real time the valve is simulated on one core, at 10 us steps."""

from time import perf_counter

import numpy as np
import numpy.typing as npt

from config.valve_file import EffectTable, ValveFile, load_valve, shipped_valve
from sim.valve import Valve

PASCAL_PER_PSI = 6894.757
STEP_S = 1e-5
REPEATS = 7
TARGET = 300
EFFECTS = (
    EffectTable.model_validate({"name": "ip_lag", "time_constant_s": 0.05}),
    EffectTable.model_validate({"name": "presliding", "stiffness_n_per_m": 8e6}),
    EffectTable.model_validate({"name": "backlash", "width_m": 2e-4}),
)
Series = npt.NDArray[np.float64]


def seed_scenario(period_s: float) -> Series:
    """u = (6.4 + 1.92 sin t) psi for 0.8 s, sampled in the middle of each period."""
    t = (np.arange(round(0.8 / period_s)) + 0.5) * period_s
    return np.asarray((6.4 + 1.92 * np.sin(t)) * PASCAL_PER_PSI)


def staircase() -> Series:
    """3 kPa steps of 120 ms, up to 80 kPa and down again, as commands of 1 ms: it sticks and slips."""
    up = np.arange(20e3, 80e3, 3e3)
    return np.repeat(np.concatenate([up, up[::-1]]), 120)


def times_real_time(valve: Valve, command_pa: Series, period_s: float) -> float:
    """Return simulated over elapsed time, the best of several runs."""
    elapsed = []
    for _ in range(REPEATS):
        valve.rest_at(0.0, 0.0)
        begin = perf_counter()
        valve.run(command_pa, period_s)
        elapsed.append(perf_counter() - begin)
    return command_pa.size * period_s / min(elapsed)


def cost_of_advance(valve: Valve) -> float:
    """Return the time one call takes that advances 1 ms, in us, while the stem moves."""
    commands = seed_scenario(1e-3).tolist()
    elapsed = []
    for _ in range(REPEATS):
        valve.rest_at(0.0, 0.0)
        begin = perf_counter()
        for command in commands:
            valve.advance(command, 1e-3)
        elapsed.append(perf_counter() - begin)
    return min(elapsed) / len(commands) * 1e6


def report() -> list[str]:
    """Return the figures, a line each."""
    bare = load_valve(shipped_valve("seed"))
    lines = [f"physics, {STEP_S * 1e6:.0f} us steps, one core, times real time (target for the bare valve: {TARGET})"]
    for name, file in (
        ("bare", bare),
        ("ip_lag, presliding, backlash", ValveFile(valve=bare.valve, effect=EFFECTS)),
    ):
        valve = Valve.from_file(file, step_s=STEP_S)
        lines += [
            f"  {name}: seed scenario, command every 10 us: {times_real_time(valve, seed_scenario(1e-5), 1e-5):.0f}",
            f"  {name}: seed scenario, command every 1 ms: {times_real_time(valve, seed_scenario(1e-3), 1e-3):.0f}",
            f"  {name}: stick-slip staircase, command every 1 ms: {times_real_time(valve, staircase(), 1e-3):.0f}",
            f"  {name}: one call that advances 1 ms: {cost_of_advance(valve):.1f} us",
        ]
    return lines


if __name__ == "__main__":
    print("\n".join(report()))
