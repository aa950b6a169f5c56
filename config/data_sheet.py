"""A valve file from what a data sheet says, and what it does not say assumed and told.

    k_s = (p_1 - p_0) A / stroke        F_0 = p_0 A        F_c = 1/2 f (p_1 - p_0) A        F_s = r F_c

p_0, p_1 bench range, Pa; A effective diaphragm area, m^2; f friction, the pressure between opening and closing as a
share of the range; r break-away over sliding friction. m and F_v are no data sheet's: m goes with the
area, F_v is 15 ms k_s. The travel ends at 0 and at the stroke, at stops 2000 times as stiff as the spring.
"""

from dataclasses import dataclass

from config.errors import InputError
from config.valve_file import EffectTable, ValveFile, ValveParameters

FRICTION_PERCENT = 5.0
BREAKAWAY_RATIO = 1.3  # F_s/F_c where nothing is known
KG_PER_M2 = 8.0 / 0.07
"""Plate, stem and plug: 8 kg go with 700 cm2."""
DAMPING_S = 15e-3
"""F_v/k_s: the air that a diaphragm pushes in and out."""
STOP_STIFFNESS, STOP_DAMPING = 2000.0, 16.0
"""Of seat and upper stop, over those of spring and stem."""
STIFFNESS_N_PER_M, DAMPING_NS_PER_M = (1e5, 1e9), (0.0, 1e5)
"""What such a contact may have (`sim.effects.end_stop`)."""
STRIBECK_M_PER_S = 5e-4
DEADZONE = 0.5  # Karnopp's band, share of the Stribeck velocity
ALLOWED = {"area_cm2": 1e5, "stroke_mm": 1500.0, "friction_percent": 90.0, "breakaway_ratio": 10.0, "mass_kg": 1e4}
"""The most of each."""
HIGHEST_BAR = 10.0
"""Instrument air gives no more; a range of 3 15 is one of psi."""


@dataclass(frozen=True, slots=True)
class DataSheet:
    """What it says, in its own units; None: it does not say.

    Raises:
        InputError: a number is out of its range; says what is allowed.
    """

    area_cm2: float
    """Effective area of the diaphragm."""
    range_bar: tuple[float, float]
    """Bench range: gauge pressures at which the stem leaves one end and reaches the other."""
    stroke_mm: float
    """Rated travel."""
    friction_percent: float | None = None
    """Pressure between opening and closing, of the range."""
    breakaway_ratio: float | None = None
    """Break-away over sliding friction."""
    mass_kg: float | None = None
    """Plate, stem and plug."""
    name: str = "from data sheet"

    def __post_init__(self) -> None:
        for key, most in ALLOWED.items():
            value, least = getattr(self, key), 1.0 if key == "breakaway_ratio" else 0.0
            inside = value is None or ((value >= 1.0 if key == "breakaway_ratio" else value > 0.0) and value <= most)
            if not inside:
                raise InputError(key, f"must be above {least:g}, at most {most:g}, it is {value:g}")
        first, last = self.range_bar
        if not 0.0 <= first < last <= HIGHEST_BAR:
            raise InputError(
                "range_bar",
                f"must be two gauge pressures, the lower first, up to {HIGHEST_BAR:g} bar (3 to 15 psi are 0.207 to "
                f"1.034); it is {first:g} {last:g}",
            )


def from_data_sheet(sheet: DataSheet) -> tuple[ValveFile, list[str], list[str]]:
    """Return the valve, what it says from the data sheet, and what was assumed."""
    area_m2, stroke_m = 1e-4 * sheet.area_cm2, 1e-3 * sheet.stroke_mm
    first_pa, last_pa = (1e5 * each for each in sheet.range_bar)
    span_n = (last_pa - first_pa) * area_m2
    spring = span_n / stroke_m
    percent = sheet.friction_percent or FRICTION_PERCENT
    ratio = sheet.breakaway_ratio or BREAKAWAY_RATIO
    coulomb_n = 0.5 * percent / 100.0 * span_n
    mass_kg = sheet.mass_kg or KG_PER_M2 * area_m2
    valve = ValveParameters(
        name=sheet.name,
        mass_kg=_round_digits(mass_kg),
        diaphragm_area_m2=_round_digits(area_m2),
        spring_n_per_m=_round_digits(spring),
        viscous_ns_per_m=_round_digits(DAMPING_S * spring),
        coulomb_n=_round_digits(coulomb_n),
        static_n=_round_digits(ratio * coulomb_n),
        stribeck_velocity_m_per_s=STRIBECK_M_PER_S,
        deadzone_ratio=DEADZONE,
        stroke_m=_round_digits(stroke_m),
    )
    preload = EffectTable.model_validate({"name": "preload", "force_n": _round_digits(first_pa * area_m2)})
    stops = EffectTable.model_validate(
        {
            "name": "end_stop",
            "lower_m": 0.0,
            "travel_m": valve.stroke_m,
            "stiffness_n_per_m": _within(STOP_STIFFNESS * valve.spring_n_per_m, STIFFNESS_N_PER_M),
            "damping_ns_per_m": _within(STOP_DAMPING * valve.viscous_ns_per_m, DAMPING_NS_PER_M),
        }
    )
    given = [
        f"spring {valve.spring_n_per_m:g} N/m: {span_n:.6g} N over {sheet.stroke_mm:g} mm",
        f"preload {first_pa * area_m2:.6g} N: {sheet.range_bar[0]:g} bar on {sheet.area_cm2:g} cm2",
        f"stops at 0 and {sheet.stroke_mm:g} mm",
    ]
    friction = f"sliding friction {valve.coulomb_n:g} N: {percent:g} % of the range between opening and closing"
    breakaway = f"break-away friction {valve.static_n:g} N: {ratio:g} times that"
    mass = f"mass {valve.mass_kg:g} kg"
    assumed = [
        *([friction] if sheet.friction_percent is None else []),
        *([breakaway] if sheet.breakaway_ratio is None else []),
        *([f"{mass}: 8 kg go with 700 cm2"] if sheet.mass_kg is None else []),
        f"damping {valve.viscous_ns_per_m:g} N s/m: F_v/k_s = {1e3 * DAMPING_S:g} ms",
        f"Stribeck velocity {STRIBECK_M_PER_S:g} m/s; stops {STOP_STIFFNESS:g} times as stiff as the spring",
    ]
    given += [each for each in (friction, breakaway, mass) if not any(one.startswith(each) for one in assumed)]
    return ValveFile(valve=valve, effect=(preload, stops) if first_pa > 0.0 else (stops,)), given, assumed


def _within(value: float, allowed: tuple[float, float]) -> float:
    return _round_digits(min(max(value, allowed[0]), allowed[1]))


def _round_digits(value: float) -> float:
    """Return a value with the six digits that a data sheet never has."""
    return float(f"{value:.6g}")
