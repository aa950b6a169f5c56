"""A valve with every shipped effect in its place and switched off: one kernel for many tests. The text uncompiled."""

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import numpy.typing as npt

from config.valve_file import EffectTable, ValveFile, load_valve, shipped_valve
from sim import karnopp
from sim.composition import BASE, Composition
from sim.effect import Effect, shipped_effect, tried_effects
from sim.interpreted import interpreted
from sim.valve import Valve

SEED = load_valve(shipped_valve("seed"))
EFFECTS = {name: shipped_effect(name, "test") for name in tried_effects()}
Series = npt.NDArray[np.float64]


def table(effect: Effect, values: Sequence[float]) -> EffectTable:
    return EffectTable.model_validate({"name": effect.name, **dict(zip(effect.parameters, values, strict=True))})


@cache
def library() -> Composition:
    tables = tuple(table(each, each.off(SEED.valve)) for each in EFFECTS.values())
    return Composition.of(ValveFile(valve=SEED.valve, effect=tables), list(EFFECTS.values()))


def valve_with(name: str, **parameters: float) -> Valve:
    """Return the seed's valve with one effect switched on, at rest."""
    valve = Valve(library())
    valve.change(**{f"{name}.{key}": value for key, value in parameters.items()})
    valve.rest_at(0.0, 0.0)
    return valve


def theta_with(effect: Effect, values: Sequence[float]) -> Series:
    composition = library()
    parameters = {f"{effect.name}.{key}": value for key, value in zip(effect.parameters, values, strict=True)}
    return composition.changed(composition.theta, parameters)


def plain(effects: Sequence[Effect]) -> Callable[[Sequence[float], Series, float, float], Series]:
    """Return the model with its effects as plain Python: (effects' parameters, commands, period, step) -> path."""
    laws = interpreted(effects)
    base = [getattr(SEED.valve, name) for name in BASE]

    def run(values: Sequence[float], commands: Series, period_s: float, step_s: float) -> Series:
        theta = np.array([*base, *values])
        state = np.zeros(karnopp.MEMORY + sum(each.memory for each in effects))
        path = np.empty((5, commands.size + 1))
        laws.rest(theta, state, 0.0, 0.0, 0.0)
        laws.respond(theta, state, commands, np.full(commands.size, period_s), step_s, karnopp.TOLERANCE, path)
        return path

    return run
