"""An independent reference: the automaton of `sim.karnopp`'s head, integrated by scipy with events.

Written from the definition alone; shares no code with the model.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from config.valve_file import ValveParameters

Series = npt.NDArray[np.float64]
Pressure = Callable[[float], float]


@dataclass
class Reference:
    """A valve from rest at 0 under a pressure that is smooth on each stretch between two breaks."""

    valve: ValveParameters
    breaks: Sequence[float]
    pressures: Sequence[Pressure]
    x: float = 0.0
    v: float = 0.0
    mode: str = "stuck"
    sigma: float = 0.0
    changes: list[tuple[float, str]] = field(default_factory=list)

    def solve(self, times: npt.NDArray[np.floating]) -> Series:
        """Return x at the times, from the first break to the last."""
        x = np.full(times.shape, np.nan)
        x[0] = self.x
        for begin, end, pressure in zip(self.breaks[:-1], self.breaks[1:], self.pressures, strict=True):
            t = begin
            while t < end:
                stretch = self._wait if self.mode == "stuck" else self._move
                wanted = (times > t) & (times <= end)
                t, at = stretch(pressure, t, end, times[wanted].astype(np.float64))
                x[np.flatnonzero(wanted)[: at.size]] = at
        return x

    def times_of(self, mode: str) -> Series:
        return np.array([t for t, each in self.changes if each == mode])

    def _force(self, p: float, x: float) -> float:
        return self.valve.diaphragm_area_m2 * p - self.valve.spring_n_per_m * x

    def _enter(self, t: float, mode: str) -> None:
        self.mode = mode
        self.changes.append((t, mode))

    def _wait(self, pressure: Pressure, t: float, end: float, times: Series) -> tuple[float, Series]:
        def excess(t: float) -> float:
            return abs(self._force(pressure(t), self.x)) - self.valve.static_n

        grid = np.linspace(t, end, 2001)
        over = [k for k, each in enumerate(grid) if excess(each) > 0.0]
        if not over:
            return end, np.full(times.shape, self.x)
        k = over[0]
        leave = t if k == 0 else brentq(excess, grid[k - 1], grid[k], xtol=1e-15)
        self.sigma = float(np.sign(self._force(pressure(grid[k]), self.x)))
        self._enter(leave, "breaking")
        return leave, np.full(times[times <= leave].shape, self.x)

    def _move(self, pressure: Pressure, t: float, end: float, times: Series) -> tuple[float, Series]:
        valve, sigma, breaking = self.valve, self.sigma, self.mode == "breaking"
        band = valve.deadzone_ratio * valve.stribeck_velocity_m_per_s
        drop = valve.static_n - valve.coulomb_n

        def rate(t: float, y: Series) -> list[float]:
            force = self._force(pressure(t), y[0])
            if breaking:
                return [y[1], (force - valve.static_n * sigma) / valve.mass_kg]
            sliding = valve.coulomb_n + drop * np.exp(-((y[1] / valve.stribeck_velocity_m_per_s) ** 2))
            return [y[1], (force - valve.viscous_ns_per_m * y[1] - sliding * sigma) / valve.mass_kg]

        def at_band(t: float, y: Series) -> float:
            return float(sigma * y[1] - band)

        def released(t: float, y: Series) -> float:
            return sigma * self._force(pressure(t), y[0]) - valve.static_n

        events: list[Any] = [at_band, released] if breaking else [at_band]
        for event in events:
            event.terminal, event.direction = True, -1.0
        if breaking:
            events[0].direction = 1.0
        solution = solve_ivp(
            rate, (t, end), [self.x, self.v], "DOP853", dense_output=True, events=events, rtol=1e-10, atol=1e-14
        )
        assert solution.success, solution.message
        assert solution.sol is not None
        assert solution.t_events is not None
        t_next = float(solution.t[-1]) if solution.status == 1 else end
        self.x, self.v = float(solution.y[0, -1]), float(solution.y[1, -1])
        inside = times[times <= t_next]
        at = np.asarray(solution.sol(inside)[0]) if inside.size else inside
        if solution.status == 1:
            self._end_of_mode(pressure(t_next), t_next, bool(len(solution.t_events[0])))
        return t_next, at

    def _end_of_mode(self, p: float, t: float, at_band: bool) -> None:
        if self.mode == "breaking" and at_band:
            self._enter(t, "slip")
            return
        force = self._force(p, self.x)
        if self.mode == "slip" and abs(force) > self.valve.static_n:
            assert self.sigma * force < 0.0, "creep along the band is not in the reference"
            self.sigma = -self.sigma
            self._enter(t, "breaking")
            return
        self.v = 0.0
        self._enter(t, "stuck")
