"""A measured actuator pressure: what does as well on the position, and commands another pressure, is no rival."""

from dataclasses import replace

import numpy as np
import pytest

from config.recording import Column, Recording
from config.valve_file import ValveFile
from sim.composition import Composition
from sim.effect import FINE_STEP_S
from sim.open_loop import respond
from tests.workbench.hand_made import LIBRARY, model_of
from tests.workbench.valves import NOISE_M, PERIOD_S, drawn_valve, pressures, with_effect
from workbench.data.held_out import split
from workbench.diagnosis.diagnosis import diagnose
from workbench.diagnosis.measured_pressure import ByMeasuredPressure
from workbench.discover.discovery import discover
from workbench.discover.form_search import FormSearch, SearchedForms
from workbench.fit.fitting import fit
from workbench.select.effect_candidates import EvaluatedModel, judged_step
from workbench.select.pressure_errors import PressureErrors, pressure_errors

COUNT = 2000
COMMAND_PA: Column = pressures(np.random.default_rng(2), COUNT)
BARE = drawn_valve(np.random.default_rng(11))
LIMITED = with_effect(BARE, "supply_limit", supply_pa=0.8 * float(COMMAND_PA.max()), exhaust_pa=-101325.0)
SPAN, ZERO_PA, NOISE_PA = 1.02, 900.0, 200.0
"""Of the pressure transmitter."""


def with_play(command_pa: Column, width_pa: float) -> Column:
    """Return what an I/P makes of a command that it follows only out of a dead band, Pa, (n,)."""
    followed_pa = np.empty_like(command_pa)
    now_pa = command_pa[0]
    for k, each in enumerate(command_pa):
        now_pa = followed_pa[k] = np.clip(now_pa, each - 0.5 * width_pa, each + 0.5 * width_pa)
    return followed_pa


def recorded(valve: ValveFile, *, measured: bool = True, hysteresis_pa: float = 0.0, noise_seed: int = 3) -> Recording:
    generator = np.random.default_rng(noise_seed)
    composition = Composition.from_file(valve)
    begin_m = float(COMMAND_PA[0]) * BARE.valve.diaphragm_area_m2 / BARE.valve.spring_n_per_m
    answer = respond(
        composition,
        composition.theta,
        with_play(COMMAND_PA, hysteresis_pa)[:-1],
        PERIOD_S,
        position_m=begin_m,
        pressure_pa=float(COMMAND_PA[0]),
        step_s=FINE_STEP_S,
    )
    position_m = answer.indicated_m + NOISE_M * generator.standard_normal(COUNT)
    pressure_pa = SPAN * answer.pressure_pa + ZERO_PA + NOISE_PA * generator.standard_normal(COUNT)
    time_s: Column = PERIOD_S * np.arange(COUNT, dtype=np.float64)
    columns: dict[str, Column] = {"time_s": time_s, "command_pa": COMMAND_PA, "position_m": position_m}
    return Recording(columns | ({"pressure_pa": pressure_pa} if measured else {}))


def with_pressure(model: EvaluatedModel, off_pa: float) -> EvaluatedModel:
    return replace(model, pressure=PressureErrors(off_pa, np.log(np.full(30, off_pa))))


@pytest.mark.long
def test_a_supply_limit_is_told_from_a_stop_by_the_measured_pressure() -> None:
    """Without it either is as good: `supply_limit or end_stop`."""
    test = recorded(LIMITED, noise_seed=4)
    found = diagnose(recorded(LIMITED), BARE, test=test, effects=("supply_limit", "end_stop"), workers=1)
    assert (found.verdict, found.missing, found.contradicted) == ("missing", ("supply_limit",), ("end_stop",))
    assert "The measured pressure tells them apart: supply_limit's is off by 0." in found.sentence
    assert "end_stop's by" in found.sentence


def test_zero_and_span_of_the_transmitter_are_not_held_against_a_valve() -> None:
    recording = recorded(BARE)
    errors = pressure_errors(fit(recording, BARE, workers=1), split([recording]))
    assert errors is not None
    assert errors.rms_pa == pytest.approx(NOISE_PA, rel=0.1)


def test_what_was_not_measured_is_held_against_no_valve() -> None:
    """A straight line over all that was commanded meanwhile differed from every model by kilopascals."""
    whole = recorded(BARE)
    kept_pa = np.where(np.arange(COUNT) % 500 < 250, whole.columns["pressure_pa"], np.nan)
    recording = Recording({**whole.columns, "pressure_pa": kept_pa})
    errors = pressure_errors(fit(recording, BARE, workers=1), split([recording]))
    assert errors is not None
    assert errors.rms_pa == pytest.approx(NOISE_PA, rel=0.1)
    assert errors.structured_pa < NOISE_PA


def test_without_a_measured_pressure_nothing_is_said_of_it() -> None:
    recording = recorded(BARE, measured=False)
    assert pressure_errors(fit(recording, BARE, workers=1), split([recording])) is None


def test_the_one_with_the_most_evidence_gives_way_to_the_one_whose_pressure_was_measured() -> None:
    before = model_of(cost=4e5, error_m=1e-3)
    stop, limit = model_of("end_stop", cost=990.0), model_of("supply_limit", cost=1010.0)
    models = {"end_stop": with_pressure(stop, 2500.0), "supply_limit": with_pressure(limit, 200.0)}
    step = judged_step(before, models, 1, LIBRARY)
    assert step.added
    assert step.added.name == "supply_limit"
    assert [each.name for each in step.indistinguishable] == ["supply_limit"]
    assert [each.name for each in step.contradicted] == ["end_stop"]


def test_a_pressure_that_is_as_far_off_by_chance_tells_nothing() -> None:
    before = model_of(cost=4e5, error_m=1e-3)
    stop, limit = model_of("end_stop", cost=990.0), model_of("supply_limit", cost=1010.0)
    models = {"end_stop": with_pressure(stop, 201.0), "supply_limit": with_pressure(limit, 200.0)}
    step = judged_step(before, models, 1, LIBRARY)
    assert step.added
    assert step.added.name == "end_stop"
    assert {each.name for each in step.indistinguishable} == {"supply_limit", "end_stop"}
    assert step.contradicted == ()


@pytest.mark.long
def test_what_the_i_p_hides_from_the_stem_is_no_friction() -> None:
    """A hysteresis of the I/P is friction by another name, if not for the measured pressure."""
    found = diagnose(recorded(BARE, hysteresis_pa=8e3), BARE, effects=("supply_limit",), workers=1)
    truly_n = BARE.valve.coulomb_n
    assert found.best.fit.parameters["coulomb_n"].value > 1.1 * truly_n
    by_pressure = found.doubt(ByMeasuredPressure)
    assert by_pressure is not None
    after_n = {name: after for name, _, after in by_pressure.others}["coulomb_n"]
    assert after_n == pytest.approx(truly_n, rel=0.05), "of a transmitter that shows 2 % too much, and noise"
    assert "coulomb_n" in found.sentence
    assert not found.nothing_off


@pytest.mark.parametrize("worse", [False, True])
def test_a_pressure_that_the_stem_follows_less_well_is_doubted(worse: bool) -> None:
    model = model_of(error_m=1e-4)
    others = (("coulomb_n", 90.0, 95.0),)
    said = ByMeasuredPressure(200.0, 0.07, model, others, 4e-6, worse).sentence(model.fit.kind)
    assert "coulomb_n 95, not 90" in said
    assert ("0.004 mm" in said) == worse


@pytest.mark.long
def test_so_is_one_of_a_transmitter_whose_noise_hangs_together() -> None:
    recording, noise = recorded(BARE), np.random.default_rng(4).standard_normal(COUNT)
    wanders_pa = np.convolve(noise, 1e3 * np.exp(-np.arange(40) / 8.0), "same")
    noisy = Recording({**recording.columns, "pressure_pa": recording.columns["pressure_pa"] + wanders_pa})
    found = diagnose(noisy, BARE, effects=(), workers=1)
    by_pressure = found.doubt(ByMeasuredPressure)
    assert by_pressure is not None
    assert by_pressure.worse


@pytest.mark.long
def test_by_its_measured_pressure_a_form_is_sought_of_the_stem_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = with_effect(LIMITED, "preload", force_n=300.0)
    recording, sought = recorded(loaded), list[set[str]]()

    def kept(search: FormSearch, _told: object, _most: int) -> SearchedForms:
        sought.append({each.place.function for each in search.forms.values()})
        return SearchedForms((), (), ())

    monkeypatch.setattr(FormSearch, "run", kept)
    found = [discover(recording, BARE, workers=1, from_pressure=driven) for driven in (False, True)]
    assert [each.base.fit.from_pressure for each in found] == [False, True]
    by_command, by_pressure = sought
    assert by_command - by_pressure == {"pressure"}


@pytest.mark.long
def test_a_pressure_that_is_the_models_but_for_the_noise_is_not_spoken_of() -> None:
    assert NOISE_PA * BARE.valve.diaphragm_area_m2 > 0.01 * BARE.valve.coulomb_n
    found = diagnose(recorded(BARE), BARE, effects=("supply_limit",), workers=1)
    assert found.doubts == ()
    assert found.nothing_off
