"""A measured pressure against its command: another unit, another zero, another line, or one that lags."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from config.drive import VALVE
from config.recording import Column, Recording
from positioner.cli.parts.next_step import not_written
from tests.workbench.test_pressure_errors import BARE, COMMAND_PA, recorded
from workbench.data.held_out import split
from workbench.data.record import Record, ready
from workbench.diagnosis.command_or_pressure import ByCommand, by_command
from workbench.diagnosis.diagnosis import diagnose
from workbench.diagnosis.diagnosis_json import as_json
from workbench.diagnosis.doubt import Case
from workbench.diagnosis.error_before_fit import AsGiven
from workbench.diagnosis.extension import extend
from workbench.diagnosis.pressure_scale import pressure_scale
from workbench.fit.fitting import fit
from workbench.select.effect_search import evaluated


@cache
def record() -> Record:
    return ready(recorded(BARE))


def behind(lag: float) -> Column:
    """Return the command behind a lag of so many samples, Pa, (n,)."""
    e = np.exp(-1.0 / lag)
    from scipy.signal import lfilter  # half a second of every worker that only collects this file

    return np.asarray(lfilter([0.0, 1.0 - e], [1.0, -e], COMMAND_PA, zi=[COMMAND_PA[0]])[0])


def measured(pressure_pa: Column) -> Record:
    return replace(record(), pressure_pa=pressure_pa)


@pytest.mark.parametrize(
    ("shown", "said"),
    [
        (lambda p: 14.5038 * p, "14.5 times .* psi read as bar"),
        (lambda p: 0.0689476 * p, "0.0689 times .* bar read as psi"),
        (lambda p: 0.5 * p + 3e3, "0.5 times "),
        (lambda p: p + 101325.0, " 101 kPa, .*absolute"),
        (lambda p: p - 30e3, " -30 kPa"),
    ],
)
def test_another_unit_and_another_zero_are_said(shown: Callable[[Column], Column], said: str) -> None:
    found = pressure_scale(measured(shown(behind(0.1))))
    assert found is not None
    assert re.search(said, found.sentence(VALVE))


@pytest.mark.parametrize(("span", "above_pa"), [(14.5038, 0.0), (0.5, 0.0), (1.0, 101325.0)])
def test_so_they_are_behind_a_slow_i_p(span: float, above_pa: float) -> None:
    found = pressure_scale(measured(span * behind(60.0) + above_pa))
    assert found is not None
    assert found.span == pytest.approx(span, rel=0.03)


@pytest.mark.parametrize(
    "shown",
    [
        lambda p: 1.05 * p + 2e3,
        lambda p: np.minimum(p, np.quantile(p, 0.7)),
        lambda p: np.full_like(p, 4e5) + np.random.default_rng(1).normal(0.0, 300.0, p.size),
    ],
    ids=["a transmitter as it is", "a supply limit", "another line"],
)
@pytest.mark.parametrize("lag", [0.1, 60.0])
def test_nothing_is_said_of_what_is_no_scale(lag: float, shown: Callable[[Column], Column]) -> None:
    assert pressure_scale(measured(shown(behind(lag)))) is None


def test_without_a_pressure_there_is_none() -> None:
    assert pressure_scale(replace(record(), pressure_pa=None)) is None


def by_pressure(pressure_pa: Column) -> Recording:
    columns = {**recorded(BARE).columns, "pressure_pa": pressure_pa}
    return Recording({name: column[:1000] for name, column in columns.items()})


@pytest.mark.long
def test_a_valve_by_a_pressure_of_another_unit_is_not_adequate_without_a_word() -> None:
    found = diagnose(by_pressure(14.5038 * behind(0.1)), BARE, effects=(), workers=1, from_pressure=True)
    assert "But the measured pressure is 14.5 times as large" in found.sentence
    assert not found.nothing_off
    assert not replace(found, verdict="missing").sure
    assert "another scale" in not_written(Path("better.toml"), replace(found, verdict="missing"))
    assert as_json(found)["pressure_scale"]["span"] == pytest.approx(14.5038, rel=1e-3)


@pytest.mark.long
def test_nor_is_one_extended_without_a_word() -> None:
    found = extend(by_pressure(behind(0.1) + 101325.0), BARE, ["preload"], workers=1, from_pressure=True)
    assert "101 kPa" in found.summary()


def asked(pressure_pa: Column) -> ByCommand | None:
    """Ask the best that a valve is by such a pressure."""
    recording = by_pressure(pressure_pa)
    found = fit(recording, BARE, workers=1, free=("spring_n_per_m", "coulomb_n"), from_pressure=True)
    parts = split([recording])
    case = Case(
        verdict="unexplained",
        best=evaluated(found, parts),
        steps=(),
        valve=BARE,
        library={},
        parts=parts,
        given=AsGiven.of(BARE, parts, found),
        workers=1,
        progress=lambda _what, _done: None,
    )
    return by_command(case)


def test_a_pressure_that_lags_drives_no_stem() -> None:
    """It was something "that the library does not have"."""
    found = asked(behind(100.0))
    assert found is not None
    assert found.model.errors.test_rmse_m < found.by_pressure_rmse_m


def test_nothing_is_said_of_one_that_does() -> None:
    assert asked(behind(0.01)) is None
