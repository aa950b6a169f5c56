"""Drives: what a force, a torque or a current moves in the place of a pressure, and what turns in the place of a stem.

    m x'' = A u - k_s x - F_v x' - friction          u command, A u its force, x travel

holds for all of them. What u, A, x and the force are called, and in which units people read them, is each kind's own:

    kind            u     A                    x     force    read in
    valve           Pa    diaphragm_area_m2    m     N        kPa, mm, N
    linear          N     1                    m     N        N, mm, N
    linear motor    A     force_n_per_a        m     N        A, mm, N
    rotary          N m   1                    rad   N m      N m, rad, N m
    rotary motor    A     torque_nm_per_a      rad   N m      A, rad, N m

Inside the program all have a valve's names. A drive's files have its own: the units at the end of a name are the
drive's, `command_nm` for `command_pa`, `spring_nm_per_rad` for `spring_n_per_m`; a measured `pressure_pa` is `force_n`,
`torque_nm` or `current_a`.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Literal

KindName = Literal["valve", "linear", "linear motor", "rotary", "rotary motor"]
Ending = Mapping[str, str]
_WORD = re.compile(r"\b[a-z]\w*?((?:_(?:per|kg|ms?|m\d|n|ns\d?|pa|s))+)\b(?!\()")
"""A name that ends in units; these are all that follow its last other word."""
LINEAR: Ending = {}
ROTARY: Ending = {"m": "rad", "m2": "rad2", "m3": "rad3", "n": "nm", "ns": "nms", "ns2": "nms2", "ms": "rads"}
"""What units of what slides are of what turns."""
KEPT = ("per", "s", "kg", "m", "m2", "m3", "n", "ns", "ns2", "ms")
SI: Ending = {"pa": "Pa", "n": "N", "nm": "N m", "a": "A", "m": "m", "rad": "rad"}
NAMES: Mapping[str, str] = {"mass_kg": "inertia_kg_m2", "stroke_m": "travel_rad"}
"""Of what turns, beyond the units."""


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


MILLIMETRES, NEWTONS = Scale(1e3, "mm"), Scale(1.0, "N")


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of machine: its names and units."""

    name: KindName
    command: Scale
    length: Scale
    force: Scale
    area: str
    """What A is called; empty: the command is the force."""
    asked: str
    """The unit at the end of a command's name."""
    lengths: str
    """The unit at the end of a position's name."""
    words: tuple[str, str] = ("position", "pressure")
    """What its travel and its command are called."""

    @property
    def noun(self) -> str:
        """What it is, as a title begins."""
        return "Valve" if self.name == "valve" else "Drive"

    @property
    def turns(self) -> bool:
        """Whether it turns."""
        return self.lengths == "rad"

    @property
    def command_unit(self) -> str:
        """The SI unit of its command."""
        return SI[self.asked]

    def own(self, name: str) -> str:
        """Return what a valve's parameter or column is called in this kind's files.

        >>> KINDS["rotary"].own("spring_n_per_m"), KINDS["rotary motor"].own("supply_pa"), KINDS["rotary"].own("name")
        ('spring_nm_per_rad', 'supply_a', 'name')
        """
        if name == "diaphragm_area_m2" and self.area:
            return self.area
        if name == "pressure_pa" and self.asked != "pa":
            return f"{self.words[1]}_{self.asked}"
        if self.turns and name in (*NAMES, *NAMES.values()):
            return NAMES.get(name, name)
        return _WORD.sub(self._own_units, name)

    def of_valve(self, name: str) -> str:
        """Return what a name of this kind's files is called in a valve's; a force where the command is one as well.

        >>> KINDS["rotary"].of_valve("force_nm"), KINDS["rotary motor"].of_valve("supply_a")
        ('force_n', 'supply_pa')
        """
        back = {own: unit for unit, own in self._units.items() if own != "n"}
        *words, last = name.split("_")
        units: list[str] = []
        while last in back or last in KEPT:
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
        return text if self.name == "valve" else _WORD.sub(lambda found: self.own(found[0]), text)

    @property
    def _units(self) -> Ending:
        """Its units by those of a valve, where they are others; the command's first."""
        return {"pa": self.asked, **(ROTARY if self.turns else LINEAR)}

    def _own_units(self, found: "re.Match[str]") -> str:
        begin = found[0].removesuffix(found[1])
        return "_".join([begin, *(self._units.get(each, each) for each in found[1].split("_")[1:])])


KINDS: Mapping[str, Kind] = {
    each.name: each
    for each in (
        Kind("valve", Scale(1e-3, "kPa"), MILLIMETRES, NEWTONS, "diaphragm_area_m2", "pa", "m"),
        Kind("linear", NEWTONS, MILLIMETRES, NEWTONS, "", "n", "m", ("position", "force")),
        Kind("linear motor", Scale(1.0, "A"), MILLIMETRES, NEWTONS, "force_n_per_a", "a", "m", ("position", "current")),
        Kind("rotary", Scale(1.0, "N m"), Scale(1.0, "rad"), Scale(1.0, "N m"), "", "nm", "rad", ("angle", "torque")),
        Kind(
            "rotary motor",
            Scale(1.0, "A"),
            Scale(1.0, "rad"),
            Scale(1.0, "N m"),
            "torque_nm_per_a",
            "a",
            "rad",
            ("angle", "current"),
        ),
    )
}
VALVE = KINDS["valve"]
COLUMNS = ("command_pa", "position_m", "pressure_pa", "reference_m", "load_n", "velocity_m_per_s")
"""Of a recording, with units of a kind's own."""


def kind_of_columns(names: Collection[str]) -> Kind:
    """Return the kind whose command and travel are among the names of columns; a valve if no drive's are."""
    for kind in KINDS.values():
        moved = {kind.own("position_m"), kind.own("velocity_m_per_s")} & set(names)
        if kind.own("command_pa") in names and moved:
            return kind
    return VALVE
