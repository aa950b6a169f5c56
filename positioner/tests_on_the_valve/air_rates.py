"""Whether the actuator has air, and how fast it fills and vents while the command goes from end to end.

    r = dp/dt where p is between 20 and 80 % of what it spans, by least squares      the longest such stretch each way

A booster, a restriction or a long tube shows as a rate below that of the command, which limits it otherwise.
"""

from collections.abc import Sequence

import numpy as np

from config.codes import ValveTestVerdict
from config.recording import Column, Recording
from positioner.response.figure import Figure, no_value
from positioner.tests_on_the_valve.ramps import rate_of
from positioner.tests_on_the_valve.valve_test_thresholds import THRESHOLDS


def air_rates(recording: Recording, commanded_pa_per_s: float) -> tuple[Figure, Figure]:
    """Return how fast the pressure rises and falls, Pa/s; where the command alone limits it, there is no figure."""
    pressure_pa = recording.columns.get("pressure_pa")
    if pressure_pa is None or not np.isfinite(pressure_pa).all() or np.ptp(pressure_pa) == 0.0:
        nothing = no_value("no pressure is measured")
        return nothing, nothing
    filling, venting = (_rate(recording.time_s, way * pressure_pa, commanded_pa_per_s) for way in (1.0, -1.0))
    return filling, venting


def supply_lacking(recordings: Sequence[Recording]) -> str:
    """Say how far the measured pressure stays from the command where that is highest; empty where it does not."""
    for each in recordings:
        pressure_pa = each.columns.get("pressure_pa")
        if pressure_pa is None or not np.isfinite(pressure_pa).any():
            continue
        command_pa = each.command_pa
        high = command_pa >= np.nanmax(command_pa) - 1e-3 * np.ptp(command_pa)
        reached, asked = float(np.nanmax(pressure_pa[high])), float(np.nanmax(command_pa))
        if asked - reached > THRESHOLDS.supply_lacking * float(np.ptp(command_pa)):
            return f"the pressure stays at {1e-3 * reached:.4g} kPa where {1e-3 * asked:.4g} kPa is commanded"
    return ""


def verdict_at_rest(recordings: Sequence[Recording]) -> tuple[ValveTestVerdict, str]:
    """Return the verdict on a stem that no command has moved, and what its pressure says of it; empty if nothing."""
    lacking = supply_lacking(recordings)
    return ValveTestVerdict.NO_SUPPLY if lacking else ValveTestVerdict.NOT_MOVED, lacking


def _rate(time_s: Column, rising_pa: Column, commanded_pa_per_s: float) -> Figure:
    low, high = THRESHOLDS.inner_air
    share = (rising_pa - rising_pa.min()) / np.ptp(rising_pa)
    inside = np.flatnonzero((share > low) & (share < high))
    stretches = np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1)
    onward = [each for each in stretches if len(each) and share[each[-1]] > share[each[0]]]
    rows = max(onward, key=len, default=inside[:0])
    if len(rows) < THRESHOLDS.fewest_in_bin:
        return no_value("too few samples while it changes")
    rate, _ = rate_of(time_s[rows], rising_pa[rows])
    if (rate.value or 0.0) > THRESHOLDS.as_commanded * commanded_pa_per_s:
        return no_value(f"as fast as the command, {1e-3 * commanded_pa_per_s:.4g} kPa/s")
    return rate
