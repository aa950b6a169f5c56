"""Units that people at a plant use, each with the SI value beside it."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite

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
}
"""The bare valve's parameters, without their endings."""


@dataclass(frozen=True, slots=True)
class Shown:
    """A number as it is read, and in SI for the tooltip."""

    text: str
    si: str = ""


def length(value_m: float | None, *, sign: bool = False) -> Shown:
    """Show a length in mm."""
    if value_m is None or not isfinite(value_m):
        return Shown("–")
    plus = "+" if sign else ""
    fine = 0.0 < abs(value_m) < FINE_M
    return Shown(f"{1e3 * value_m:{plus}.2g}" if fine else f"{1e3 * value_m:{plus}.3f}", f"{value_m:.6g} m")


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


LENGTH = Quantity(length, 1e3, "mm", "m")
FORCE = Quantity(force, 1.0, "N", "N")


def of_stroke(value_m: float, stroke_m: float) -> str:
    """Say a length in per cent of the stroke."""
    return f"{100 * value_m / stroke_m:.2g} % of stroke" if isfinite(value_m) else ""


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
