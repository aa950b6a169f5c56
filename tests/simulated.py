"""Recordings of minutes, as `sim.simulation.simulate` makes them but in longer steps.

The valve's own steps of 10 us are for its motion in fractions of a cycle; between two changes of mode the integration
is as exact in the longest steps that memories of effects bear (positions within 1 um), at a tenth of the cost.
"""

import numpy as np

from config.recording import Column, Recording
from config.slave_file import Sensor
from config.valve_file import ValveFile
from sim.effect import FINE_STEP_S
from sim.transmitter import Transmitter
from sim.valve import Valve


def simulated(
    file: ValveFile, time_s: Column, command: Column, *, noise_std_m: float = 0.0, seed: int = 0
) -> Recording:
    """Record a valve's answer, open loop, from rest at position 0 without pressure."""
    valve = Valve.from_file(file, step_s=FINE_STEP_S)
    response = valve.run(command[:-1], np.diff(time_s))
    transmitter = Transmitter(Sensor(noise_std_m=noise_std_m, seed=seed))
    columns: dict[str, Column] = {
        "time_s": time_s,
        "reference_m" if valve.by_setpoint else "command_pa": command,
        "position_m": np.array([transmitter.measure(position_m) for position_m in response.indicated_m]),
        "pressure_pa": response.pressure_pa,
    }
    return Recording(columns)
