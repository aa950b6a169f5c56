"""An open-loop recording from the model, in one call and without a bus: what `positioner simulate` writes."""

import numpy as np
import numpy.typing as npt

from config.arguments import kinds_held
from config.errors import InputError
from config.loading import validate
from config.recording import Column, Recording, of_kind
from config.slave_file import Sensor
from config.valve_file import ValveFile
from sim.transmitter import Transmitter
from sim.valve import Valve

FEWEST_ROWS = 2


@kinds_held
def simulate(
    valve: ValveFile,
    time_s: npt.ArrayLike,
    command_pa: npt.ArrayLike,
    *,
    noise_std_m: float = 0.0,
    seed: int = 0,
) -> Recording:
    """Record a valve's answer to a series of pressures, open loop, from rest at position 0 without pressure.

    Of a valve with a positioner, which obeys set points, they are these.

    Args:
        valve: the valve, effects and all.
        time_s: (n,), s, strictly increasing.
        command_pa: (n,), Pa, of a valve with a positioner m; each is held from its time to the next.
        noise_std_m: standard deviation of the sensor's white noise, m.
        seed: of the noise; the same seed, the same recording.

    Returns:
        n rows: `time_s`, `command_pa` or `reference_m`, `position_m` as the sensor indicates it, and `pressure_pa` in
        the actuator, both of the row's time, before its command acts.

    Raises:
        InputError: series of other shapes or values, or an effect that is unknown or not physical.
    """
    time, command = _series("time_s", time_s), _series("command_pa", command_pa)
    if time.size != command.size or time.size < FEWEST_ROWS:
        raise InputError(
            "simulate",
            f"time_s holds {time.size} values, command_pa {command.size}; allowed are equally many, 2 or more",
        )
    if not (np.diff(time) > 0.0).all():
        raise InputError("simulate", "time_s must increase strictly")
    sensor = validate(Sensor, {"noise_std_m": float(noise_std_m), "seed": int(seed)}, "sensor")
    simulated = Valve.from_file(valve)
    response = simulated.run(command[:-1], np.diff(time))
    transmitter = Transmitter(sensor)
    return Recording(
        {
            "time_s": time,
            "reference_m" if simulated.by_setpoint else "command_pa": command,
            "position_m": np.array([transmitter.measure(position_m) for position_m in response.indicated_m]),
            "pressure_pa": response.pressure_pa,
        },
        {"valve": valve.valve.name, "source": "positioner simulate", **of_kind(valve.valve.own)},
    )


def _series(name: str, values: npt.ArrayLike) -> Column:
    try:
        series = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("simulate", f"{name} must be a series of finite numbers, got {values!r}") from None
    if series.ndim != 1 or not np.isfinite(series).all():
        raise InputError("simulate", f"{name} must be a series of finite numbers, its shape is {series.shape}")
    return series
