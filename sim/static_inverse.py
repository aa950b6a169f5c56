"""The inverse of an extended valve: the pressures that land its stem and break it loose, by its own equations.

With the force F_e, the levels F_c and F_s and the sensor of the composition (`sim.karnopp`, the effects in their
places), for a stem at rest at x, the pressure path settled, memories as after a long rest:

    s F_e(x, p) = F_c(x, p, s)       p lands a slide in direction s at x: F_c beyond any Stribeck drop
    s F_e(x, p) = F_s(x, p, s)       p breaks it loose;  where the stuck stem yields, x is where it has yielded to
    y(x)                             the sensor's

are solved for p by false position, on an even grid over the stroke. An effect that declares `inverse(q)` is left out of
the balance: it says itself what must be known of it. Nothing is compiled.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np

from config.errors import InputError
from config.extended_valve import ExtendedValve, Inverse, Table
from config.valve_file import ValveFile, require_air
from sim.composition import SPRING, parameter_vector
from sim.effect import BALANCE, Effect, find_effect
from sim.interpreted import interpreted
from sim.karnopp import MEMORY, Karnopp, Stem, Vector, karnopp

POINTS = 201
"""Of the grid."""
FAST_M_PER_S = 1e4
"""A velocity beyond any Stribeck range."""
FIRST_PA, DOUBLINGS = 1e4, 20
"""Half-width of the first bracket about the bare valve's pressure, and how often it is doubled."""
BALANCED_N, ROUNDS = 1e-6, 60
"""A force that is none, and how often the bracket is narrowed at the most: a kink may lie in it."""


def extended_valve(file: ValveFile, source: str) -> ExtendedValve:
    """Return what a controller must know of a valve file's valve.

    Args:
        file: the valve, effects and all.
        source: what errors call it, its path if it has one.

    Raises:
        InputError: an effect that is unknown or declares no inverse, a parameter unknown, missing or out of its range,
            a table that does not rise with the position, a function of an own effect that fails.
    """
    require_air(file, source, "the daemon commands none")
    effects = [find_effect(each.name, source) for each in file.effect]
    for each in effects:
        if not each.in_balance and each.inverse is None:
            problem = f'effect {each.name} declares no inverse: neither INVERSE = "{BALANCE}" nor inverse(q)'
            raise InputError(source, problem)
    theta = parameter_vector(file, effects, source)
    inverse = _inverse(file, effects, source)
    try:
        return _worked_out(file, effects, theta, inverse, source)
    except InputError:
        raise
    except Exception as error:  # an effect of one's own is a program, and may raise anything
        raise InputError(source, f"a function of its effects fails: {type(error).__name__}: {error}") from None


def _worked_out(
    file: ValveFile, effects: Sequence[Effect], theta: Vector, inverse: Inverse, source: str
) -> ExtendedValve:
    """Return the tables of a valve, and what undoes its effects in time.

    Raises:
        InputError: a table that does not rise with the position.
    """
    rest = _Rest.of(file, [each for each in effects if each.in_balance], source)
    grid = np.linspace(0.0, file.valve.stroke_m, POINTS).tolist()
    per_n = 1.0 / (float(theta[SPRING]) + inverse.yielding_n_per_m)

    def landing_pa(x: float, s: int) -> float:
        return rest.pressure_pa(x, s, rest.sliding_n)

    def breakaway_pa(x: float, s: int) -> float:
        held_n, loose_n = (level(Stem(0.0, x, 0.0, landing_pa(x, s)), s) for level in (rest.sliding_n, rest.static_n))
        return rest.pressure_pa(x + s * (held_n + loose_n) * per_n, s, rest.static_n)

    names = {1: "opening", -1: "closing"}
    return ExtendedValve(
        name=file.valve.name,
        stroke_m=file.valve.stroke_m,
        up_pa=_rising([landing_pa(x, 1) for x in grid], grid, f"the pressure that lands it {names[1]}", source),
        down_pa=_rising([landing_pa(x, -1) for x in grid], grid, f"the pressure that lands it {names[-1]}", source),
        breakaway_up_pa=tuple(breakaway_pa(x, 1) for x in grid),
        breakaway_down_pa=tuple(breakaway_pa(x, -1) for x in grid),
        indicated_m=_rising([rest.indicated_m(x) for x in grid], grid, "what is indicated of it", source),
        inverse=inverse,
    )


def _inverse(file: ValveFile, effects: Sequence[Effect], source: str) -> Inverse:
    declared = []
    for each, table in zip(effects, file.effect, strict=True):
        if each.inverse is None:
            continue
        values = each.values(table.parameters, f"{source}: effect {table.name}")
        try:
            undoes = each.inverse(values)
        except Exception as error:  # as above
            raise InputError(
                source, f"inverse(q) of effect {each.name} fails: {type(error).__name__}: {error}"
            ) from None
        if not isinstance(undoes, Inverse):
            raise InputError(source, f"inverse(q) of effect {each.name}: an Inverse is needed, got {undoes!r}")
        declared.append(undoes)
    return reduce(Inverse.joined, declared, Inverse())


def _rising(values: Sequence[float], grid: Sequence[float], what: str, source: str) -> Table:
    """Return a table.

    Raises:
        InputError: it does not rise.
    """
    for i in range(1, len(values)):
        if not values[i] > values[i - 1]:
            where = f"{grid[i - 1]:.4g} to {grid[i]:.4g} m"
            raise InputError(source, f"{what} does not rise with the position from {where}: it has no inverse")
    return tuple(values)


@dataclass(frozen=True, slots=True)
class _Rest:
    """The valve's laws for a stem long at rest."""

    laws: Any
    valve: Karnopp
    theta: Sequence[float]
    state_size: int
    source: str

    @classmethod
    def of(cls, file: ValveFile, effects: Sequence[Effect], source: str) -> "_Rest":
        """Return the laws of a valve with these of its effects."""
        kept = file.model_copy(update={"effect": tuple(each for each in file.effect if _named(each.name, effects))})
        theta = parameter_vector(kept, effects, source)
        return cls(
            interpreted(effects),
            Karnopp(*map(float, karnopp(theta))),
            theta.tolist(),
            MEMORY + sum(each.memory for each in effects),
            source,
        )

    def pressure_pa(self, x: float, s: int, level: Callable[[Stem, int], float]) -> float:
        """Return the command, Pa, at which the force on a stem at x in direction s is a level of friction, N."""

        def excess_n(command_pa: float) -> float:
            stem = self._stem(x, command_pa)
            return s * self._force_n(stem) - level(stem, s)

        middle, width = (self.valve.k_s * x + s * self.valve.F_c) / self.valve.A, FIRST_PA
        for _ in range(DOUBLINGS):
            ends = ((middle - width, s * excess_n(middle - width)), (middle + width, s * excess_n(middle + width)))
            if ends[0][1] < 0.0 < ends[1][1]:
                return _root(lambda command_pa: s * excess_n(command_pa), *ends)
            width *= 2.0
        raise InputError(self.source, f"no pressure balances the stem at {x:.4g} m: it has no inverse")

    def sliding_n(self, stem: Stem, s: int) -> float:
        """Return F_c."""
        return self._levels_n(stem._replace(v=s * FAST_M_PER_S), s)[0]

    def static_n(self, stem: Stem, s: int) -> float:
        """Return F_s."""
        return self._levels_n(stem, s)[1]

    def indicated_m(self, x: float) -> float:
        """Return y."""
        stem = Stem(0.0, x, 0.0, 0.0)
        return float(self.laws.start_stem(x, 0.0, stem, self.theta, self._state()))

    def _stem(self, x: float, command_pa: float) -> Stem:
        stem = Stem(0.0, x, 0.0, command_pa)
        return stem._replace(p=float(self.laws.start_pressure(command_pa, stem, self.theta, self._state())))

    def _force_n(self, stem: Stem) -> float:
        return float(self.laws.external_force(self.valve, stem, self.theta, self._state()))

    def _levels_n(self, stem: Stem, s: int) -> tuple[float, float]:
        state = self._state()
        F_e = self.laws.external_force(self.valve, stem, self.theta, state)
        self.laws.start_stem(stem.x, F_e, stem, self.theta, state)
        F_c, F_s = self.laws.friction(self.valve.F_c, self.valve.F_s, float(s), stem, self.theta, state)
        return float(F_c), float(F_s)

    def _state(self) -> Vector:
        """Return a state with fresh memories of the effects."""
        return np.zeros(self.state_size)


def _root(f: Callable[[float], float], low: tuple[float, float], high: tuple[float, float]) -> float:
    """Return where f vanishes between two points (x, f), by false position as in the Illinois method."""
    moved = 0
    for _ in range(ROUNDS):
        x = low[0] - low[1] * (high[0] - low[0]) / (high[1] - low[1])
        y = f(x)
        if abs(y) <= BALANCED_N:
            break
        if y < 0.0:
            low, high = (x, y), (high[0], high[1] * (0.5 if moved < 0 else 1.0))
            moved = -1
        else:
            low, high = (low[0], low[1] * (0.5 if moved > 0 else 1.0)), (x, y)
            moved = 1
    return x


def _named(name: str, effects: Sequence[Effect]) -> bool:
    return any(name in (each.name, each.written) for each in effects)
