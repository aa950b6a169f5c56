"""A play behind reversals: the bare valve that does the same, and the records that tell."""

import numpy as np

from config.recording import Column, Recording
from config.valve_file import ValveFile, ValveParameters
from sim.composition import Composition
from sim.effect import FINE_STEP_S, shipped_effect, shipped_effects
from sim.open_loop import respond
from tests.workbench.valves import NOISE_M, PERIOD_S, SEED, with_effect
from workbench.data.held_out import split
from workbench.select.equivalence import undetectable, unseen_without_spring

VALVE = ValveFile(valve=SEED.valve.model_copy(update={"coulomb_n": 600.0, "static_n": 720.0}))
WIDTH_M = 1.5e-3
COARSE_M = 3e-4
"""The sensor's noise: of the moment in which a play of 1.5 mm is taken up, a finer sensor sees enough."""
SLACK = with_effect(VALVE, "backlash", width_m=WIDTH_M)
MIDDLE_PA = 4e4


def triangle(count: int = 3000) -> Column:
    """Slow enough to slide throughout: every motion ends in a reversal."""
    phase = (np.arange(count) * PERIOD_S / 3.0 + 0.25) % 1.0
    return np.asarray(MIDDLE_PA + 2.5e4 * (4.0 * np.abs(phase - 0.5) - 1.0))


def stairs(count: int = 3000) -> Column:
    """Up and down in slow stairs with holds: restarts in the same direction, by ramps."""
    t = np.arange(count) * PERIOD_S
    turns = np.interp(t % 12.0, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12], [0, 1, 1, 2, 2, 3, 3, 2, 2, 1, 1, 0, 0])
    return np.asarray(2e4 + 1.5e4 * turns)


def position_m(file: ValveFile, command: Column) -> Column:
    composition = Composition.from_file(file)
    start_m = float(command[0]) * file.valve.diaphragm_area_m2 / file.valve.spring_n_per_m
    response = respond(
        composition,
        composition.theta,
        command[:-1],
        PERIOD_S,
        position_m=start_m,
        pressure_pa=float(command[0]),
        step_s=FINE_STEP_S,
    )
    return response.indicated_m


def recording(file: ValveFile, command: Column, noise_m: float = COARSE_M) -> Recording:
    generator = np.random.default_rng(3)
    time_s: Column = PERIOD_S * np.arange(command.size, dtype=np.float64)
    noisy = position_m(file, command) + noise_m * generator.standard_normal(command.size)
    return Recording({"time_s": time_s, "command_pa": command, "position_m": noisy})


def twin() -> ValveParameters:
    """The bare valve that answers as one with play does while it only reverses."""
    valve = SLACK.valve
    shift_n = 0.5 * valve.spring_n_per_m * WIDTH_M
    return valve.model_copy(update={"coulomb_n": valve.coulomb_n + shift_n, "static_n": valve.static_n - shift_n})


def typical_m(command: Column) -> float:
    """How far the bare valve that should do the same is from the one with play, once the play is taken up, m."""
    apart = position_m(ValveFile(valve=twin()), command) - position_m(SLACK, command)
    return float(np.sqrt(np.mean(apart[400:] ** 2)))


def test_between_reversals_a_bare_valve_does_what_one_with_play_does() -> None:
    assert typical_m(triangle()) < 0.05 * WIDTH_M
    assert typical_m(stairs()) > 0.1 * WIDTH_M


def test_what_records_of_reversals_leave_open_is_told_with_its_limit() -> None:
    bare = ValveFile(valve=twin())
    (open_,) = undetectable(split([recording(SLACK, triangle())]), bare)
    assert (open_.name, open_.like) == ("backlash", ("coulomb_n", "static_n"))
    assert WIDTH_M <= open_.most_m < 2.0 * bare.valve.coulomb_n / bare.valve.spring_n_per_m
    assert "slow restarts in the same direction" in open_.sentence


def test_slow_restarts_in_the_same_direction_leave_nothing_open_wherever_they_are() -> None:
    assert undetectable(split([recording(VALVE, stairs())]), VALVE) == ()
    assert undetectable(split([recording(VALVE, triangle())], recording(VALVE, stairs())), VALVE) == ()


def test_a_fine_sensor_leaves_less_open_than_a_coarse_one() -> None:
    bare = ValveFile(valve=twin())
    seen = undetectable(split([recording(SLACK, triangle(), NOISE_M)]), bare)
    assert all(each.most_m < 0.5 * WIDTH_M for each in seen)


def test_a_valve_that_has_play_is_not_told_of_another() -> None:
    assert undetectable(split([recording(SLACK, triangle())]), SLACK) == ()


def test_an_offset_shows_by_the_spring_alone() -> None:
    drive = SEED.valve.model_copy(update={"spring_n_per_m": 0.0})
    effects = [shipped_effect(name, "library") for name in shipped_effects()]
    assert [each.name for each in effects if unseen_without_spring(each, drive)] == ["sensor_offset"]
    assert not any(unseen_without_spring(each, SEED.valve) for each in effects)
