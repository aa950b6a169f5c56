"""An extended valve as the controller can use it: plain numbers, worked out of a valve file by `sim.static_inverse`.

    p_s(x)      pressure under which a slide in direction s lands with the stem at x, Pa
    p'_s(x)     pressure at which a stem that rests at x breaks loose in direction s, Pa
    m_s(x)      shortest slide that breaks loose there, m:     p_s(x + s m_s) = p'_s(x)
    y(x)        what is indicated of a stem at x, m

each on an even grid of stem positions from 0 to the stroke, straight in between and beyond. What acts in time is in
`Inverse`: it is not solved for, but led against, waited out or followed.
"""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf
from typing import NamedTuple

Table = tuple[float, ...]
INSTANT_PA_PER_S = 1e9
"""Pa/s: a pressure that changes so fast is there at once."""
SAME_STROKE, SAME_BREAKAWAY = 1e-3, 1.5
"""Share of the stroke, and factor on F_s/A, by which two descriptions of one valve may differ."""


class Inverse(NamedTuple):
    """What undoes effects that act in time, or that no pressure solves for; as given, nothing."""

    lag_s: float = 0.0
    """The pressure follows the command with this time constant, ..."""
    dead_time_s: float = 0.0
    """... after this, ..."""
    filling_pa_per_s: float = inf
    venting_pa_per_s: float = inf
    """... no faster than this, ..."""
    least_pa: float = -inf
    most_pa: float = inf
    """... and stays between these."""
    play_m: float = 0.0
    """The indication stays behind the stem by half of this, whichever way it went last."""
    sensor_lag_s: float = 0.0
    """The indication follows the stem with this time constant."""
    quantum_m: float = 0.0
    """The indication is rounded to multiples of this."""
    drift_per_s: float = 0.0
    """Friction changes by this share each second."""
    yielding_n_per_m: float = inf
    """The stuck stem yields with this stiffness."""
    lowest_m: float = -inf
    highest_m: float = inf
    """The stem stays between these, whatever the pressure: at a stop it says nothing of the balance."""

    @property
    def delays(self) -> bool:
        """Whether the pressure arrives later than its command."""
        return (
            self.lag_s > 0.0
            or self.dead_time_s > 0.0
            or min(self.filling_pa_per_s, self.venting_pa_per_s) < INSTANT_PA_PER_S
        )

    def joined(self, other: "Inverse") -> "Inverse":
        """Return what undoes both."""
        return Inverse(
            lag_s=self.lag_s + other.lag_s,
            dead_time_s=self.dead_time_s + other.dead_time_s,
            filling_pa_per_s=min(self.filling_pa_per_s, other.filling_pa_per_s),
            venting_pa_per_s=min(self.venting_pa_per_s, other.venting_pa_per_s),
            least_pa=max(self.least_pa, other.least_pa),
            most_pa=min(self.most_pa, other.most_pa),
            play_m=self.play_m + other.play_m,
            sensor_lag_s=self.sensor_lag_s + other.sensor_lag_s,
            quantum_m=max(self.quantum_m, other.quantum_m),
            drift_per_s=self.drift_per_s + other.drift_per_s,
            yielding_n_per_m=min(self.yielding_n_per_m, other.yielding_n_per_m),
            lowest_m=max(self.lowest_m, other.lowest_m),
            highest_m=min(self.highest_m, other.highest_m),
        )


@dataclass(frozen=True, slots=True)
class ExtendedValve:
    """The tables of a valve, n values each over the stroke, and what acts in time."""

    name: str
    stroke_m: float
    up_pa: Table = field(repr=False)
    down_pa: Table = field(repr=False)
    breakaway_up_pa: Table = field(repr=False)
    breakaway_down_pa: Table = field(repr=False)
    indicated_m: Table = field(repr=False)
    inverse: Inverse

    def unlike(
        self, stroke_m: float, minimum_pa: float, maximum_pa: float, breakaway_pa: float | None = None
    ) -> str | None:
        """Say why this cannot be the valve of a controller with that stroke, m, those limits and F_s/A, Pa."""
        if abs(self.stroke_m - stroke_m) > SAME_STROKE * stroke_m:
            return f"stroke_m is {self.stroke_m:g} m, the daemon's [valve] has {stroke_m:g} m"
        middle_m = 0.5 * stroke_m
        up_pa, down_pa = (self.breakaway_pa(middle_m, s) for s in (1, -1))
        own_pa, mean_pa = 0.5 * (up_pa - down_pa), 0.5 * (up_pa + down_pa)
        if breakaway_pa is not None and not 1 / SAME_BREAKAWAY < own_pa / breakaway_pa < SAME_BREAKAWAY:
            return f"F_s/A is {own_pa:.0f} Pa, the daemon's [valve] has breakaway_pa = {breakaway_pa:g}: another area?"
        if not minimum_pa <= mean_pa <= maximum_pa:
            allowed = f"{minimum_pa:g} to {maximum_pa:g} Pa"
            return f"it takes {mean_pa:.0f} Pa to the middle of its travel, [pressure] allows {allowed}: another area?"
        return self._out_of_reach(middle_m, mean_pa)

    def _out_of_reach(self, middle_m: float, mean_pa: float) -> str | None:
        """Say why the stem does not get to the middle of its travel, or is not seen there; None if it does and is."""
        inverse, (low_m, high_m) = self.inverse, self.stops_m
        if not inverse.least_pa <= mean_pa <= inverse.most_pa:
            given = f"its supply gives {inverse.least_pa:g} to {inverse.most_pa:g} Pa"
            return f"it takes {mean_pa:.0f} Pa to the middle of its travel, {given}"
        if not low_m < middle_m < high_m:
            return f"the middle of its travel is at {middle_m:g} m, its stops at {low_m:g} and {high_m:g} m"
        seen_m = _value(self.indicated_m, 0.5)
        if not 0.0 < seen_m < self.stroke_m:
            return f"the middle of its travel, {middle_m:g} m, is indicated at {seen_m:g} m"
        for name, hidden_m in (("play", inverse.play_m), ("quantum", inverse.quantum_m)):
            if hidden_m > middle_m:
                return f"what is indicated has a {name} of {hidden_m:g} m, more than half of its travel"
        return None

    @property
    def stops_m(self) -> tuple[float, float]:
        """The ends of the travel that the stem has, m."""
        return max(0.0, self.inverse.lowest_m), min(self.stroke_m, self.inverse.highest_m)

    @property
    def stops_indicated_m(self) -> tuple[float, float]:
        """What is indicated of a stem there, m."""
        low_m, high_m = (_value(self.indicated_m, each / self.stroke_m) for each in self.stops_m)
        return low_m, high_m

    def landing_pa(self, stem_m: float, direction: int) -> float:
        """Return p_s(x), Pa."""
        return _value(self._landing(direction), stem_m / self.stroke_m)

    def breakaway_pa(self, stem_m: float, direction: int) -> float:
        """Return p'_s(x), Pa."""
        table = self.breakaway_up_pa if direction > 0 else self.breakaway_down_pa
        return _value(table, stem_m / self.stroke_m)

    def margin_m(self, stem_m: float, direction: int) -> float:
        """Return m_s(x), m."""
        return max(0.0, direction * (self.lands_m(self.breakaway_pa(stem_m, direction), direction) - stem_m))

    def lands_m(self, pressure_pa: float, direction: int) -> float:
        """Return where a slide in a direction lands under a pressure, m."""
        return _share(self._landing(direction), pressure_pa) * self.stroke_m

    def stem_m(self, indicated_m: float, direction: int) -> float:
        """Return where the stem is, m, that is indicated at a position after moving in a direction (0: unknown)."""
        return _share(self.indicated_m, indicated_m + 0.5 * direction * self.inverse.play_m) * self.stroke_m

    def _landing(self, direction: int) -> Table:
        return self.up_pa if direction > 0 else self.down_pa


def _value(table: Table, share: float) -> float:
    """Return a table's value at a share of the stroke."""
    cells = len(table) - 1
    cell = min(max(int(share * cells), 0), cells - 1)
    return table[cell] + (share * cells - cell) * (table[cell + 1] - table[cell])


def _share(table: Sequence[float], value: float) -> float:
    """Return the share of the stroke at which a rising table has a value."""
    cells = len(table) - 1
    cell = min(max(bisect_left(table, value) - 1, 0), cells - 1)
    return (cell + (value - table[cell]) / (table[cell + 1] - table[cell])) / cells
