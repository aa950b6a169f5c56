"""The response of a valve to a series of commands, each held over its period, in compiled calls.

Row 0 is the start; row i > 0 is the END of the i-th period. `command_pa` of a row is the command held FROM that time
on (sampled, then commanded), so the last row repeats the last command; `pressure_pa` is the actuator pressure that has
been acting up to that time, before the new command.
"""

from dataclasses import dataclass
from math import isfinite

import numpy as np
import numpy.typing as npt

from config.errors import InputError
from config.results.result import Brief
from sim.composition import Composition
from sim.karnopp import TOLERANCE, Vector

STEP_S = 1e-5
PATH_ROWS, PRESSURE, INDICATED = 5, 1, 4
"""Rows that the kernel writes: t, p, x, v, indicated; which of them are the second and the last."""
STEPS_AT_ONCE, PERIODS_AT_ONCE = 100_000, 10_000
"""In one compiled call: steps of the integration, some 5 ms, for nobody can break one off; rows that are copied."""


@dataclass(frozen=True, slots=True, repr=False)
class Response(Brief):
    """Arrays of n + 1 rows for n periods; see the head of this module."""

    time_s: Vector
    command_pa: Vector
    pressure_pa: Vector
    position_m: Vector
    velocity_m_per_s: Vector
    indicated_m: Vector


def respond(
    composition: Composition,
    theta: npt.ArrayLike,
    command_pa: npt.ArrayLike,
    period_s: npt.ArrayLike,
    *,
    position_m: float = 0.0,
    pressure_pa: float = 0.0,
    step_s: float = STEP_S,
) -> Response:
    """Simulate from rest at a position with a pressure long held; the way to try many parameter vectors.

    Args:
        composition: the valve.
        theta: its parameter vector, `composition.names`; not checked for physics.
        command_pa: n commands, Pa.
        period_s: one period for all, or n periods, s.
        position_m: where it starts at rest.
        pressure_pa: the command held before.
        step_s: longest step of the integration.

    Raises:
        ValueError: a series of another length, or a number that is not finite or not allowed.
    """
    vector = np.array(theta, dtype=np.float64)
    if vector.shape != composition.theta.shape:
        raise ValueError(f"theta must have the {composition.theta.size} entries {', '.join(composition.names)}")
    state = at_rest(composition, vector, 0.0, position_m, pressure_pa)
    return follow(composition, vector, state, command_pa, period_s, step_s)


def at_rest(composition: Composition, theta: Vector, time_s: float, position_m: float, pressure_pa: float) -> Vector:
    """Return the state, (state_size,), at rest at a position, m, the command pressure_pa, Pa, long held.

    Raises:
        ValueError: a number that is not finite.
    """
    if not (isfinite(time_s) and isfinite(position_m) and isfinite(pressure_pa)):
        raise ValueError(f"position and pressure must be finite, got {position_m} m and {pressure_pa} Pa")
    state = np.zeros(composition.state_size)
    composition.rest(theta, state, time_s, position_m, pressure_pa)
    return state


def follow(
    composition: Composition,
    theta: Vector,
    state: Vector,
    command_pa: npt.ArrayLike,
    period_s: npt.ArrayLike,
    step_s: float,
    tolerance: float = TOLERANCE,
) -> Response:
    """Carry the state, (state_size,), in place through n commands, Pa, (n,) or one for all; columns of (n + 1,).

    `sim.karnopp` says what the tolerance is of; the periods, s, are (n,) or one for all.

    Raises:
        ValueError: as `respond`.
        InputError: as `require_numbers`.
    """
    commands = check_commands(command_pa)
    periods = check_periods(period_s, commands)
    longest_step_s = check_step(step_s)
    path, written = (
        np.empty((PATH_ROWS, commands.size + 1)),
        np.empty(PATH_ROWS * (min(commands.size, PERIODS_AT_ONCE) + 1)),
    )
    begin = 0
    while begin < commands.size:
        end = _end_of_call(periods, begin, longest_step_s)
        held, rows = slice(begin, end), slice(begin, end + 1)
        piece = written[: PATH_ROWS * (end + 1 - begin)].reshape(PATH_ROWS, -1)
        composition.kernel.respond(theta, state, commands[held], periods[held], longest_step_s, tolerance, piece)
        path[:, rows] = piece
        begin = end
    commanded = np.append(commands, commands[-1])
    time, pressure, position, velocity, indicated = path
    require_numbers(composition, time, position, indicated)
    return Response(time, commanded, pressure, position, velocity, indicated)


def _end_of_call(periods_s: Vector, begin: int, longest_step_s: float) -> int:
    """Return where a compiled call from a period on ends: one period later at the least."""
    count = PERIODS_AT_ONCE
    while count > 1 and periods_s[begin : begin + count].sum() > STEPS_AT_ONCE * longest_step_s:
        count //= 2
    return min(begin + count, periods_s.size)


def require_numbers(composition: Composition, time_s: Vector, *answers: Vector) -> None:
    """Check what a valve was simulated to do, each (n,) as the times, s: nothing of it may pass for an answer else.

    Raises:
        InputError: one holds what is no finite number, as an effect of one's own may make it; says from when on.
    """
    if not all(np.isfinite(each).all() for each in answers):
        lost = np.flatnonzero(~np.isfinite(answers).all(axis=0))
        effects = ", ".join(each.name for each in composition.effects) or "none"
        raise InputError(
            composition.source,
            f"nobody can say where the stem is from {time_s[lost[0]]:g} s on: a force, friction, pressure or "
            f"indication is no finite number there; its effects: {effects}",
        )


def check_commands(command_pa: npt.ArrayLike) -> Vector:
    """Return a series of commands, Pa, (n,), as the kernel takes it: a copy.

    Raises:
        ValueError: it is empty, or holds what is not a finite number.
    """
    commands = np.array(command_pa, dtype=np.float64, ndmin=1)
    if commands.ndim != 1 or commands.size == 0 or not np.isfinite(commands).all():
        raise ValueError("command_pa must be a series of at least one finite number")
    return commands


def check_periods(period_s: npt.ArrayLike, commands: Vector) -> Vector:
    """Return the periods, s, of the commands, (n,), as the kernel takes them: a copy.

    Raises:
        ValueError: one is not a positive number, or their number is another.
    """
    periods = np.array(np.broadcast_to(np.asarray(period_s, dtype=np.float64), commands.shape))
    if not (np.isfinite(periods).all() and (periods > 0.0).all()):
        raise ValueError("period_s must be finite and greater than 0")
    return periods


def check_step(step_s: float) -> float:
    """Return a step of the integration.

    Raises:
        ValueError: it is not a positive number.
    """
    if not (np.isfinite(step_s) and step_s > 0.0):
        raise ValueError(f"step_s must be finite and greater than 0, got {step_s}")
    return float(step_s)
