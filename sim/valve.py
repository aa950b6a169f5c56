"""A control valve in virtual time: hold a command for a period, read where the stem is."""

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from config.valve_file import ValveFile
from sim.composition import Composition
from sim.karnopp import TOLERANCE, karnopp, read
from sim.open_loop import PATH_ROWS, STEP_S, Response, at_rest, check_step, follow


class Valve:
    """A valve file's valve and its state. It starts at time 0 at rest at position 0 with no pressure."""

    def __init__(self, composition: Composition, *, step_s: float = STEP_S) -> None:
        self._composition = composition
        self._theta = composition.theta.copy()
        self._step_s = check_step(step_s)
        self._command, self._period, self._path = np.zeros(1), np.zeros(1), np.zeros((PATH_ROWS, 2))
        self._state = at_rest(composition, self._theta, 0.0, 0.0, 0.0)
        self._respond = self._bound()

    @classmethod
    def from_file(cls, file: ValveFile, *, step_s: float = STEP_S, source: str = "valve file") -> Self:
        """Make the valve of a valve file; `source` is what errors call it, its path if it has one.

        Raises:
            InputError: an unknown effect, or a parameter unknown, missing or out of its range.
        """
        return cls(Composition.from_file(file, source), step_s=step_s)

    def rest_at(self, position_m: float, pressure_pa: float | None = None) -> None:
        """Put the stem to rest at a position, a pressure long held; by default the one that balances the spring.

        Raises:
            ValueError: a number that is not finite.
        """
        valve = karnopp(self._theta)
        held = valve.k_s * position_m / valve.A if pressure_pa is None else pressure_pa
        self._state = at_rest(self._composition, self._theta, self.time_s, position_m, held)
        self._respond = self._bound()

    def advance(self, command_pa: float, duration_s: float) -> None:
        """Hold a command (Pa) for a duration (s), cut into equal steps of at most step_s.

        Raises:
            ValueError: a command that is not finite, a duration that is not positive.
        """
        if not (isfinite(command_pa) and isfinite(duration_s) and duration_s > 0.0):
            raise ValueError(f"cannot hold {command_pa} Pa for {duration_s} s")
        self._command[0] = command_pa
        self._period[0] = duration_s
        self._respond()

    def run(self, command_pa: npt.ArrayLike, period_s: npt.ArrayLike) -> Response:
        """Hold n commands (Pa) in turn, each for its period (s, one for all or n); as n calls of `advance`.

        Returns arrays of n + 1 rows: row 0 is the present, the others the end of each period (see `sim.open_loop`).

        Raises:
            ValueError: a series of another length, or a number that is not finite or not allowed.
        """
        return follow(self._composition, self._theta, self._state, command_pa, period_s, self._step_s)

    def change(self, **parameters: float) -> None:
        """Change parameters while it runs, by the names of the valve file; an effect's as `effect.parameter`.

        Raises:
            InputError: an unknown name or a value that is not physical; nothing is changed then.
        """
        self._theta = self._composition.changed(self._theta, parameters)
        self._respond = self._bound()

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy takes over: all but the call, which is made for these arrays."""
        return {name: value for name, value in self.__dict__.items() if name != "_respond"}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Become a copy, which moves by itself."""
        self.__dict__.update(state)
        self._respond = self._bound()

    def _bound(self) -> Callable[[], None]:
        return self._composition.kernel.respond.bound(
            self._theta, self._state, self._command, self._period, self._step_s, TOLERANCE, self._path
        )

    @property
    def by_setpoint(self) -> bool:
        """Whether its commands are set points, m, that a positioner obeys, and not pressures, Pa."""
        return self._composition.by_setpoint

    @property
    def time_s(self) -> float:
        """Time since the start."""
        return float(read(self._state).t)

    @property
    def position_m(self) -> float:
        """True stem position."""
        return float(read(self._state).x)

    @property
    def velocity_m_per_s(self) -> float:
        """True stem velocity."""
        return float(read(self._state).v)

    @property
    def pressure_pa(self) -> float:
        """Actuator pressure, behind the pressure path."""
        return float(read(self._state).p)

    @property
    def indicated_m(self) -> float:
        """Position as the sensor indicates it, without noise."""
        return float(read(self._state).indicated)
