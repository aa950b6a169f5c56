"""Where searches begin for a valve behind its positioner, of which set point and travel are known, and no pressure.

Pressures are known up to a factor: K, r_f, r_v, p_s, k_s, F_c and F_s times the same give the same travel. So the
spring stays as the valve file has it, and viscous friction with it, which the positioner's ramps hide. Landings and the
regression of forces need a pressure. A closed loop that sticks has many minima, and descents from a grid end in them;
differential evolution, which goes by a population of valves, does not. It is done twice, from other draws: two
independent starts. What the pilot's flow allows is sought about what the stem's own speed says, since a sliding stem
follows the pressure:

    r_f = k_s/A x'    x' a high quantile of the speed between samples in which it opens;   r_v the same closing
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.optimize import Bounds, differential_evolution

from sim.composition import AREA, COULOMB, SPRING, STATIC
from sim.karnopp import Vector
from workbench.data.record import Record
from workbench.fit.agreement import Place
from workbench.fit.objective import MIDDLE, SimulationError
from workbench.fit.threads import on_threads
from workbench.model.parameters import Parameter

FREE = ("coulomb_n", "static_n")
"""What is free of the base model."""
FRICTION = (0.02, 5.0)
"""Of the valve file's F_c."""
STATIC_RATIO = 1.6
"""F_s / F_c at most."""
BEYOND = 5.0
"""So many times below the least of an effect's starts, and above the greatest, it is sought."""
QUANTILE, FLOW_FACTOR = 0.8, 3.0
"""Of the speeds, the highest being jumps; and by what factor about it."""
FLOW = {"filling_pa_per_s": 1.0, "venting_pa_per_s": -1.0}
"""What the speed suggests, and in which direction."""
MOVED = 4.0
"""Standard deviations of the noise from which on it has moved between two samples."""
POPULATION, GENERATIONS, EVOLUTIONS = 8, 40, 2
"""Valves a parameter, and how often they are renewed at most; how many times all is done."""


def setpoint_starts(
    error: SimulationError, theta: Vector, seed: int, workers: int | None, tell: Callable[[float], None]
) -> list[Place]:
    """Return the valve file's place, and where two evolutions end.

    Args:
        error: what they lower, at the screening scale.
        theta: of the valve file.
        seed: of the draws.
        workers: threads.
        tell: called with the fraction done, from the threads.
    """
    box = _box(error, theta)

    renewed = [0] * EVOLUTIONS

    def evolved(number: int) -> Vector:
        def generation(*_reached: object) -> None:
            renewed[number] += 1
            tell(sum(renewed) / (EVOLUTIONS * GENERATIONS))

        found = differential_evolution(
            partial(error.scouting.cost, scale=MIDDLE),
            Bounds(*box),
            rng=np.random.default_rng((seed, number)),
            popsize=POPULATION,
            maxiter=GENERATIONS,
            init="sobol",
            polish=False,
            callback=generation,
        )
        return np.asarray(found.x, np.float64)

    places = [Place(error.coordinates(theta), "valve file")]
    for number, z in enumerate(on_threads(evolved, range(EVOLUTIONS), workers)):
        places.append(Place(z, f"evolution {number}"))
    tell(1.0)
    return places


def _box(error: SimulationError, theta: Vector) -> tuple[Vector, Vector]:
    """Return the least and the greatest coordinates, (parameters,) each, between which a valve is drawn."""
    speeds = _speeds(error.run.record, QUANTILE)
    per_m = float(theta[SPRING] / theta[AREA])
    ranges = []
    for each in error.parameters:
        low, high = _range(each, float(theta[each.index]), per_m * speeds.get(each.name.partition(".")[2], 0.0))
        ends = [_coordinate(each, theta, value) for value in (low, high)]
        ranges.append((max(ends[0], each.bounds[0]), min(ends[1], each.bounds[1])))
    least, most = np.array(ranges).T
    return least, most


def _range(each: Parameter, known: float, flow: float) -> tuple[float, float]:
    if each.index == STATIC:
        return 1.0, STATIC_RATIO
    if flow > 0.0:
        return flow / FLOW_FACTOR, flow * FLOW_FACTOR
    if not each.starts:
        return FRICTION[0] * known, FRICTION[1] * known
    least = min(each.starts) / BEYOND if each.least > 0.0 else each.least
    return max(least, each.least), min(BEYOND * max(each.starts), each.most)


def _coordinate(each: Parameter, theta: Vector, value: float) -> float:
    there = theta.copy()
    there[each.index] = value * theta[COULOMB] if each.index == STATIC else value
    return each.coordinate(there)


def _speeds(record: Record, quantile: float) -> dict[str, float]:
    """Return a quantile of the speeds, m/s, opening and closing; none of a direction in which it never moves."""

    def differences(column: Vector) -> Vector:
        return np.concatenate([np.diff(column[first:end]) for first, end in record.segments])

    moved_m = differences(record.position_m)
    speed = moved_m / differences(record.time_s)
    found: dict[str, float] = {}
    for name, way in FLOW.items():
        chosen = way * speed[way * moved_m > MOVED * record.scale_m]
        found |= {name: float(np.quantile(chosen, quantile))} if chosen.size else {}
    return found
