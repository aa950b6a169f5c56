"""The plant valve of ../shared/data, by others: behind its positioner, seen once a second, it never rests."""

import pytest

from benchmarks.real import DATA, PLANT, first_half_of_plant_valve, plant_valve_off
from workbench.fit.fitting import fit

RECORD = DATA / "plant_valve" / "half_hour.csv"


@pytest.mark.long
@pytest.mark.skipif(not RECORD.is_file(), reason="the measured recordings are not here")
def test_a_stem_that_never_rests_is_fitted_behind_its_positioner() -> None:
    """A free run of what was fitted to the first half: 1.4 % of the stroke are left of 4.1 %, in either half."""
    whole, first = first_half_of_plant_valve()
    found = fit(first, PLANT)
    for off in plant_valve_off(whole, found):
        assert off < 0.014
