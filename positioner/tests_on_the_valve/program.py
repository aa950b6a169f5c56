"""What is played on the valve for a test: a sequence of commands, and how far the stem may go by it.

A program is a played experiment (`positioner.control.played_experiment`), which holds its permissives, its window and
the way back: no test has a way of its own to move the valve.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

from config.codes import ExperimentState, ValveTestVerdict
from config.errors import InputError
from config.recording import Recording

"""What every program must stay inside: those of the experiments."""
SHORTEST_S = 1e-3
"""Between two points, which must follow each other."""
FLOAT32 = 2.0**-23
"""Times go as float32: each is off by as much of itself, so that a short leap late in a program would be too fast."""


Range = tuple[str, float, float, float]
"""An option, its value, and the least and the most that it may be."""


def require_within(ranges: Iterable[Range], of: str = "") -> None:
    """Refuse what cannot be.

    Raises:
        InputError: names the first option beyond its range, the value and what is allowed.
    """
    for option, value, low, high in ranges:
        if not low <= value <= high:
            raise InputError(option, f"allowed is {low:g} to {high:g}{of}, got {value:g}")


@dataclass(frozen=True, slots=True)
class Program:
    """Times from 0 up, s, and commands, Pa.

    Attributes:
        turn_m: travel from where it begins at which it turns and retraces its way; 0: none.
        band_m: travel from there beyond which it is broken off; 0: the file's window alone.
    """

    name: str
    points: tuple[tuple[float, float], ...]
    turn_m: float = 0.0
    band_m: float = 0.0

    @property
    def lasts_s(self) -> float:
        """How long it takes, without the way to its first command, s."""
        return self.points[-1][0]


@dataclass(frozen=True, slots=True)
class Leap:
    """The next command of a sequence, Pa, how long it is held, s, and the rate of the way there if it has its own."""

    to_pa: float
    held_s: float
    rate_pa_per_s: float | None = None


@dataclass(frozen=True, slots=True)
class Played:
    """What was recorded of a program, and what became of it; without a recording `problem` says why."""

    recording: Recording | None
    state: ExperimentState
    problem: str = ""

    @property
    def broken_off(self) -> list[ValveTestVerdict]:
        """By what it was broken off; nothing where it came to its end."""
        if self.state.played:
            return []
        beyond = self.state in (ExperimentState.BEYOND_BAND, ExperimentState.OUTSIDE_WINDOW)
        return [ValveTestVerdict.TRAVEL_EXCEEDED if beyond else ValveTestVerdict.BROKEN_OFF]


class Player(Protocol):
    """Plays programs on a valve, in whatever world it is."""

    def command_pa(self) -> float:
        """Return the command in force, Pa."""
        ...

    def play(self, program: Program) -> Played:
        """Play one to its end."""
        ...


def ramped(
    name: str,
    start_pa: float,
    leaps: Sequence[Leap],
    rate_pa_per_s: float,
    *,
    turn_m: float = 0.0,
    band_m: float = 0.0,
) -> Program:
    """Return a program that begins at the command in force; leaps without a rate have this one."""
    points = [(0.0, start_pa)]
    for leap in leaps:
        time_s, before_pa = points[-1]
        if leap.to_pa != before_pa:
            way_s = abs(leap.to_pa - before_pa) / (leap.rate_pa_per_s or rate_pa_per_s)
            time_s += max(SHORTEST_S, way_s) + 2.0 * FLOAT32 * time_s
            points.append((time_s, leap.to_pa))
        if leap.held_s > 0.0:
            points.append((time_s + leap.held_s, leap.to_pa))
    return Program(name, tuple(points), turn_m, band_m)
