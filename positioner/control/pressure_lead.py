"""The dynamic inverse of an extended valve: the command that brings its pressure quickly to where a law wants it.

    T p' = u - p,   -r_v <= p' <= r_f,   p of the actuator a dead time later

A model p of the pressure is carried along with the commands, each held for a period h. Over it, e = exp(-h/T),

    p+ = p + (1 - e) (u - p),   so that   u = p + (w' - p)/(1 - e)

brings p to w' within the period, or with the command at its limit as near as it gets. It leads to w' = w - 0.02 dw
only, dw being the change wanted: what the time constant is known amiss by must not take the stem too far, for it would
stay there. The last 0.02 dw come by themselves under u = w. Rate limit and dead time have no lead: they are waited out.
A rest before the pressure has arrived (but for 0.002 dw) is none.
"""

from math import exp, inf
from typing import NamedTuple

from config.extended_valve import Inverse
from positioner.control.pressure_clamp import clamped

LEFT = 0.02
"""Of the change: not led to."""
ARRIVED = 2e-3
"""Of the change: a pressure nearer than this has arrived."""


class PathMemory(NamedTuple):
    """The pressure as the model has it, dead time apart: Pa, s."""

    wanted_pa: float
    """By the law."""
    pressure_pa: float
    change_pa: float
    """From where the pressure was when the wanted one changed."""
    command_pa: float
    """In force since the last step, ..."""
    now_s: float
    """... at this time."""
    arrived_s: float
    """When the model arrived; infinite: not yet."""

    def has_arrived(self, now_s: float, inverse: Inverse) -> bool:
        """Whether the pressure in the actuator is the wanted one."""
        return now_s - self.arrived_s >= inverse.dead_time_s


def long_held(pressure_pa: float, now_s: float = 0.0) -> PathMemory:
    """Return the memory, at a time, of a command long held."""
    return PathMemory(
        wanted_pa=pressure_pa,
        pressure_pa=pressure_pa,
        change_pa=0.0,
        command_pa=pressure_pa,
        now_s=now_s,
        arrived_s=-inf,
    )


def after_step(
    memory: PathMemory, now_s: float, wanted_pa: float, inverse: Inverse, limits_pa: tuple[float, float], *, lead: bool
) -> PathMemory:
    """Return the memory after one step; its `command_pa` is the command, Pa, to be given.

    Args:
        memory: after the step before.
        now_s: time of this one; the command is held until the next, about as long after it as the last was before.
        wanted_pa: the pressure that the law wants.
        inverse: of the valve.
        limits_pa: of the command.
        lead: whether the command may go beyond what is wanted.
    """
    h = now_s - memory.now_s
    pressure_pa = _carried(memory.pressure_pa, memory.command_pa, h, inverse)
    change_pa = memory.change_pa
    if wanted_pa != memory.wanted_pa:
        change_pa = wanted_pa - pressure_pa
    to_go_pa = wanted_pa - pressure_pa
    arrived = abs(to_go_pa) <= ARRIVED * abs(change_pa)
    command_pa = wanted_pa
    if lead and inverse.lag_s > 0.0 and h > 0.0 and abs(to_go_pa) > 2.0 * LEFT * abs(change_pa):
        led_pa = pressure_pa + (to_go_pa - LEFT * change_pa) / (1.0 - exp(-h / inverse.lag_s))
        command_pa = clamped(led_pa, *limits_pa)
    arrived_s = inf
    if arrived:
        arrived_s = min(memory.arrived_s, now_s) if wanted_pa == memory.wanted_pa else now_s
    return PathMemory(
        wanted_pa=wanted_pa,
        pressure_pa=pressure_pa,
        change_pa=change_pa,
        command_pa=command_pa,
        now_s=now_s,
        arrived_s=arrived_s,
    )


def _carried(pressure_pa: float, command_pa: float, h: float, inverse: Inverse) -> float:
    """Return the model's pressure after a command held for h, s."""
    share = 1.0 - exp(-h / inverse.lag_s) if inverse.lag_s > 0.0 else 1.0
    change_pa = share * (command_pa - pressure_pa)
    return pressure_pa + min(max(change_pa, -inverse.venting_pa_per_s * h), inverse.filling_pa_per_s * h)
