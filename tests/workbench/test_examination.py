"""What explains a recording so well that nothing is diagnosed: as close as chance allows, and without structure."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from config.recording import Recording
from config.valve_file import valve
from tests.workbench.fleets import ROWS, record
from workbench.compare.comparison import Comparison, compare
from workbench.fleet.examination import LOOK_FLOORS, floors_allowed, is_at_floor, is_structured

NOISE_M = 5e-5
SEED = valve("seed")


def compared(folder: Path, *, wave_m: float = 0.0, rows: int | None = None) -> Comparison:
    """The seed's valve against its own recording, to which a slow wave, rms, is added."""
    record(SEED, folder / "recordings" / "V.csv", 3)
    made = Recording.read(folder / "recordings" / "V.csv")
    columns = {name: each[:rows] for name, each in made.columns.items()}
    wave = np.sqrt(2.0) * wave_m * np.sin(2.0 * columns["time_s"])
    return compare(Recording({**columns, "position_m": columns["position_m"] + wave}, made.metadata), SEED)


@pytest.mark.parametrize(("floors", "explained"), [(0.0, True), (0.15, True), (0.45, False)])
def test_what_goes_on_from_sample_to_sample_is_no_noise(tmp_path: Path, floors: float, explained: bool) -> None:
    found = compared(tmp_path, wave_m=floors * NOISE_M)
    assert found.adequate
    assert found.rms_m < LOOK_FLOORS * (found.floor_m or 0.0), "the error alone would not tell"
    assert found.structured_m == pytest.approx(floors * NOISE_M, abs=0.12 * NOISE_M)
    assert is_structured(found) == (not explained)
    assert is_at_floor(found, SEED) == explained


def test_of_few_samples_the_error_may_lie_higher_by_chance(tmp_path: Path) -> None:
    many, few = compared(tmp_path), compared(tmp_path, rows=250)
    assert (many.valid_samples, few.valid_samples) == (ROWS, 250)
    assert floors_allowed(1000) == pytest.approx(1.158, abs=0.005)
    assert floors_allowed(few.valid_samples) == pytest.approx(1.316, abs=0.005)


def test_laps_that_differ_excuse_structure_only_where_they_did_before(tmp_path: Path) -> None:
    found = compared(tmp_path, wave_m=0.45 * NOISE_M)
    assert found.noise_m
    differing = replace(found, floor_m=1.4 * found.noise_m, rms_m=1.2 * found.noise_m)
    assert not is_structured(differing), "who knows how this valve is"
    assert not is_structured(differing, 1.4 * found.noise_m)
    assert is_structured(differing, 1.1 * found.noise_m)
