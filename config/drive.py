"""Drives: what a force, a torque or a current moves in the place of a pressure, and what turns in the place of a stem.

    m x'' = A u - k_s x - F_v x' - friction          u command, A u its force, x travel

holds for all of them. What u, A, x and the force are called, and in which units people read them, is each kind's own:

    kind            u     A                    x     force    read in
    valve           Pa    diaphragm_area_m2    m     N        kPa, mm, N
    linear          N     1                    m     N        N, mm, N
    linear motor    A     force_n_per_a        m     N        A, mm, N
    rotary          N m   1                    rad   N m      N m, rad, N m
    rotary motor    A     torque_nm_per_a      rad   N m      A, rad, N m
    rotary valve    Pa    torque_nm_per_pa     rad   N m      kPa, deg, N m

Inside the program all have a valve's names. A drive's files have its own: the units at the end of a name are the
drive's, `command_nm` for `command_pa`, `spring_nm_per_rad` for `spring_n_per_m`; a measured `pressure_pa` is `force_n`,
`torque_nm` or `current_a`. Files of the plant, the daemon's and the slave's, have a rotary valve's angles in degrees
(`in_si`); whatever is a measurement or a model is SI.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from math import degrees, radians
from typing import Any, Literal, NamedTuple

from config.errors import InputError

KindName = Literal["valve", "linear", "linear motor", "rotary", "rotary motor", "rotary valve"]
OF_VALVE = ("per", "s", "kg", "m", "m2", "m3", "n", "ns", "ns2", "ms", "pa")
"""Units at the end of a valve's names."""
TURNING: Mapping[str, str] = {
    "m": "rad",
    "m2": "rad2",
    "m3": "rad3",
    "n": "nm",
    "ns": "nms",
    "ns2": "nms2",
    "ms": "rads",
}
"""What these are of what turns,"""
NAMES: Mapping[str, str] = {"mass_kg": "inertia_kg_m2", "stroke_m": "travel_rad"}
"""and what has another name there."""
COLUMNS = ("command_pa", "position_m", "pressure_pa", "reference_m", "load_n", "velocity_m_per_s")
"""Of a recording, with units of a kind's own."""
_NAME = re.compile(rf"\b[a-z]\w*?((?:_(?:{'|'.join(OF_VALVE)}))+)\b(?!\()")


@dataclass(frozen=True, slots=True)
class Scale:
    """How a quantity is read: factor from SI, and its unit."""

    factor: float
    unit: str

    def said(self, value: float, digits: str = ".3g") -> str:
        """Say a value with its unit."""
        return f"{self.number(value, digits)} {self.unit}"

    def number(self, value: float, digits: str = ".3g") -> str:
        """Say a value without its unit."""
        return f"{self.factor * value:{digits}}"


class Quantity(NamedTuple):
    """What commands or moves: its name, its SI unit, and how it is read."""

    word: str
    si: str
    read: Scale


QUANTITIES: Mapping[str, Quantity] = {
    "pa": Quantity("pressure", "Pa", Scale(1e-3, "kPa")),
    "n": Quantity("force", "N", Scale(1.0, "N")),
    "nm": Quantity("torque", "N m", Scale(1.0, "N m")),
    "a": Quantity("current", "A", Scale(1.0, "A")),
    "m": Quantity("position", "m", Scale(1e3, "mm")),
    "rad": Quantity("angle", "rad", Scale(1.0, "rad")),
    "deg": Quantity("angle", "rad", Scale(degrees(1.0), "deg")),
}
"""By the unit at the end of a name."""


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of machine: its names and units."""

    name: KindName
    asked: str
    """The unit at the end of its command's name, and"""
    moved: str
    """of its position's."""
    area: str = ""
    """What A is called; empty: the command is the force."""
    read_in: str = ""
    """The unit in which people read its travel, where that is not its own."""

    @property
    def noun(self) -> str:
        """What it is, as a title begins."""
        return "Valve" if self.name.endswith("valve") else "Drive"

    @property
    def turns(self) -> bool:
        """Whether it turns."""
        return self.moved == "rad"

    @property
    def command(self) -> Quantity:
        """What commands it."""
        return QUANTITIES[self.asked]

    @property
    def travel(self) -> Quantity:
        """What its travel is."""
        return QUANTITIES[self.read_in or self.moved]

    @property
    def force(self) -> Quantity:
        """What holds it back: a force, or a torque."""
        return QUANTITIES["nm" if self.turns else "n"]

    @property
    def length(self) -> Scale:
        """How its travel is read."""
        return self.travel.read

    def own(self, name: str) -> str:
        """Return what a valve's parameter or column is called in this kind's files.

        >>> KINDS["rotary"].own("spring_n_per_m"), KINDS["rotary motor"].own("supply_pa"), KINDS["rotary"].own("name")
        ('spring_nm_per_rad', 'supply_a', 'name')
        """
        if name == "diaphragm_area_m2" and self.area:
            return self.area
        if name == "pressure_pa" and self.asked != "pa":
            return f"{self.command.word}_{self.asked}"
        if self.turns and name in (*NAMES, *NAMES.values()):
            return NAMES.get(name, name)
        return _NAME.sub(self._own_units, name)

    def of_valve(self, name: str) -> str:
        """Return what a name of this kind's files is called in a valve's; a force where the command is one as well.

        >>> KINDS["rotary"].of_valve("force_nm"), KINDS["rotary motor"].of_valve("supply_a")
        ('force_n', 'supply_pa')
        """
        back = {own: unit for unit, own in self._units.items() if own != "n"}
        *words, last = name.split("_")
        units: list[str] = []
        while last in back or last in OF_VALVE:
            units.insert(0, back.get(last, last))
            if not words:
                return name
            *words, last = words
        return "_".join([*words, last, *units])

    def text(self, text: str) -> str:
        """Return a text in which the names of parameters and columns are this kind's own.

        >>> KINDS["rotary"].text("static_n must be at least coulomb_n")
        'static_nm must be at least coulomb_nm'
        """
        return text if self.name == "valve" else _NAME.sub(lambda found: self.own(found[0]), text)

    @property
    def _units(self) -> Mapping[str, str]:
        """Its units by those of a valve, where they are others; the command's first, a force goes before it."""
        return {"pa": self.asked, **(TURNING if self.turns else {})}

    def _own_units(self, found: "re.Match[str]") -> str:
        begin = found[0].removesuffix(found[1])
        return "_".join([begin, *(self._units.get(each, each) for each in found[1].split("_")[1:])])


KINDS: Mapping[str, Kind] = {
    each.name: each
    for each in (
        Kind("valve", "pa", "m", "diaphragm_area_m2"),
        Kind("linear", "n", "m"),
        Kind("linear motor", "a", "m", "force_n_per_a"),
        Kind("rotary", "nm", "rad"),
        Kind("rotary motor", "a", "rad", "torque_nm_per_a"),
        Kind("rotary valve", "pa", "rad", "torque_nm_per_pa", "deg"),
    )
}
VALVE, ROTARY = KINDS["valve"], KINDS["rotary valve"]


def kind_of_columns(names: Collection[str]) -> Kind:
    """Return the kind whose command and travel are among the names of columns; a valve if no drive's are."""
    for kind in KINDS.values():
        moved = {kind.own("position_m"), kind.own("velocity_m_per_s")} & set(names)
        if kind.own("command_pa") in names and moved:
            return kind
    return VALVE


IN_DEGREES: Mapping[str, str] = {
    ROTARY.own(name).replace("rad", "deg"): name
    for name in (
        "position_m",
        "noise_std_m",
        "quantum_m",
        "by_m",
        "b_over_c_pa_per_m",
        "coulomb_n",
        "static_n",
        "viscous_ns_per_m",
        "spring_n_per_m",
    )
}
"""Names that a rotary valve has in the plant's files, in degrees or as torques, and what they are called inside."""
WRITTEN: Mapping[str, str] = {name: own for own, name in IN_DEGREES.items()}
"""The same the other way."""
SCALED: Mapping[str, float] = {"scale": 1.0, "offset": 0.0}
"""Of a place in a device's registers, with what stands for it where nobody says."""


def in_si(tables: Any, source: str, *path: str) -> Any:
    """Return the tables of a rotary valve's file with the names and units that are used inside.

    A place in a device's registers keeps its raw numbers: its scale and its offset are what is in degrees.

    Raises:
        InputError: a name of what has a stem; says what is in its place.

    >>> in_si({"position_deg": {"address": 3, "scale": 90.0}}, "site.toml")
    {'position_m': {'address': 3, 'scale': 1.5707963267948966, 'offset': 0.0}}
    """
    if isinstance(tables, list | tuple):
        return [in_si(each, source, *path) for each in tables]
    if not isinstance(tables, dict):
        return tables
    told: dict[str, Any] = {}
    for key, value in tables.items():
        if key in WRITTEN:
            raise InputError(source, f"{'.'.join((*path, key))}: a rotary valve has {WRITTEN[key]} in its place")
        told[IN_DEGREES.get(key, key)] = (
            _times(value, _si_of(key)) if key in IN_DEGREES else in_si(value, source, *path, key)
        )
    return told


def require_degrees(device: Any, source: str, key: str) -> None:
    """Refuse a rotary valve's table of a device, by its key, that says no map: by default one is in metres.

    Raises:
        InputError: says what to write.
    """
    bus = device.get("bus", device.get("kind", "modbus")) if isinstance(device, dict) else "modbus"
    if bus in ("modbus", "rtu", "canopen") and not (isinstance(device, dict) and "map" in device):
        raise InputError(
            source, f"{key}.map: is required of a rotary valve, with position_deg: by default it is in metres"
        )


def as_written(kind: Kind, name: str, value: Any) -> tuple[str, Any]:
    """Return a key of the plant's files and its value as a kind has them there.

    >>> as_written(ROTARY, "b_over_c_pa_per_m", 1800.0)
    ('b_over_c_pa_per_deg', 31.41592653589793)
    """
    if kind is not ROTARY or name not in WRITTEN:
        return name, value
    return WRITTEN[name], _times(value, 1.0 / _si_of(WRITTEN[name]))


def _si_of(name: str) -> float:
    """Return what one of a name's own unit is in SI."""
    if name.endswith("_per_deg"):
        return degrees(1.0)
    return radians(1.0) if name.endswith("_deg") else 1.0


def _times(value: Any, factor: float) -> Any:
    if isinstance(value, dict):
        return value | {key: _times(value.get(key, other), factor) for key, other in SCALED.items()}
    return factor * value if isinstance(value, int | float) and not isinstance(value, bool) else value
