"""What is wrong with a recording is told and handled, and nothing else is touched."""

import numpy as np
import pytest

from config.errors import InputError
from config.recording import Column, Recording
from config.valve_file import EffectTable
from signals.moves import AT_ONCE
from signals.noise import quantum_m
from sim.composition import Composition
from sim.open_loop import respond
from tests.workbench.valves import NOISE_M, SEED, drawn_valve, record_of
from workbench.data.noise_floor import UNKNOWN, noise_std_m, repeatability_m
from workbench.data.record import ready, require_units


def plain(count: int = 1000) -> dict[str, Column]:
    generator = np.random.default_rng(1)
    t = 0.01 * np.arange(count)
    return {
        "time_s": t,
        "command_pa": 4e4 + 1e4 * np.sin(t),
        "position_m": 0.05 + 0.01 * np.sin(t) + 1e-5 * generator.standard_normal(count),
    }


def test_a_sound_recording_has_nothing_to_tell() -> None:
    record = ready(Recording(plain()))
    assert record.notes == ()
    assert record.segments == ((0, 1000),)
    assert record.valid.all()


def test_what_an_import_assumed_is_told_wherever_the_recording_is_held_against_a_model() -> None:
    said = "command_pa in %: 0 % is 0.2 bar, 100 % 1 bar, for nobody has said it"
    assert f"assumed: {said}" in ready(Recording(plain(), {"assumed": said, "imported": "so"})).notes


def test_a_gap_a_clock_set_back_and_unrecorded_rows_begin_new_segments() -> None:
    columns = plain()
    columns["time_s"] = columns["time_s"].copy()
    columns["time_s"][300:] += 2.0
    columns["time_s"][600:] -= 5.0
    columns["unrecorded"] = np.where(np.arange(1000) < 800, 0.0, 3.0)
    record = ready(Recording(columns))
    assert record.segments == ((0, 300), (300, 600), (600, 800), (800, 1000))
    assert [note.partition(":")[0] for note in record.notes] == [
        "before sample 301 a gap of 2.01 s",
        "before sample 601 another recording begins, or the clock is set back by 4.99 s",
        "before sample 801 unrecorded rises by 3",
    ]


def test_lost_samples_are_a_longer_period_told_once() -> None:
    kept = np.flatnonzero(np.arange(1000) % 50 != 7)
    columns = {name: column[kept] for name, column in plain().items()}
    columns["lost_samples"] = (kept - np.arange(kept.size)).astype(float)
    record = ready(Recording(columns))
    assert record.segments == ((0, kept.size),)
    assert record.notes[0] == (
        "lost_samples rises by 20 in 20 places, the first before sample 8: the command before is held"
    )


@pytest.mark.parametrize("word", [-9999.0, 9.999e6])
def test_a_command_of_one_row_that_is_a_word_is_told_and_the_one_before_is_held(word: float) -> None:
    columns = plain()
    columns["command_pa"] = columns["command_pa"].copy()
    columns["command_pa"][400] = word
    record = ready(Recording(columns))
    assert record.command_pa[400] == columns["command_pa"][399]
    assert record.notes == (
        f"command_pa is {word:g} in sample 401, alone among others unlike it: no command",
        "command_pa is not a number in sample 401: the command before is held",
    )


@pytest.mark.parametrize(("kind", "pulse"), [("valve", 0.0), ("valve", 3e5), ("rotary", -9999.0)])
def test_a_pulse_of_one_row_is_a_command(kind: str, pulse: float) -> None:
    columns = plain()
    columns["command_pa"] = columns["command_pa"].copy()
    columns["command_pa"][400] = pulse
    record = ready(Recording(columns, {"drive": kind} if kind != "valve" else {}))
    assert record.command_pa[400] == pulse
    assert not any("no command" in note for note in record.notes)


def test_a_missing_command_is_held_and_missing_positions_and_spikes_are_not_judged() -> None:
    columns = plain()
    command, position = columns["command_pa"].copy(), columns["position_m"].copy()
    command[100:103] = np.nan
    position[200] = np.nan
    position[500] = 0.9
    record = ready(Recording(columns | {"command_pa": command, "position_m": position}))
    assert (record.command_pa[99:103] == command[99]).all()
    assert np.flatnonzero(~record.valid).tolist() == [200, 500]
    assert record.notes == (
        "command_pa is not a number in 3 samples, the first 101: the command before is held",
        "position_m is not a number in sample 201: left out of the error",
        "position_m has a spike in sample 501: left out of the error",
    )


def resting() -> Column:
    """Rests of a second at places far apart, 2e-5 m of noise."""
    generator = np.random.default_rng(2)
    return np.repeat(generator.uniform(0.02, 0.08, 10), 100) + 2e-5 * generator.standard_normal(1000)


def test_a_reading_that_is_repeated_is_told_and_not_judged() -> None:
    position = resting()
    position[330:370] = position[330]
    record = ready(Recording(plain() | {"position_m": position}))
    assert np.flatnonzero(~record.valid).tolist() == list(range(331, 370))
    assert record.notes == (
        "position_m stands still to the last digit in 39 samples, the first 332, where it scatters elsewhere: a value "
        "that was repeated, left out of the error",
    )
    assert record.noise_m == pytest.approx(2e-5, rel=0.1)


def test_what_holds_small_changes_back_is_told_and_the_noise_is_unknown() -> None:
    columns = plain()
    position = np.round(columns["position_m"] / 1e-5) * 1e-5
    for i in range(1, position.size):
        position[i] = position[i] if abs(position[i] - position[i - 1]) > 5e-4 else position[i - 1]
    record = ready(Recording(columns | {"position_m": position}))
    assert record.noise_m is None
    assert record.notes[-2].startswith("position_m hardly ever changes by little")
    assert record.notes[-1] == UNKNOWN


def test_uneven_sampling_is_told_and_is_no_gap() -> None:
    columns = plain()
    columns["time_s"] = np.cumsum(np.random.default_rng(2).exponential(0.01, 1000) + 1e-6)
    record = ready(Recording(columns))
    assert len(record.segments) == 1
    assert record.notes[-1].startswith("sampling is uneven")


@pytest.mark.parametrize("quantum", [0.0, 1e-5, 1e-4])
def test_noise_and_rounding_are_measured(quantum: float) -> None:
    recording = record_of(drawn_valve(np.random.default_rng(5)), 5)
    position = recording.position_m
    if quantum:
        position = quantum * np.round(position / quantum)
    expected = (NOISE_M**2 + quantum**2 / 12.0) ** 0.5
    assert noise_std_m(position, recording.command_pa) == pytest.approx(expected, rel=0.15)
    assert quantum_m(position) == pytest.approx(quantum, rel=1e-3)


def test_a_repeated_command_gives_the_repeatability_and_another_does_not() -> None:
    columns = plain(1200)
    command = np.tile(columns["command_pa"][:400], 3)
    position = np.tile(columns["position_m"][:400], 3) + 1e-4 * np.random.default_rng(3).standard_normal(1200)
    assert repeatability_m(command, position) == pytest.approx(1e-4, rel=0.1)
    recording = record_of(drawn_valve(np.random.default_rng(5)), 5)
    assert repeatability_m(recording.command_pa, recording.position_m) is None


def _two_laps(shift_m: float, scatter_m: float) -> tuple[Column, Column]:
    """Twenty-four rests a lap, up and down by turns, each off by what the friction has changed, and by a scatter."""
    generator = np.random.default_rng(7)
    levels = np.tile(np.column_stack([generator.uniform(0.0, 0.04, 12), generator.uniform(0.05, 0.09, 12)]).ravel(), 2)
    changed = np.repeat([0.0, shift_m], 24) * np.tile([1.0, -1.0], 24)
    rests = np.repeat(levels + changed + scatter_m * generator.standard_normal(48), 20)
    return np.repeat(1e6 * levels, 20), rests + 1e-5 * generator.standard_normal(960)


def test_friction_that_changed_between_laps_is_no_scatter() -> None:
    assert repeatability_m(*_two_laps(0.0, 2e-4)) == pytest.approx(2e-4, rel=0.3)
    assert repeatability_m(*_two_laps(3e-3, 2e-4)) == pytest.approx(2e-4, rel=0.3)
    assert repeatability_m(*_two_laps(2e-4, 2e-4)) == pytest.approx(2.5e-4, rel=0.3), "as much as scatter may by chance"


@pytest.mark.parametrize(("noise", "quantum"), [(3e-5, 0.0), (3e-5, 7e-5)])
def test_what_repeats_is_no_noise_but_for_the_last_rounding(noise: float, quantum: float) -> None:
    """A stem that goes evenly through a rounding of 0.3 mm before the noise, never at rest: 0.09 mm rms if taken so."""
    triangle = 0.05 + 0.04 * np.abs(np.linspace(-1.0, 1.0, 400))
    stairs = np.tile(3e-4 * np.round(triangle / 3e-4), 3)
    seen = stairs + noise * np.random.default_rng(3).standard_normal(1200)
    seen = quantum * np.round(seen / quantum) if quantum else seen
    columns = plain(1200) | {"command_pa": np.tile(1e6 * triangle, 3), "position_m": seen}
    found = ready(Recording(columns)).noise_m
    assert found == pytest.approx((noise**2 + quantum**2 / 12.0) ** 0.5, rel=0.15)


def test_two_laps_that_begin_apart_are_compared_from_where_they_agree() -> None:
    columns = plain(600)
    command, generator = (
        np.concatenate([columns["command_pa"][:400], columns["command_pa"][:200]]),
        np.random.default_rng(3),
    )
    position = np.concatenate([columns["position_m"][:400], columns["position_m"][:200]])
    position[:60] = position[60]
    alike = position + 1e-5 * generator.standard_normal(600)
    alike[:60] += 0.02
    assert repeatability_m(command, alike) == pytest.approx(1e-5, rel=0.2)
    strayed = alike.copy()
    strayed[500:560] += 1e-3
    assert repeatability_m(command, strayed) == pytest.approx(1e-3 * (60.0 / 140.0 / 2.0) ** 0.5, rel=0.2)


@pytest.mark.parametrize(
    ("column", "factor", "said"),
    [
        ("position_m", 100 / 0.1016, "per cent"),
        ("command_pa", 1e-5, "bar"),
        ("command_pa", 1 / 6894.757, "psi"),
        ("command_pa", 1e-3, "kPa"),
    ],
)
def test_other_units_are_recognised(column: str, factor: float, said: str) -> None:
    columns = dict(record_of(SEED, 3).columns)
    require_units(ready(Recording(columns)), SEED.valve)
    with pytest.raises(InputError, match=f"looks like {said}"):
        require_units(ready(Recording(columns | {column: columns[column] * factor})), SEED.valve)


def test_nothing_to_simulate_is_refused() -> None:
    with pytest.raises(InputError, match="position_m: no sample is a number"):
        ready(Recording(plain() | {"position_m": np.full(1000, np.nan)}))
    with pytest.raises(InputError, match="no stretch of at least"):
        ready(Recording({name: column[:2] for name, column in plain().items()}))


def begun_before(count: int = 1000) -> Recording:
    """A stem that leaves its place 8 samples in, behind a lag, by a command that is there from the first sample on."""
    file = SEED.model_copy(update={"effect": (EffectTable.model_validate({"name": "ip_lag", "time_constant_s": 0.1}),)})
    composition = Composition.from_file(file)
    command_pa = np.repeat([4e4, 6e4, 2e4, 7e4], count // 4)
    response = respond(composition, composition.theta, command_pa[:-1], 0.01, position_m=0.0, pressure_pa=0.0)
    noise = NOISE_M * np.random.default_rng(3).standard_normal(count)
    columns = {"time_s": 0.01 * np.arange(count), "command_pa": command_pa}
    return Recording(columns | {"position_m": response.indicated_m + noise})


def test_a_motion_that_no_command_of_the_record_began_is_not_judged() -> None:
    recording = begun_before()
    record = ready(recording)
    ((first, _),) = record.segments
    assert first == 250 - AT_ONCE, "just before the command changes: the lag has had the longest time to settle"
    assert f"judged from sample {first + 1} on, where it rests" in record.notes[-1]
    later = {name: column[first:] for name, column in recording.columns.items()}
    assert ready(Recording(later)).segments == ((0, 1000 - first),), "what begins at rest is judged from there"
    known = dict(recording.columns) | {"pressure_pa": recording.columns["command_pa"]}
    assert ready(Recording(known)).segments[0][0] == 0, "its cause is measured"


def test_a_recording_without_noise_is_judged_as_finely_as_a_model_is_simulated() -> None:
    columns = plain()
    moves = np.repeat(np.append([0.02, 0.08], np.random.default_rng(4).uniform(0.02, 0.08, 23)), 40)
    for i in range(1, moves.size):  # seen on the way, too, until it stands still
        left_m = 0.5 * (moves[i] - moves[i - 1])
        moves[i] = moves[i - 1] + left_m if abs(left_m) > 1e-8 else moves[i]
    columns["position_m"] = moves
    record = ready(Recording(columns))
    assert record.noise_m == pytest.approx(6e-7, rel=0.01)
    assert any("hardly has noise" in each and "--noise-m" in each for each in record.notes)


def test_a_position_in_mm_is_told_to_be_imported_as_such() -> None:
    columns = plain()
    small = SEED.valve.model_copy(update={"stroke_m": 0.04})
    with pytest.raises(InputError, match=r"it looks like mm; import it, --column position_m=NAME:mm$"):
        require_units(ready(Recording({**columns, "position_m": 600.0 * columns["position_m"]})), small)


def test_a_pressure_with_gaps_is_in_another_unit_all_the_same() -> None:
    """What the command makes of a gap is in Pa."""
    time_s = np.arange(400.0)
    command_pa = np.repeat(np.random.default_rng(3).uniform(2e4, 8e4, 20), 20)
    shown_kpa = np.where(time_s % 50.0 < 30.0, 1e-3 * command_pa, np.nan)
    columns = {"time_s": time_s, "command_pa": command_pa, "position_m": 1e-6 * command_pa, "pressure_pa": shown_kpa}
    record = ready(Recording(columns))
    with pytest.raises(InputError, match=r"pressure_pa reaches .*: it looks like kPa"):
        require_units(record, SEED.valve)
