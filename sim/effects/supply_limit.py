"""The pressure stays between what the exhaust leaves and what the supply gives.

    p = min(max(u, p_e), p_s)

p_s supply pressure, p_e pressure left in the vented actuator, Pa; u entering pressure, p leaving pressure, Pa.
"""

from typing import Annotated, NamedTuple

from config.extended_valve import Inverse
from sim.effect import Parameter

COMPLAINT = "air supply or leak"
LOOKS = "Beyond one command, always the same, the stem moves no further: at the upper end, the lower end, or both."
CONFOUNDED = {
    "end_stop": "measured actuator pressure: the limit cuts it, a stop does not. Without it, another load: it "
    "shifts the place where a limit halts the stem, and not that of a stop",
}


class Parameters(NamedTuple):
    """p_s and p_e."""

    supply_pa: Annotated[
        float,
        Parameter(
            "supply pressure, gauge",
            0.0,
            1e7,
            off=1e7,
            starts=(0.95, 0.85, 0.7, 0.5),
            scale="spring_n_per_m * stroke_m / diaphragm_area_m2",
        ),
    ]
    exhaust_pa: Annotated[
        float,
        Parameter(
            "pressure left when vented, gauge; down to that of a vacuum",
            -101325.0,
            1e7,
            off=-101325.0,
            starts=(-2.0, 0.05, 0.15, 0.3),
            scale="spring_n_per_m * stroke_m / diaphragm_area_m2",
        ),
    ]


def pressure(u: float, q: Parameters) -> float:
    """Cut u at both ends."""
    return min(max(u, q.exhaust_pa), q.supply_pa)


def inverse(q: Parameters) -> Inverse:
    """Ask for nothing beyond."""
    return Inverse(least_pa=q.exhaust_pa, most_pa=q.supply_pa)
