"""A pneumatic positioner between set point and pressure: it fills and vents until the stem stands where it is asked.

    e = r - x,    e_d = sign(e) max(0, |e| - b / 2)
    I' = e_d / T_i                                    held while p' is at a limit
    p' = K (e_d + I)    within -r_v <= p' <= r_f,     p within 0 and p_s
    r < r_0:  p' = -r_v;    r > r_1:  p' = r_f        cut-offs: shut tight, open wide

r set point, m, which is what enters; x stem position, m, fed back; b dead band, m; K gain of spool and pilot,
Pa/(m s); T_i integral time, s; r_f, r_v what the pilot's flow fills and vents, Pa/s; p_s supply pressure, Pa. The flow
makes the pressure an integral of the error already: T_i is that of a controller before it, none at 1e6 s. Over a step
the error is that in its middle, by where the stem stood at its start and a step before (Adams and Bashforth's rule of
order 2); K A / k_s must stay below one over the step. A valve that was at rest begins with the pressure it was handed.

There is no inverse: what the daemon commands is a pressure, and behind a positioner it has none to command.
"""

from typing import Annotated, NamedTuple

from sim.effect import Memory, Parameter

INPUT = "setpoint"
MEMORY = 3
STEP_S = 0.005
PRESSURE_PA, INTEGRAL_M, BEFORE_M = 0, 1, 2
NO_INTEGRAL_S = 1e6
LOOKS = (
    "The stem follows its set point. Small changes are not answered at all, large ones along a ramp whose slope does "
    "not depend on their height. What friction holds back comes late, with a jump, or overshoots."
)
CONFOUNDED = {
    "coulomb_n": "measured actuator pressure: a dead band leaves it still, friction lets it rise. Without it: whether "
    "the stem arrives with a jump or stops short",
    "static_n": "measured actuator pressure: a dead band leaves it still, friction lets it rise",
}


class Parameters(NamedTuple):
    """K, T_i, b, r_f, r_v, p_s, r_0, r_1."""

    gain_pa_per_ms: Annotated[
        float,
        Parameter("gain", 1.0, 1e12, starts=(0.1, 0.5, 2.0), scale="spring_n_per_m / diaphragm_area_m2"),
    ]
    integral_time_s: Annotated[
        float, Parameter("integral time", 0.1, NO_INTEGRAL_S, off=NO_INTEGRAL_S, starts=(10.0, NO_INTEGRAL_S))
    ]
    dead_band_m: Annotated[
        float, Parameter("dead band, its whole width", 0.0, 1.0, off=0.0, starts=(0.002, 0.01), scale="stroke_m")
    ]
    filling_pa_per_s: Annotated[
        float,
        Parameter(
            "most rise of the pressure per second",
            1e-3,
            1e10,
            starts=(0.03, 0.3),
            scale="spring_n_per_m * stroke_m / diaphragm_area_m2",
        ),
    ]
    venting_pa_per_s: Annotated[
        float,
        Parameter(
            "most fall of the pressure per second",
            1e-3,
            1e10,
            starts=(0.03, 0.3),
            scale="spring_n_per_m * stroke_m / diaphragm_area_m2",
        ),
    ]
    supply_pa: Annotated[
        float,
        Parameter(
            "supply pressure, gauge",
            0.0,
            1e10,
            starts=(2.0,),
            scale="spring_n_per_m * stroke_m / diaphragm_area_m2",
            given=True,
        ),
    ]
    shut_below_m: Annotated[
        float, Parameter("set point below which it vents", -100.0, 100.0, off=-100.0, starts=(-100.0,), given=True)
    ]
    open_above_m: Annotated[
        float, Parameter("set point above which it fills", -100.0, 100.0, off=100.0, starts=(100.0,), given=True)
    ]


def start(signal: float, x: float, z: Memory) -> None:
    """At rest with the pressure it was handed."""
    z[PRESSURE_PA] = signal
    z[INTEGRAL_M] = 0.0
    z[BEFORE_M] = x


def pressure(z: Memory) -> float:
    """Return p."""
    return float(z[PRESSURE_PA])


def advance(after: float, h: float, x: float, q: Parameters, z: Memory) -> None:
    """Let the pilot fill or vent over the step."""
    error = after - (1.5 * x - 0.5 * z[BEFORE_M])
    z[BEFORE_M] = x
    beyond = max(0.0, abs(error) - 0.5 * q.dead_band_m)
    beyond = beyond if error > 0.0 else -beyond
    integral = z[INTEGRAL_M]
    if q.integral_time_s < NO_INTEGRAL_S:
        integral += beyond * h / q.integral_time_s
    wanted = q.gain_pa_per_ms * (beyond + integral)
    rate = min(max(wanted, -q.venting_pa_per_s), q.filling_pa_per_s)
    if after < q.shut_below_m:
        rate = -q.venting_pa_per_s
    elif after > q.open_above_m:
        rate = q.filling_pa_per_s
    elif rate == wanted:
        z[INTEGRAL_M] = integral
    z[PRESSURE_PA] = min(max(z[PRESSURE_PA] + rate * h, 0.0), max(q.supply_pa, 0.0))
