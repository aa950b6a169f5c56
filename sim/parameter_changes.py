"""Parameters that change while the valve works: a step, or a straight drift over a while (friction ageing).

    p(t) = p_0 + (p_1 - p_0) min((t - at) / over, 1),   t >= at

p_0 is the value at `at`, whatever brought it there; a later change takes over from one still under way.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from config.errors import InputError
from config.slave_file import Change


@dataclass(frozen=True, slots=True)
class _Drift:
    """One parameter on its way to a new value."""

    start_s: float
    over_s: float
    old: float
    new: float

    @property
    def end_s(self) -> float:
        return self.start_s + self.over_s

    def at(self, time_s: float) -> float:
        if time_s >= self.end_s:
            return self.new
        return self.old + (self.new - self.old) * (time_s - self.start_s) / self.over_s


class Changes:
    """The changes of a slave file as functions of time.

    Args:
        changes: what the file says, in any order.
        initial: the valve's parameters at time 0, by name.

    Raises:
        InputError: static friction would at some time fall below Coulomb friction.
    """

    def __init__(self, changes: Sequence[Change], initial: Mapping[str, float]) -> None:
        self._initial = dict(initial)
        self._drifts: dict[str, list[_Drift]] = {}
        for change in sorted(changes, key=lambda each: each.at_s):
            for name, new in change.targets.items():
                old = self._value(name, change.at_s)
                self._drifts.setdefault(name, []).append(_Drift(change.at_s, change.over_s, old, new))
        self._refuse_static_below_coulomb()

    def at(self, time_s: float) -> dict[str, float]:
        """Return the value at a time of each parameter that ever changes, by name."""
        return {name: self._value(name, time_s) for name in self._drifts}

    def quiet_until_s(self, time_s: float) -> float:
        """Return when the next value differs from now: now while one drifts, infinity when all is done."""
        drifts = [drift for each in self._drifts.values() for drift in each if drift.end_s > time_s]
        return max(time_s, min((drift.start_s for drift in drifts), default=math.inf))

    def _value(self, name: str, time_s: float) -> float:
        started = [drift for drift in self._drifts.get(name, ()) if drift.start_s <= time_s]
        return started[-1].at(time_s) if started else self._initial[name]

    def _refuse_static_below_coulomb(self) -> None:
        """Look at every bend: between two of them both frictions run straight."""
        drifts = [drift for each in self._drifts.values() for drift in each]
        for time_s in sorted({time_s for drift in drifts for time_s in (drift.start_s, drift.end_s)}):
            coulomb_n, static_n = self._value("coulomb_n", time_s), self._value("static_n", time_s)
            if static_n < coulomb_n:
                problem = f"at {time_s:g} s static_n is {static_n:g} N, below coulomb_n ({coulomb_n:g} N)"
                raise InputError("change", problem)
