"""The first look at a device: can its numbers be what the file takes them for? Nothing is commanded before.

A map that is a little wrong gives numbers that look well: words in the wrong order read as 2.9e-18 m, which lies inside
every travel; a scale ten times off reads as a pressure ten times that which is held. `impossible` is what the daemon
does not start with, `doubts` what `probe` and `doctor` say besides. One reading cannot tell the scale of the position
unless a law is known: then the balance of the stem at rest does,

    x = (p - p_0 +- m k) / s      s = -b/c, p_0 the offset, k = abs(k/c), m a margin for static friction
"""

import math

from config.daemon_file import DaemonFile, LawTable
from config.device import ModbusDevice
from config.drive import Scale
from config.modbus_map import Place
from drivers.boundary import Reading
from positioner.control.supervision import Limits

PASCAL = Scale(1.0, "Pa")
LEAST_SHARE = 1e-7
"""Of a stroke or a range of pressures: no device resolves less, so that a number below, and not 0, is none."""
MOST_SPANS = 5.0
"""Above the greatest command, of the range of commands: no supply that fills the actuator is so far above."""
VACUUM_PA = -101_325.0
"""No gauge pressure is lower."""
TEN_TIMES = (1e-3, 1e-2, 1e-1, 10.0, 100.0, 1e3)
SAME = 0.03
"""Deviation within which a ratio is a power of ten: a pressure at rest is its command within less."""
SHARE_OF_SPAN = 0.05
"""Of the range of commands, that one of two compared pressures must have: near 0 a ratio says nothing."""
STATIC_FRICTION = 1.5
"""Over Coulomb friction, inside which a stem may rest."""
BALANCE_MARGIN = 0.02
"""Of the stroke, round where a stem may rest."""


def impossible(file: DaemonFile, held_pa: float, reading: Reading, limits: Limits) -> str:
    """Return why position or command cannot be what they are taken for, by key and value; empty where they can."""
    least_m, span_pa = LEAST_SHARE * limits.stroke_m, file.pressure.maximum_pa - file.pressure.minimum_pa
    position_m, read = reading.position_m, file.valve.plain
    if not limits.plausible(position_m) or 0 < abs(position_m) < least_m:
        margin_m = limits.travel_margin * limits.stroke_m
        return (
            f"device.map.{file.valve.place}: the device says {read.said(position_m, 'g')}, "
            f"allowed is {read.number(-margin_m, 'g')} to {read.said(limits.stroke_m + margin_m, 'g')} "
            f"(valve.{file.valve.length} and safety.travel_margin); "
            f"{_other_orders(file, 'position_m', position_m, (least_m, limits.stroke_m), read)}"
        )
    low_pa, high_pa, least_pa = file.pressure.minimum_pa, file.pressure.maximum_pa, LEAST_SHARE * span_pa
    if not low_pa <= held_pa <= high_pa or 0 < abs(held_pa) < least_pa:
        return (
            f"device.map.command_pa: the device holds {held_pa:g} Pa, allowed is {low_pa:g} to {high_pa:g} Pa "
            f"([pressure]); {_other_orders(file, 'command_pa', held_pa, (max(least_pa, low_pa), high_pa), PASCAL)}"
        )
    return ""


def doubts(file: DaemonFile, held_pa: float, reading: Reading) -> str:
    """Return what else of a reading is hardly so, with the key that would explain it; empty where nothing is."""
    return (
        _pressure_doubt(file, held_pa, reading.pressure_pa)
        or _position_doubt(file, held_pa, reading)
        or _registers_doubt(file)
    )


def travel_in_registers(file: DaemonFile) -> str:
    """Return what the register of the position holds at both ends of the travel; empty where it holds any number."""
    place = _place(file, "position_m")
    if place is None or place.is_float:
        return ""
    return f"its travel is {place.raw(0.0):.0f} to {place.raw(file.valve.stroke_m):.0f} in its register"


def _pressure_doubt(file: DaemonFile, held_pa: float, shown_pa: float | None) -> str:
    if shown_pa is None:
        return ""
    maximum_pa, span_pa = file.pressure.maximum_pa, file.pressure.maximum_pa - file.pressure.minimum_pa
    most_pa, least_pa = maximum_pa + MOST_SPANS * span_pa, LEAST_SHARE * span_pa
    if not VACUUM_PA <= shown_pa <= most_pa or 0 < abs(shown_pa) < least_pa:
        fits = _other_orders(file, "pressure_pa", shown_pa, (least_pa, most_pa), PASCAL)
        return f"device.map.pressure_pa: it shows {shown_pa:g} Pa, commands go up to {maximum_pa:g} Pa; {fits}"
    if held_pa <= 0 or max(held_pa, shown_pa) < SHARE_OF_SPAN * span_pa:
        return ""
    ratio = shown_pa / held_pa
    times = next((each for each in TEN_TIMES if math.isclose(ratio, each, rel_tol=SAME)), None)
    if times is None:
        return ""
    keys = "device.map.pressure_pa.scale, or command_pa.scale"
    return f"it shows {shown_pa:g} Pa, {times:g} times the {held_pa:g} Pa that it holds: {keys}?"


def _position_doubt(file: DaemonFile, held_pa: float, reading: Reading) -> str:
    """Hold the position against the law that is typed in, if one is."""
    law = file.law
    if law is None or law.b_over_c_pa_per_m is None or law.k_over_c_pa is None:
        return ""
    pressure_pa = held_pa if reading.pressure_pa is None else reading.pressure_pa
    low_m, high_m = _resting_m(law, law.b_over_c_pa_per_m, law.k_over_c_pa, pressure_pa, file.valve.stroke_m)
    position_m = file.valve.travel.turned_m(reading.position_m)
    if low_m <= position_m <= high_m:
        return ""
    read = file.valve.plain
    for times in TEN_TIMES:
        if low_m <= position_m / times <= high_m:
            return (
                f"position {read.said(position_m, 'g')} is {times:g} times what [law] has at {pressure_pa:g} Pa, "
                f"{read.number(max(low_m, 0), 'g')} to {read.said(high_m, 'g')}: "
                f"device.map.{file.valve.place}.scale, or valve.{file.valve.length}?"
            )
    return ""


def _resting_m(
    law: LawTable, b_over_c: float, k_over_c: float, pressure_pa: float, stroke_m: float
) -> tuple[float, float]:
    """Return between which positions the stem may rest at a pressure."""
    half_pa = STATIC_FRICTION * abs(k_over_c)
    beside = sorted((pressure_pa - law.offset_pa + each) / -b_over_c for each in (-half_pa, half_pa))
    return beside[0] - BALANCE_MARGIN * stroke_m, beside[1] + BALANCE_MARGIN * stroke_m


def _registers_doubt(file: DaemonFile) -> str:
    """Return which register cannot hold what it must."""
    needed = (
        ("position_m", file.valve.place, file.valve.stroke_m, file.valve.plain, f"valve.{file.valve.length}"),
        ("command_pa", "command_pa", file.pressure.maximum_pa, PASCAL, "pressure.maximum_pa"),
    )
    for name, own, most, read, key in needed:
        place = _place(file, name)
        if place is None:
            continue
        raw = place.raw(most)
        try:
            place.format.encode(raw)
        except ValueError:
            return (
                f"device.map.{own}: {read.said(most, 'g')} ({key}) would be {raw:g}, more than {place.type} holds: "
                f"device.map.{own}.scale?"
            )
    return ""


def _place(file: DaemonFile, name: str) -> Place | None:
    return file.device.map.places.get(name) if isinstance(file.device, ModbusDevice) else None


def _other_orders(file: DaemonFile, name: str, value: float, allowed: tuple[float, float], read: Scale) -> str:
    """Say in which other order of words and bytes the same registers would say what is allowed."""
    place = _place(file, name)
    others = {} if place is None or not math.isfinite(value) else place.in_other_orders(value)
    fitting = [
        f"{keys} would read {read.said(other, 'g')}" for keys, other in others.items() if _within(other, allowed)
    ]
    return ", ".join(fitting) or "check the map"


def _within(value: float, allowed: tuple[float, float]) -> bool:
    return allowed[0] <= value <= allowed[1]
