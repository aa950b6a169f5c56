"""What a transmitter's noise does to a stem that is driven by its measured pressure: that is in the floor."""

from dataclasses import replace

import numpy as np
import pytest

from config.recording import Recording
from workbench.blind.hiding import Hidden, hide
from workbench.data.held_out import Split, split
from workbench.diagnosis.diagnosis import Diagnosis, diagnose
from workbench.diagnosis.extension import extend
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import fit
from workbench.select.block_errors import block_errors
from workbench.select.pressure_scatter import with_pressure_scatter

TRANSMITTER_PA = 300.0
"""A pressure transmitter's noise: 0.3 % of a span of a bar."""


def with_noise(recording: Recording, noise_pa: float) -> Recording:
    noise = np.random.default_rng(1).normal(0.0, noise_pa, len(recording))
    return Recording({**recording.columns, "pressure_pa": recording.columns["pressure_pa"] + noise}, recording.metadata)


@pytest.fixture(scope="module")
def sound() -> Hidden:
    return hide(90001, effects=0, pressure=True, duration_s=15.0)


@pytest.fixture(scope="module")
def parts(sound: Hidden) -> Split:
    return split([with_noise(sound.fit, TRANSMITTER_PA)], with_noise(sound.test, TRANSMITTER_PA))


@pytest.fixture(scope="module")
def found(sound: Hidden, parts: Split) -> Fit:
    return fit(parts.train.recording, sound.base, from_pressure=True)


def test_a_sound_valve_is_off_by_what_its_transmitters_noise_does(parts: Split, found: Fit) -> None:
    with_it = with_pressure_scatter(parts, found)
    assert with_it.by_pressure is not None
    assert with_it.by_pressure.noise_pa == pytest.approx(TRANSMITTER_PA, rel=0.1)
    assert parts.floor_m is not None
    assert with_it.floor_m == pytest.approx(np.hypot(parts.floor_m, with_it.by_pressure.typical_m))
    errors = block_errors(found, with_it)
    assert errors.train_block_m > 2.0 * parts.floor_m
    assert errors.at_floor(with_it.floor_m)
    assert not block_errors(found, parts).at_floor(parts.floor_m)


def test_more_than_the_noise_does_is_not_in_the_floor(parts: Split, found: Fit) -> None:
    with_it = with_pressure_scatter(parts, found)
    stiffer = found.valve.valve.model_copy(update={"spring_n_per_m": 1.05 * found.valve.valve.spring_n_per_m})
    off = replace(found, valve=found.valve.model_copy(update={"valve": stiffer}))
    assert not block_errors(off, with_it).at_floor(with_it.floor_m)


def test_a_stem_that_obeys_its_command_has_the_same_floor(parts: Split, found: Fit) -> None:
    assert with_pressure_scatter(parts, replace(found, from_pressure=False)) is parts


def test_a_quiet_transmitter_adds_nothing_to_the_floor(sound: Hidden) -> None:
    parts = split([sound.fit], sound.test)
    found = fit(parts.train.recording, sound.base, from_pressure=True)
    with_it = with_pressure_scatter(parts, found)
    assert parts.floor_m is not None
    assert with_it.floor_m == pytest.approx(parts.floor_m, rel=0.03)


@pytest.fixture(scope="module")
def told(sound: Hidden, parts: Split) -> Diagnosis:
    effects = ("preload",)
    return diagnose(
        parts.train.recording, sound.base, test=parts.test.recording, effects=effects, workers=2, from_pressure=True
    )


@pytest.mark.long
def test_a_sound_valve_is_adequate_behind_a_noisy_transmitter(told: Diagnosis) -> None:
    assert told.verdict == "adequate"
    assert "the noise of the measured pressure, " in told.summary()
    assert "moves the stem by " in told.summary()


@pytest.mark.long
def test_an_extension_has_the_same_floor(sound: Hidden, parts: Split, told: Diagnosis) -> None:
    extended = extend(
        parts.train.recording, sound.base, ["preload"], test=parts.test.recording, workers=2, from_pressure=True
    )
    assert extended.split.floor_m == pytest.approx(told.split.floor_m, rel=0.05)
