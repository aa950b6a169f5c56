"""Recordings of set point and travel: read, fitted with the positioner in the path, and what holds the stem."""

from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from config.recording import Recording
from config.valve_file import ValveFile
from sim.composition import Composition
from tests.sim.test_positioner import PA_PER_M, valve_file
from tests.simulated import simulated
from tests.workbench.valves import with_effect
from workbench.compare.comparison import compare
from workbench.data.held_out import split
from workbench.data.record import ready
from workbench.diagnosis.positioner_or_packing import (
    ROUGH,
    Cause,
    PositionerOrPacking,
    Worth,
    cause,
    positioner_or_packing,
)
from workbench.fit.fitting import fit
from workbench.imports.column_mapping import read_mapping
from workbench.model.free_run import Accuracy, FreeRun
from workbench.model.simulation_regime import DYNAMIC
from workbench.report import Subject, report_comparison
from workbench.select.effect_acceptance import Gain
from workbench.select.effect_search import evaluated

KNOWN = valve_file(200.0, gain_pa_per_ms=0.4 * PA_PER_M, dead_band_m=0.001, venting_pa_per_s=2e4)


def recorded(valve: ValveFile, seed: int, duration_s: int = 150) -> Recording:
    """Set points as a flow controller writes them: many small changes, some large; seen once a second."""
    generator = np.random.default_rng(seed)
    setpoint_m, here = np.empty(duration_s), 0.05
    k = 0
    while k < duration_s:
        here = here + 0.006 * generator.standard_normal() if generator.random() < 0.7 else generator.uniform(0.02, 0.08)
        holds = int(generator.integers(3, 20))
        setpoint_m[k : k + holds] = here = float(np.clip(here, 0.01, 0.09))
        k += holds
    whole = simulated(valve, np.arange(duration_s, dtype=float), setpoint_m, noise_std_m=5e-5, seed=seed)
    return Recording({name: column for name, column in whole.columns.items() if name != "pressure_pa"})


def test_a_file_of_set_point_and_travel_is_read_and_one_without_either_is_not(tmp_path: Path) -> None:
    path = tmp_path / "trend.csv"
    recorded(KNOWN, 1, 30).write(path)
    assert Recording.read(path).by_setpoint
    path.write_text("time_s,position_m\n0,0\n1,0\n")
    with pytest.raises(InputError, match="column command_pa is missing"):
        Recording.read(path)


def test_an_export_may_map_its_set_point_in_the_place_of_a_command() -> None:
    sources = read_mapping(["time_s=t", "position_m=PV:%", "reference_m=SP:%"])
    assert [each.name for each in sources] == ["time_s", "position_m", "reference_m"]
    with pytest.raises(InputError, match="command_pa is not given"):
        read_mapping(["time_s=t", "position_m=PV:%"])


def test_without_a_positioner_in_the_valve_file_it_is_refused_with_what_to_write() -> None:
    bare = ValveFile(valve=KNOWN.valve)
    with pytest.raises(InputError, match=r'\[\[effect\]\] name = "positioner"'):
        compare(recorded(KNOWN, 1, 60), bare)


def test_the_valve_itself_is_compared_in_set_points(tmp_path: Path) -> None:
    compared = compare(recorded(KNOWN, 1, 60), KNOWN)
    assert compared.rms_m < 1e-3
    assert "reference_m" in compared.frame_columns()
    report_comparison(compared, tmp_path / "compared.html", Subject(KNOWN, (), {}))
    page = (tmp_path / "compared.html").read_text(encoding="utf-8")
    assert "set point, mm" in page
    assert "command, kPa" not in page


def test_pressures_are_not_taken_for_set_points() -> None:
    by_pressure = Recording({"time_s": np.arange(60.0), "command_pa": np.full(60, 4e4), "position_m": np.zeros(60)})
    with pytest.raises(InputError, match="has a positioner, which obeys a set point: the recording has command_pa"):
        compare(by_pressure, KNOWN)


TRUTH = valve_file(300.0, gain_pa_per_ms=PA_PER_M, dead_band_m=0.004, filling_pa_per_s=9e3, venting_pa_per_s=6e3)
SLUGGISH = valve_file(300.0, gain_pa_per_ms=0.05 * PA_PER_M, dead_band_m=0.001, venting_pa_per_s=6e3)


@pytest.mark.parametrize("gain", [0.4, 1.0, 40.0, 100.0], ids="gain {}".format)
def test_without_inertia_it_answers_as_the_valve_with_inertia_does(gain: float) -> None:
    """Also behind a pilot of high gain, whose loop closes within the steps of one that is slow."""
    valve = valve_file(300.0, gain_pa_per_ms=gain * PA_PER_M, dead_band_m=0.004, filling_pa_per_s=2e4)
    record, composition = ready(recorded(valve, 4, 300)), Composition.from_file(valve)
    slow, dynamic = FreeRun(composition, record), FreeRun(composition, record, by=DYNAMIC, accuracy=Accuracy(0.2, 3e-4))
    assert slow.by.slow
    off_m = np.abs(slow.position_m(composition.theta) - dynamic.position_m(composition.theta))
    assert np.nanquantile(off_m, 0.9) < 5e-5, "as little as the noise"


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_first_slip_comes_when_it_came_though_no_pressure_was_recorded(seed: int) -> None:
    """The stem comes to where the record is judged from: its slide ended with a pressure that friction tells."""
    found = compare(recorded(TRUTH, seed), TRUTH)
    assert "the stem is in motion at sample 1" in found.notes[0]
    assert found.rms_m < 1e-4, "the noise is 0.05 mm; begun in the middle of the band, 0.3 mm and more"


@pytest.mark.parametrize(
    ("effect", "strength"),
    [("preload", {"force_n": 500.0}), ("asymmetric_friction", {"asymmetry": 0.3})],
)
def test_what_it_begins_with_balances_the_forces_of_all_effects(effect: str, strength: dict[str, float]) -> None:
    both = ValveFile(valve=TRUTH.valve, effect=(*TRUTH.effect, *with_effect(TRUTH, effect, **strength).effect))
    assert compare(recorded(both, 1), both).rms_m < 1e-4


@pytest.mark.parametrize(("truth", "within_m"), [(TRUTH, 1e-4), (SLUGGISH, 4e-4)])
def test_when_the_stem_leaves_a_rest_tells_the_pressure_that_it_rested_with(truth: ValveFile, within_m: float) -> None:
    """One of the first rests, without what came before; when the stem leaves it is known to a sample of 1 s."""
    whole = recorded(truth, 2, 200).columns
    position_m = whole["position_m"]
    k = next(i for i in range(20, 100) if np.ptp(position_m[i - 3 : i + 8]) < 4e-4)
    found = compare(Recording({name: column[k:] for name, column in whole.items()}), truth)
    assert not any("in motion" in note for note in found.notes)
    assert found.rms_m < within_m, "begun in the middle of the band, 0.6 mm and 1.2 mm"


@pytest.mark.long
def test_the_positioner_is_fitted_as_the_rest() -> None:
    known = valve_file(200.0, gain_pa_per_ms=PA_PER_M, dead_band_m=0.0045, filling_pa_per_s=1e4, venting_pa_per_s=5e3)
    free = (
        "coulomb_n",
        "static_n",
        "positioner.dead_band_m",
        "positioner.filling_pa_per_s",
        "positioner.venting_pa_per_s",
    )
    found = fit(recorded(TRUTH, 3, 80), known, free=free)
    assert found.rms_m < 1.5e-4, "of 80 mm"
    value = {name: each.value for name, each in found.parameters.items()}
    assert set(value) == set(free)
    assert value["coulomb_n"] == pytest.approx(300.0, rel=0.25)
    assert value["positioner.dead_band_m"] == pytest.approx(0.004, rel=0.2)
    assert value["positioner.filling_pa_per_s"] == pytest.approx(9e3, rel=0.1)
    assert value["positioner.venting_pa_per_s"] == pytest.approx(6e3, rel=0.1)


def worth(*, needed: bool) -> Gain:
    return Gain(500.0, 0.4, 80.0) if needed else Gain(-4.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("friction", "dead_band", "holds"),
    [
        (True, False, "packing"),
        (False, True, "positioner"),
        (True, True, "both"),
        (False, False, "not told"),
    ],
)
def test_what_is_needed_is_what_holds_the_stem(friction: bool, dead_band: bool, holds: str) -> None:
    assert cause(worth(needed=friction), worth(needed=dead_band)) == holds


def held(by: Cause, *, needed: bool, at_floor: bool, from_pressure: bool = False) -> PositionerOrPacking:
    friction = Worth(worth(needed=needed), 3e-4, 1e-3, at_floor)
    dead_band = Worth(worth(needed=needed), 2e-4, 8e-4, at_floor)
    return PositionerOrPacking(by, friction, dead_band, 3e2, 4e-3, 1e-2, found_twice=True, from_pressure=from_pressure)


def test_that_either_does_is_said_only_of_what_is_explained() -> None:
    """Another maker's positioner left 0.7 mm of a floor of 0.02, with friction and dead band and with neither."""
    explained, rough = (held("not told", needed=False, at_floor=each).sentence for each in (True, False))
    assert explained != rough


@pytest.mark.parametrize("at_floor", [True, False])
def test_figures_of_a_valve_that_does_not_explain_the_recording_are_said_to_tell_nothing(at_floor: bool) -> None:
    """A stem that slips often left 0.11 mm of a noise of 0.02: friction of 119 N was told in place of 150."""
    assert (ROUGH in held("both", needed=True, at_floor=at_floor).sentence) != at_floor


@pytest.mark.parametrize(
    ("from_pressure", "errors"),
    [
        (False, "0.2 mm with friction and dead band, 0.8 without dead band, 1 without friction"),
        (
            True,
            "from the measured pressure 0.3 mm with friction, 1 without; "
            "from the set point 0.2 mm with dead band too, 0.8 without dead band",
        ),
    ],
)
def test_each_error_is_said_of_what_it_was_asked_from(from_pressure: bool, errors: str) -> None:
    said = held("both", needed=True, at_floor=True, from_pressure=from_pressure).sentence
    assert said.endswith(f" (held-out errors: {errors}).")


SMALL = {
    "both": valve_file(300.0, gain_pa_per_ms=PA_PER_M, dead_band_m=0.006, filling_pa_per_s=9e3, venting_pa_per_s=6e3),
    "positioner": valve_file(
        5.0, gain_pa_per_ms=PA_PER_M, dead_band_m=0.008, filling_pa_per_s=9e3, venting_pa_per_s=6e3
    ),
}


def small_moves(valve: ValveFile, seed: int = 3) -> Recording:
    """Two minutes of small changes of the set point, in which the stem moves a few times."""
    generator = np.random.default_rng(seed)
    setpoint_m, here, k = np.empty(130), 0.05, 0
    while k < setpoint_m.size:
        here += 0.004 * generator.standard_normal()
        holds = int(generator.integers(3, 12))
        setpoint_m[k : k + holds] = here
        k += holds
    whole = simulated(valve, np.arange(130.0), setpoint_m, noise_std_m=2e-4, seed=seed)
    measured_pa = whole.columns["pressure_pa"] + 100.0 * generator.standard_normal(130)
    return Recording({**whole.columns, "pressure_pa": measured_pa})


def asked(recording: Recording) -> PositionerOrPacking:
    known = valve_file(200.0, gain_pa_per_ms=PA_PER_M, dead_band_m=0.001, venting_pa_per_s=2e4)
    parts = split([recording])
    both = evaluated(fit(parts.train.recording, known), parts)
    return positioner_or_packing(parts, both, workers=2)


@pytest.mark.long
def test_of_small_moves_it_is_never_the_other_that_is_said_to_hold_the_stem() -> None:
    """A few moves of two minutes do not always tell both, or anything: of four records most do."""
    records = [("both", 3), ("both", 6), ("positioner", 3), ("positioner", 7)]
    may_be = {"both": {"both", "at least packing"}, "positioner": {"positioner", "at least positioner"}}
    found = [(asked(small_moves(SMALL[held_by], seed)).cause, held_by) for held_by, seed in records]
    told = [(cause, held_by) for cause, held_by in found if cause != "not told"]
    assert all(cause in may_be[held_by] for cause, held_by in told), found
    assert len(told) >= 2, found


@pytest.mark.long
def test_that_few_moves_do_without_friction_does_not_say_that_there_is_none() -> None:
    """Of so few moves what was fitted speaks for it, what was held out hardly does."""
    columns = small_moves(SMALL["both"]).columns
    found = asked(Recording({name: column[:120] for name, column in columns.items() if name != "pressure_pa"}))
    assert found.cause in {"both", "at least positioner", "not told"}
