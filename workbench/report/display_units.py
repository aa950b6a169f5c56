"""Units that people at a plant use, each with the SI value beside it."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite

from config.drive import VALVE, Kind

FINE_M = 1e-5
"""Below it three decimals of a millimetre say too little."""
SUFFIXES = {
    "_ns2_per_m2": (1.0, "N s²/m²"),
    "_n_per_m3": (1.0, "N/m³"),
    "_n_per_m2": (1.0, "N/m²"),
    "_n_per_pa": (1e3, "N/kPa"),
    "_n_per_m": (1e-3, "N/mm"),
    "_ns_per_m": (1.0, "N s/m"),
    "_pa_per_s": (1e-3, "kPa/s"),
    "_m_per_s": (1e3, "mm/s"),
    "_per_m": (1e-3, "1/mm"),
    "_per_pa": (1e3, "1/kPa"),
    "_per_s": (1.0, "1/s"),
    "_m2": (1e4, "cm²"),
    "_kg": (1.0, "kg"),
    "_pa": (1e-3, "kPa"),
    "_m": (1e3, "mm"),
    "_n": (1.0, "N"),
    "_s": (1.0, "s"),
}
"""Endings of parameter names, the longest first: factor from SI, and the unit shown."""

BASE = {
    "spring": "spring stiffness",
    "viscous": "viscous friction",
    "coulomb": "sliding (Coulomb) friction",
    "static": "break-away (static) friction",
    "mass": "moving mass",
    "stribeck_velocity": "Stribeck velocity",
}
"""The bare valve's parameters, without their endings."""


@dataclass(frozen=True, slots=True)
class Shown:
    """A number as it is read, and in SI for the tooltip."""

    text: str
    si: str = ""


def force(value_n: float | None) -> Shown:
    """Show a force in N."""
    return Shown("–") if value_n is None or not isfinite(value_n) else Shown(f"{value_n:.4g}", f"{value_n:.6g} N")


@dataclass(frozen=True, slots=True)
class Quantity:
    """What errors are of: how one is shown, the factor from SI, the unit shown and the SI unit."""

    shown: Callable[[float | None], Shown]
    factor: float
    unit: str
    si: str


FORCE = Quantity(force, 1.0, "N", "N")


@dataclass(frozen=True, slots=True)
class Reading:
    """How what a report is of is read: in its kind's names and units."""

    kind: Kind

    def length(self, value_m: float | None, *, sign: bool = False) -> Shown:
        """Show a length."""
        if value_m is None or not isfinite(value_m):
            return Shown("–")
        plus, read = "+" if sign else "", self.kind.length
        if self.kind.turns:
            text = read.number(value_m, f"{plus}.4g")
        else:
            text = read.number(value_m, f"{plus}.2g" if 0.0 < abs(value_m) < FINE_M else f"{plus}.3f")
        return Shown(text, f"{value_m:.6g} {self.si}")

    def said(self, value_m: float | None) -> str:
        """Say a length with its unit."""
        return f"{self.length(value_m).text} {self.kind.length.unit}"

    @property
    def si(self) -> str:
        """The SI unit of a length."""
        return self.kind.travel.si

    @property
    def errors(self) -> Quantity:
        """What errors of a simulated position are of."""
        return Quantity(self.length, self.kind.length.factor, self.kind.length.unit, self.si)

    def title(self, text: str) -> str:
        """Return a title that is worded for a valve, mm, kPa and N, in this kind's words and units."""
        kind = self.kind
        own = {"mm": kind.length.unit, "kPa": kind.command.read.unit, "N": kind.force.read.unit}
        words = own | {"position": kind.travel.word, "actuator pressure": kind.command.word}
        return re.sub("|".join(rf"\b{each}\b" for each in words), lambda found: words[found[0]], text)

    def parameter(self, name: str) -> tuple[str, float, str]:
        """Return a parameter's name in words, the factor from SI to the unit shown, and the unit."""
        words, factor, unit = parameter(name)
        if self.kind.name == "valve" or not unit:
            return words, factor, unit
        ending = next(each for each in SUFFIXES if name.endswith(each))
        units = self.kind.own(f"x{ending}").removeprefix("x_").split("_")
        return words, 1.0, " ".join(WRITTEN.get(each, each) for each in units).replace(" per ", "/")


OF_VALVE = Reading(VALVE)
WRITTEN = {
    "n": "N", "nm": "N m", "ns": "N s", "nms": "N m s", "nms2": "N m s²", "ns2": "N s²", "a": "A", "rad2": "rad²",
    "rad3": "rad³", "m2": "m²", "m3": "m³",
}  # fmt: skip
"""Units of names as they are written."""


def of_stroke(value_m: float, stroke_m: float) -> str:
    """Say a length in per cent of the stroke."""
    return f"{100 * value_m / stroke_m:.3g} % of stroke" if isfinite(value_m) else ""


def times(value: float, unit: float | None) -> str:
    """Say how many times a unit a value is."""
    return f"{value / unit:.3g} ×" if unit and isfinite(value) else "–"


def parameter(name: str) -> tuple[str, float, str]:
    """Return a parameter's name in words, the factor from SI to the unit shown, and the unit."""
    for suffix, (factor, unit) in SUFFIXES.items():
        if name.endswith(suffix):
            return _words(name.removesuffix(suffix)), factor, unit
    return _words(name), 1.0, ""


def _words(name: str) -> str:
    return BASE.get(name) or name.replace(".", ": ").replace("_", " ")
