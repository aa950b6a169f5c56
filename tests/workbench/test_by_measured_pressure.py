"""A stem that is diagnosed by its measured pressure, and rivals that are raced by it, under a supply with noise."""

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from config.recording import Recording
from positioner.cli.diagnose import add_arguments
from positioner.cli.main import main
from positioner.cli.parts.next_step import by_pressure_command, extend_command
from sim.effect import shipped_effect, shipped_effects
from tests.workbench.hand_made import fit_of
from workbench.blind.hiding import Hidden, hide
from workbench.data.held_out import join_recordings
from workbench.diagnosis.diagnosis import diagnose
from workbench.diagnosis.extension import extend
from workbench.discriminate.rivals_by_pressure import race_by_pressure
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import fit

LIBRARY = {name: shipped_effect(name, "library") for name in shipped_effects()}
RIVALS = ("sensor_nonlinearity", "flow_force")


@pytest.fixture(scope="module")
def bowed() -> Hidden:
    """A bowed sensor in a dirty valve."""
    return hide(32028, dirty=True, pressure=True, duration_s=12.0)


@pytest.mark.long
def test_by_its_pressure_one_effect_is_named_of_two(bowed: Hidden) -> None:
    found = diagnose(bowed.fit, bowed.base, test=bowed.test, effects=(*RIVALS, "ip_lag"), workers=2, from_pressure=True)
    assert found.missing == ("sensor_nonlinearity",)
    assert [each.name for each in found.steps[0].indistinguishable] == ["sensor_nonlinearity"]
    assert found.best.fit.from_pressure
    assert list(found.unseen) == ["ip_lag"]
    assert "not tried: ip_lag: it acts before the measured pressure, which drives the stem" in found.summary()


@pytest.fixture(scope="module")
def fits(bowed: Hidden) -> dict[str, Fit]:
    whole = join_recordings([bowed.fit, bowed.test])
    base = fit(whole, bowed.base)
    return {name: fit(whole, bowed.base, effects=(name,), base=base) for name in RIVALS}


@pytest.fixture(scope="module")
def unraced() -> dict[str, Fit]:
    """Made by hand, where the recordings rule a race out before any rival is fitted."""
    return {name: fit_of(name) for name in RIVALS}


@pytest.mark.long
def test_rivals_are_raced_by_the_pressure_where_it_was_measured(bowed: Hidden, fits: dict[str, Fit]) -> None:
    raced = race_by_pressure(fits, [bowed.fit, bowed.test], LIBRARY, 2)
    assert all(each.from_pressure for each in raced.values())
    assert raced["sensor_nonlinearity"].rms_m < 0.7 * fits["sensor_nonlinearity"].rms_m


def without(recording: Recording) -> Recording:
    return Recording({name: column for name, column in recording.columns.items() if name != "pressure_pa"})


def unmeasured(recording: Recording) -> Recording:
    """A device whose register of the pressure holds no number."""
    return Recording({**recording.columns, "pressure_pa": np.full(len(recording), np.nan)})


def worse(recording: Recording) -> Recording:
    """A pressure measured so roughly that the command says more."""
    noise_pa = 5e3 * np.random.default_rng(5).standard_normal(len(recording))
    return Recording({**recording.columns, "pressure_pa": recording.columns["pressure_pa"] + noise_pa})


@pytest.mark.parametrize("made", [without, unmeasured])
def test_else_by_the_command(bowed: Hidden, unraced: dict[str, Fit], made: Callable[[Recording], Recording]) -> None:
    assert race_by_pressure(unraced, [made(bowed.fit), bowed.test], LIBRARY, 2) is unraced


@pytest.mark.long
def test_nor_by_a_pressure_that_says_less(bowed: Hidden, fits: dict[str, Fit]) -> None:
    assert race_by_pressure(fits, [worse(bowed.fit), bowed.test], LIBRARY, 2) is fits


def test_nor_where_one_acts_before_it(bowed: Hidden, unraced: dict[str, Fit]) -> None:
    rivals = {**unraced, "ip_lag": unraced["flow_force"]}
    assert race_by_pressure(rivals, [bowed.fit, bowed.test], LIBRARY, 2) is rivals


@pytest.mark.long
def test_what_was_found_by_the_pressure_is_added_by_it(bowed: Hidden) -> None:
    extension = extend(bowed.fit, bowed.base, ["sensor_nonlinearity"], test=bowed.test, from_pressure=True)
    assert extension.extended.from_pressure
    assert extension.extended_errors.test_rmse_m < 0.6 * extension.refitted_errors.test_rmse_m


def test_a_recording_without_a_pressure_is_refused_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], bowed: Hidden
) -> None:
    without(bowed.fit).write(tmp_path / "rec.csv")
    assert main(["diagnose", str(tmp_path / "rec.csv"), "--valve", "seed", "--from-pressure"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "rec.csv: has no measured pressure_pa to simulate from" in said


def test_what_is_typed_next_keeps_to_the_pressure() -> None:
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    arguments = parser.parse_args(["rec.csv", "--valve", "seed", "--effects", "preload", "--from-pressure"])
    assert "--fit rec.csv --from-pressure -o better.toml" in extend_command(["preload"], arguments)
    assert by_pressure_command(arguments).endswith("rec.csv --valve seed --effects preload --from-pressure")
