"""Units of cells and headers, by all the names that people give them, and what they are in SI.

    SI = factor raw + offset

A unit may stand in the mapping, in the header (`PV [%]`), in a row under it, or behind each number. `%`, `p.u.`, `mA`
(4 to 20) and volts of a range (`0-10V`) are shares: of the stroke for a position, of a range for a pressure. A unit
with a minus before it counts from the other end, as of a valve that air closes: `-%`, `-mm`. `100ns` are ticks of .NET
and FILETIME, `ud` millionths of a day.
"""

import re
from collections.abc import Mapping
from math import pi

from workbench.imports.number_notation import is_numeral

ATMOSPHERE_PA = 101_325.0

UNITS: Mapping[str, Mapping[str, float]] = {
    "_s": {
        "s": 1.0,
        "ms": 1e-3,
        "us": 1e-6,
        "100ns": 1e-7,
        "ns": 1e-9,
        "min": 60.0,
        "h": 3600.0,
        "d": 86400.0,
        "ud": 0.0864,
        "iso": 1.0,
    },
    "_pa": {
        "Pa": 1.0,
        "hPa": 100.0,
        "kPa": 1e3,
        "MPa": 1e6,
        "mbar": 100.0,
        "bar": 1e5,
        "psi": 6894.757293168,
        "kg/cm2": 98066.5,
        "atm": ATMOSPHERE_PA,
        "mmHg": 133.322387415,
        "inHg": 3386.388640341,
        "mmH2O": 9.80665,
        "inH2O": 249.08891,
        "bara": 1e5,
        "kPaa": 1e3,
        "psia": 6894.757293168,
    },
    "_m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "mil": 2.54e-5, "ft": 0.3048},
    "_n": {"N": 1.0, "kN": 1e3, "lbf": 4.4482216152605},
    "_nm": {"Nm": 1.0, "mNm": 1e-3, "kNm": 1e3},
    "_a": {"A": 1.0, "mA": 1e-3},
    "_rad": {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180.0, "rev": 2.0 * pi},
    "_m_per_s": {"m/s": 1.0, "mm/s": 1e-3},
    "_rad_per_s": {"rad/s": 1.0, "deg/s": pi / 180.0, "rpm": pi / 30.0},
}
"""By the ending of our name: their unit in ours."""
ABSOLUTE = frozenset({"bara", "kPaa", "psia"})
"""Pressures from a vacuum up; ours are from the atmosphere up."""
SHARES: Mapping[str, tuple[float, float]] = {
    "%": (0.01, 0.0),
    "p.u.": (1.0, 0.0),
    "‰": (1e-3, 0.0),
    "mA": (1 / 16, -0.25),
    "0-20mA": (1 / 20, 0.0),
    "0-10V": (0.1, 0.0),
    "0-5V": (0.2, 0.0),
    "1-5V": (0.25, -0.25),
    "2-10V": (0.125, -0.25),
}
"""Share = factor raw + offset."""
PROCESS_UNITS = re.compile(
    r"(n?m[3³]|l|kg|t|lb|gal|bbl)/(h|hr|min|s|d)\b|\bgpm\b|\bs?cfm\b|\b[lk]pm\b|°[cf]\b|\bdeg ?[cfk]\b|"
    r"\bph\b|\bm[3³]\b",
    re.IGNORECASE,
)
"""Of a flow, a temperature and the like, of which no column of ours is."""
SI = {ending: next(unit for unit, factor in units.items() if factor == 1.0) for ending, units in UNITS.items()}
_WITH_UNIT = re.compile(r"([+\u2212-]?[\d.,]+(?:[eE][+-]?\d+)?)\s*([^\d\s].*)")
_BEHIND_NAME = [
    re.compile(rf"(.*\S)\s*{unit}", re.DOTALL)
    for unit in (r"[\[(<]\s*([^\[\]()<>]+(?:\([^()]*\))?)\s*[\])>]", r"[,/:]\s*(\S+)", r"\s(%)")
]
"""A unit behind a name: in brackets, in which there may be a slash; behind a comma, slash or colon; alone."""
_ALIASES = {
    "sec secs second seconds sek sekunde sekunden": "s",
    "msec millisec milliseconds millisekunden": "ms",
    "µs μs usec": "us",
    "nsec nanoseconds nanosekunden": "ns",
    "ticks filetime": "100ns",
    "datenum": "d",
    "minute minutes minuten": "min",
    "hr hrs hour hours std": "h",
    "day days tage": "d",
    "pascal": "Pa",
    "barg bar(g) bar_g bar(ü) barü": "bar",
    "bar(a) bar_a": "bara",
    "kpag kpa(g) kpa_g": "kPa",
    "kpa(a)": "kPaa",
    "mbarg mbar(g)": "mbar",
    "psig psi(g) lb/in2 lbf/in2": "psi",
    "psi(a)": "psia",
    "kg/cm² kgf/cm2 kgf/cm² kp/cm2": "kg/cm2",
    "n/mm2 n/mm²": "MPa",
    "torr": "mmHg",
    "mmwc mmh₂o mmws": "mmH2O",
    "inwc inh₂o inwg": "inH2O",
    "thou 1/1000in": "mil",
    "foot feet": "ft",
    "permille promille": "‰",
    "meter metre meters metres": "m",
    "millimeter millimetre": "mm",
    "µm μm micron": "um",
    'inch inches "': "in",
    "newton": "N",
    "n*m n·m newtonmeter": "Nm",
    "ampere amp amps": "A",
    "degree degrees grad ° deg.": "deg",
    "turn turns revolutions umdrehungen": "rev",
    "1/min min-1 u/min": "rpm",
    "percent pct prozent %open %offen %travel %oftravel %stroke %ofstroke %hub %span %ofspan %fs": "%",
    "0-100% 0..100%": "%",
    "pu p.u": "p.u.",
    "milliampere ma(dc) 4-20ma 4..20ma 4to20ma": "mA",
    "0..20ma 0to20ma": "0-20mA",
    "0..10v 0to10v 0-10vdc": "0-10V",
    "0..5v 0to5v": "0-5V",
    "1..5v 1to5v 1-5vdc": "1-5V",
    "2..10v 2to10v": "2-10V",
}
_BY_ALIAS = {alias: unit for aliases, unit in _ALIASES.items() for alias in aliases.split()} | {
    unit.casefold(): unit for units in (*UNITS.values(), SHARES) for unit in units if unit != "iso"
}


def list_allowed_units(ending: str) -> list[str]:
    """Return the units of a column of ours, by the ending of its name."""
    shares = list(SHARES) if ending in ("_pa", "_m") else []
    return [*UNITS[ending], *shares]


def unit_named(text: str) -> str | None:
    """Return the unit that a text names, in our spelling; None if it names none that is known.

    >>> unit_named("[bar(g)]"), unit_named("µm"), unit_named("% open"), unit_named("Good")
    ('bar', 'um', '%', None)
    """
    plain = re.sub(r"\s", "", text).casefold()
    if match := re.fullmatch(r"[\[(<](.*)[\])>]", plain):
        plain = match[1]
    return _BY_ALIAS.get(plain)


def unit_in_header(name: str) -> tuple[str, str | None]:
    """Return a header's name without the unit at its end, and the unit.

    >>> unit_in_header("Hub [mm]"), unit_in_header("P1, bar"), unit_in_header("PV (Ist)")
    (('Hub', 'mm'), ('P1', 'bar'), ('PV (Ist)', None))
    >>> unit_in_header("OUT [kgf/cm2]"), unit_in_header("v (m/s)")
    (('OUT', 'kg/cm2'), ('v', 'm/s'))
    >>> unit_in_header("PV:mm")
    ('PV', 'mm')
    """
    for form in _BEHIND_NAME:
        if (match := form.fullmatch(name)) and (unit := unit_named(match[2])):
            return match[1].rstrip(), unit
    return name, None


def split_unit(cell: str) -> tuple[str, str | None]:
    """Return the numeral of a cell and the unit behind it, in our spelling; None where none stands there.

    >>> split_unit("1,02 cm"), split_unit("949 mbar"), split_unit("50.1"), split_unit("12 furlong")
    (('1,02', 'cm'), ('949', 'mbar'), ('50.1', None), ('12 furlong', None))
    """
    match = None if is_numeral(cell) else _WITH_UNIT.fullmatch(cell)
    unit = unit_named(match[2]) if match else None
    return (match[1], unit) if match and unit else (cell, None)


def with_any_unit(cell: str) -> tuple[str, str]:
    """Return the numeral of a cell and the unit behind it, ours or a process's; "" where none stands there.

    >>> with_any_unit("12.3 m³/h"), with_any_unit("949 mbar"), with_any_unit("Bad Input")
    (('12.3', 'm³/h'), ('949', 'mbar'), ('Bad Input', ''))
    """
    numeral, unit = split_unit(cell)
    match = None if unit or is_numeral(cell) else _WITH_UNIT.fullmatch(cell)
    return (match[1], match[2]) if match and PROCESS_UNITS.fullmatch(match[2]) else (numeral, unit or "")


def ending_of(name: str) -> str:
    """Return the ending of a column's name that says its unit: _s, _pa, _m, _rad_per_s, ..."""
    return max((each for each in UNITS if name.endswith(each)), key=len)
