"""What slips say of rivals on a valve whose friction scatters, when they say nothing, and what more would say."""

from dataclasses import replace

import numpy as np
import pytest

from config.recording import Recording
from config.slave_file import Sensor
from config.valve_file import ValveFile
from sim.composition import Composition
from sim.karnopp import Vector
from tests.workbench.valves import PERIOD_S, drawn_valve, pressures, with_effect
from workbench.blind.trial import LEVELS, NOISE_M, Trial
from workbench.data.held_out import joined
from workbench.data.record import Record, ready
from workbench.discriminate.experiment_design import Bounds, Terms
from workbench.discriminate.rival_race import RivalRace, Weighed, evidence, log_odds, slip_odds
from workbench.discriminate.slip_evidence import SlipForces, Slips, _log_between, _log_density, needed_m, slips
from workbench.discriminate.slip_promise import promised_by_slips
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import local_fit

BARE = drawn_valve(np.random.default_rng(11))
PRELOADED = with_effect(BARE, "preload", force_n=60.0)
RIVALS = {
    "preload": {"force_n": 60.0},
    "spring_hardening": {"cubic_n_per_m3": 1e6},
    "asymmetric_friction": {"asymmetry": 0.05},
}
"""Where the search for each begins: what slips say of the fits is asked here, not whether these are found."""
ROWS = 3000


def dirty(valve: ValveFile, seed: int) -> Recording:
    """Return a recording of a valve with pressure noise and break-away jitter, by a transmitter of 12 bits."""
    generator = np.random.default_rng(seed)
    trial = Trial(pressures(generator, ROWS), PERIOD_S)
    answer_m = trial.with_disturbances(Composition.from_file(valve), generator).indicated_m
    return trial.recording(answer_m, Sensor(noise_std_m=NOISE_M, quantum_m=valve.valve.stroke_m / LEVELS, seed=seed))


@pytest.fixture(scope="module")
def recordings() -> list[Recording]:
    return [dirty(PRELOADED, seed) for seed in (1, 2)]


@pytest.fixture(scope="module")
def record(recordings: list[Recording]) -> Record:
    return ready(joined(recordings))


@pytest.fixture(scope="module")
def fits(recordings: list[Recording]) -> dict[str, Fit]:
    whole = joined(recordings)
    return {name: local_fit(whole, with_effect(BARE, name, **values)) for name, values in RIVALS.items()}


@pytest.fixture(scope="module")
def told(fits: dict[str, Fit], record: Record) -> dict[str, Slips]:
    found = {name: slips(each, record, [0, ROWS]) for name, each in fits.items()}
    return {name: each for name, each in found.items() if each is not None}


def preload_n(one: Fit) -> float:
    force_n = one.valve.effect[0].parameters["force_n"]
    assert isinstance(force_n, float)
    return force_n


@pytest.mark.long
def test_slips_tell_a_preload_from_a_hardening_spring(told: dict[str, Slips]) -> None:
    assert told["preload"].count == told["spring_hardening"].count > 40
    assert told["preload"].log_likelihood - told["spring_hardening"].log_likelihood > np.log(100.0)


@pytest.mark.long
def test_an_experiment_in_which_luck_mistimes_slips_is_explained_by_where_they_land(
    fits: dict[str, Fit], recordings: list[Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    one = {"preload": fits["preload"]}
    begun = RivalRace(one, (recordings[0],), 0, 1)
    monkeypatch.setattr(RivalRace, "off_m", lambda _race, _name, first=0: np.full(2, 1e-3 if first else 1e-4))

    def explained(played: Recording) -> bool:
        return RivalRace(one, (recordings[0], played), 0, 1, begun).explained

    def sticking(share: float) -> ValveFile:
        return PRELOADED.model_copy(
            update={"valve": BARE.valve.model_copy(update={"static_n": share * BARE.valve.static_n})}
        )

    assert explained(recordings[1])
    assert not explained(dirty(with_effect(BARE, "preload", force_n=400.0), 2)), "slides land elsewhere"
    assert not explained(dirty(sticking(1.3), 2)), "other forces begin them"


def test_what_is_one_by_algebra_is_one_by_slips(fits: dict[str, Fit], told: dict[str, Slips], record: Record) -> None:
    """A stem that is indicated F / k_s less open."""
    one = fits["preload"]
    offset_m = -preload_n(one) / one.valve.valve.spring_n_per_m
    shifted = with_effect(ValveFile(valve=one.valve.valve), "sensor_offset", offset_m=offset_m)
    renamed = {name.replace("preload.force_n", "sensor_offset.offset_m"): each for name, each in one.parameters.items()}
    found = slips(replace(one, valve=shifted, parameters=renamed), record, [0, ROWS])
    assert found is not None
    assert found.log_likelihood == pytest.approx(told["preload"].log_likelihood, abs=1.0)


def test_larger_forces_all_alike_say_nothing(fits: dict[str, Fit], told: dict[str, Slips], record: Record) -> None:
    """Area, spring, friction and mass of a valve 1.3 times as large: it moves as before."""
    one = fits["preload"]
    forces = ("diaphragm_area_m2", "spring_n_per_m", "coulomb_n", "static_n", "viscous_ns_per_m", "mass_kg")
    larger = one.valve.valve.model_copy(update={name: 1.3 * getattr(one.valve.valve, name) for name in forces})
    found = slips(
        replace(one, valve=with_effect(ValveFile(valve=larger), "preload", force_n=1.3 * preload_n(one))),
        record,
        [0, ROWS],
    )
    assert found is not None
    assert found.log_likelihood == pytest.approx(told["preload"].log_likelihood, abs=1.0)


def test_landings_of_a_rival_that_does_not_land_where_its_balance_says_tell_less(
    fits: dict[str, Fit], told: dict[str, Slips], record: Record
) -> None:
    """Friction that rises from some speed down stops a slide before the balance at rest."""
    one = fits["preload"]
    rising = with_effect(
        ValveFile(valve=one.valve.valve), "stribeck", excess_n=120.0, velocity_m_per_s=0.01, exponent=2.0
    )
    most_m = needed_m(unfitted(one, rising), record, [0, ROWS])
    assert most_m > 3.0 * needed_m(one, record, [0, ROWS])
    less = {name: slips(fits[name], record, [0, ROWS], most_m) for name in ("preload", "spring_hardening")}
    assert less["preload"] is not None
    assert less["spring_hardening"] is not None
    apart = told["preload"].log_likelihood - told["spring_hardening"].log_likelihood
    assert less["preload"].log_likelihood - less["spring_hardening"].log_likelihood < 0.7 * apart


def test_where_much_is_needed_the_stiffer_valve_is_not_the_likelier(fits: dict[str, Fit], record: Record) -> None:
    """Landings far inside what is needed tell nothing, whatever a displacement is worth in forces."""
    one = fits["preload"]
    softer = one.valve.valve
    stiffer = softer.model_copy(update={"spring_n_per_m": 1.1 * softer.spring_n_per_m})
    told = [
        SlipForces(each, record, [0, ROWS], least_m=3.0)
        for each in (one, replace(one, valve=one.valve.model_copy(update={"valve": stiffer})))
    ]
    landed = [each.logs(each.first())[: each.landings.count] for each in told]
    assert landed[1] == pytest.approx(landed[0], abs=0.01)


def with_stop(top_m: float) -> ValveFile:
    return with_effect(
        BARE, "end_stop", lower_m=-0.2, travel_m=0.2 + top_m, stiffness_n_per_m=1e8, damping_ns_per_m=9000.0
    )


def unfitted(one: Fit, valve: ValveFile) -> Fit:
    """Return a fit that has come to this valve."""
    return replace(
        one, valve=valve, parameters={name: each for name, each in one.parameters.items() if "." not in name}
    )


def test_on_a_stop_a_sensors_step_says_nothing(fits: dict[str, Fit]) -> None:
    """It is worth 2500 N there."""
    valve = with_stop(0.04)
    record = ready(dirty(valve, 5))
    step_m = BARE.valve.stroke_m / LEVELS
    told = [
        slips(unfitted(fits["preload"], valve), replace(record, position_m=record.position_m + each), [0])
        for each in (-step_m, 0.0, step_m)
    ]
    likelihoods = [each.log_likelihood for each in told if each]
    assert len(likelihoods) == 3
    assert np.ptp(likelihoods) < 1.0


def test_a_stem_that_rests_pressed_on_short_of_a_stop_speaks_against_it(fits: dict[str, Fit]) -> None:
    """A limited supply halts it now here, now there."""
    valve = with_effect(BARE, "supply_limit", supply_pa=49e3, exhaust_pa=-1e4)
    record = ready(joined([dirty(valve, seed) for seed in (5, 6)]))
    stopped = with_stop(float(np.quantile(record.position_m, 0.98)))
    rivals = [unfitted(fits["preload"], each) for each in (valve, stopped)]
    least_m = max(needed_m(each, record, [0, ROWS]) for each in rivals)
    limit, stop = (slips(each, record, [0, ROWS], least_m) for each in rivals)
    assert limit is not None
    assert stop is not None
    assert limit.log_likelihood - stop.log_likelihood > np.log(100.0)
    by_loads_borne = limit.logs[limit.count :].sum() - stop.logs[stop.count :].sum()
    assert by_loads_borne > 5.0


def test_break_aways_scatter_alike_however_lopsided_the_packing(fits: dict[str, Fit], record: Record) -> None:
    """Pressure noise knows no packing: were scatter in proportion to friction, it would speak against asymmetry."""
    lopsided = with_effect(ValveFile(valve=fits["preload"].valve.valve), "asymmetric_friction", asymmetry=0.4)
    forces = SlipForces(unfitted(fits["preload"], lopsided), record, [0, ROWS])
    left = forces.left(forces.fitted)
    stiffer = replace(record, command_pa=record.command_pa + 1e3)
    pressed = SlipForces(unfitted(fits["preload"], lopsided), stiffer, [0, ROWS])
    more_n = 1e3 * BARE.valve.diaphragm_area_m2
    moved_n = np.abs(pressed.left(pressed.fitted).upper_n - left.upper_n)
    assert np.median(np.abs(moved_n - more_n)) < 0.01 * more_n


def test_what_a_slow_stem_seems_to_have_borne_is_no_contradiction(fits: dict[str, Fit], record: Record) -> None:
    """The load at which it broke loose lies between the two, whichever is the larger."""
    forces = SlipForces(fits["preload"], record, [0, ROWS])
    left = forces.left(forces.fitted)
    forces._bore, forces._broke = forces._broke, forces._bore
    swapped = forces.left(forces.fitted)
    assert np.all(swapped.lower_n <= swapped.upper_n)
    assert swapped.upper_n == pytest.approx(left.upper_n)


def test_two_slides_tell_nothing(fits: dict[str, Fit], recordings: list[Recording]) -> None:
    short = Recording({name: column[:300] for name, column in recordings[0].columns.items()})
    assert slips(fits["preload"], ready(short), [0]) is None


@pytest.mark.parametrize("least_m", [0.0, 1e-3])
def test_the_slope_is_that_of_the_loss(fits: dict[str, Fit], record: Record, least_m: float) -> None:
    forces = SlipForces(fits["preload"], record, [0, ROWS], least_m)
    u = forces.first() + 0.05 * np.random.default_rng(0).standard_normal(forces.first().size)
    apart = [
        (forces.loss_and_slope(u + step)[0] - forces.loss_and_slope(u - step)[0]) / 2e-4
        for step in 1e-4 * np.eye(u.size)
    ]
    assert forces.loss_and_slope(u)[1] == pytest.approx(apart, rel=1e-3, abs=0.01)


def test_likelihoods_are_students() -> None:
    from scipy.stats import t  # takes as long to load as all else of the file

    off = np.array([-30.0, -1.0, 0.0, 2.0, 3e3])
    assert _log_density(off) == pytest.approx(t.logpdf(off, 4))
    assert _log_between(off - 0.5, off + 0.5) == pytest.approx(
        np.log(t.sf(abs(off) - 0.5, 4) - t.sf(abs(off) + 0.5, 4))
    )


def alike(each: float, count: int) -> Vector:
    """Return so many that say nearly the same."""
    return np.array([each * (1.0 + 0.1 * (-1.0) ** i) for i in range(count)])


def weighed(one: Fit, cost: float, apart: float, log_likelihood: float | None) -> Weighed:
    told = None if log_likelihood is None else Slips(log_likelihood, 100, logs=alike(log_likelihood / 100.0, 100))
    return Weighed(replace(one, cost=cost, count=1000), alike(apart, 20), 1.0, told)


@pytest.mark.parametrize(
    ("log_likelihood", "expected"),
    [(None, 0.0), (-3.0, 0.0), (-300.0, 300.0 - 500.0 * np.log(1.1)), (20.0, -20.0)],
    ids=["not told", "the run is stronger", "slips are stronger", "they disagree"],
)
def test_the_stronger_counts_unless_they_disagree(
    fits: dict[str, Fit], log_likelihood: float | None, expected: float
) -> None:
    best = weighed(fits["preload"], 500.0, 0.0, 0.0)
    rival = weighed(fits["preload"], 550.0, 0.15, log_likelihood)
    by_run = log_odds(best, rival)
    assert by_run == pytest.approx(500.0 * np.log(1.1))
    assert evidence(best, rival) == pytest.approx(by_run + expected)
    assert evidence(rival, best) == pytest.approx(-(by_run + expected))


def steady(one: Fit, more: dict[int, float]) -> Weighed:
    """Return a rival of 40 stretches of 12.5 each and more in some, whose best leaves the sensor's noise alone."""
    stretches = np.full(40, 12.5)
    for at, cost in more.items():
        stretches[at] += cost
    cost = float(stretches.sum())
    return Weighed(replace(one, cost=cost, count=1000), np.zeros(40), 1.0, stretches=stretches, steady=True)


def test_a_mistimed_slip_tells_as_much_as_an_accident_that_has_not_happened(fits: dict[str, Fit]) -> None:
    one = fits["preload"]
    assert log_odds(steady(one, {}), steady(one, {7: 900.0, 8: 400.0})) == pytest.approx(np.log(41.0))
    assert log_odds(steady(one, {}), steady(one, {7: 900.0, 30: 400.0, 31: 2.0})) == pytest.approx(
        np.log(41.0) + 1.856, 0.1
    )


def test_what_many_stretches_say_alike_is_added_up_where_nothing_but_noise_is_left(fits: dict[str, Fit]) -> None:
    everywhere = steady(fits["preload"], dict.fromkeys(range(40), 0.25))
    assert log_odds(steady(fits["preload"], {}), everywhere) == pytest.approx(10.0)
    scattering = replace(steady(fits["preload"], {}), steady=False)
    assert log_odds(scattering, everywhere) < 1.0


def test_what_luck_has_won_it_may_have_lost(fits: dict[str, Fit]) -> None:
    one = fits["preload"]
    assert log_odds(steady(one, {3: 900.0}), steady(one, {7: 900.0})) == pytest.approx(0.0)


def test_a_parameter_more_is_paid_for(fits: dict[str, Fit]) -> None:
    one = fits["preload"]
    more = replace(one, parameters={**one.parameters, "another": next(iter(one.parameters.values()))})
    assert slip_odds(weighed(one, 500.0, 0.0, 9.0), weighed(more, 500.0, 0.0, 7.0)) == pytest.approx(
        2.0 + 0.5 * np.log(100)
    )


def test_slips_say_no_more_than_they_agree(fits: dict[str, Fit]) -> None:
    """By Vuong: of 100 slips that differ by 0.3 +- 1 the sum is 30, three standard errors from nothing, 740 : 1."""
    one = weighed(fits["preload"], 500.0, 0.0, 0.0)
    told = 0.3 + np.array([(-1.0) ** i for i in range(100)])
    other = replace(one, slips=Slips(float(-told.sum()), 100, logs=-told))
    assert np.exp(slip_odds(one, other)) == pytest.approx(740.0, rel=0.01)
    assert slip_odds(other, one) == pytest.approx(-slip_odds(one, other))


@pytest.fixture(autouse=True)
def unchanged(monkeypatch: pytest.MonkeyPatch) -> None:
    """Courses of the menu as they are: half a second instead of ten."""
    monkeypatch.setattr("workbench.discriminate.experiment_design.TRIED", 0)


def promised(
    fits: dict[str, Fit], told: dict[str, Slips], names: tuple[str, ...], record: Record, window_m: float = 0.2
) -> float:
    """Return log odds a move."""
    low_pa, high_pa = float(record.command_pa.min()), float(record.command_pa.max())
    bounds = Bounds(low_pa, high_pa, 400e3, 26.0, -0.1 * window_m, window_m)
    found = promised_by_slips([(fits[name], told[name]) for name in names], record, [0, ROWS], Terms(bounds, 4))
    return 0.0 if found is None else found[1] / found[0].moves


@pytest.mark.long
def test_of_twins_nothing_is_promised(fits: dict[str, Fit], told: dict[str, Slips], record: Record) -> None:
    assert promised(fits, told, ("preload", "preload"), record) < 1e-9


@pytest.mark.long
def test_what_nothing_tells_apart_hides_no_third(fits: dict[str, Fit], told: dict[str, Slips], record: Record) -> None:
    assert promised(fits, told, ("preload", "preload", "spring_hardening"), record) > 0.1


@pytest.fixture
def apart(fits: dict[str, Fit], told: dict[str, Slips], record: Record) -> float:
    return promised(fits, told, ("preload", "asymmetric_friction"), record)


@pytest.mark.long
def test_a_bent_balance_promises_more_than_a_break_away(
    fits: dict[str, Fit], told: dict[str, Slips], record: Record, apart: float
) -> None:
    """Preload and asymmetric friction land alike, and differ by a share of F_s - F_c where they break loose."""
    assert apart > 0.02
    assert promised(fits, told, ("preload", "spring_hardening"), record) > 2.0 * apart


@pytest.mark.long
def test_a_course_of_the_menu_is_changed_to_promise_more(
    fits: dict[str, Fit], told: dict[str, Slips], record: Record, apart: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("workbench.discriminate.experiment_design.TRIED", 25)
    assert promised(fits, told, ("preload", "asymmetric_friction"), record) > 1.02 * apart


@pytest.mark.long
def test_of_three_the_least_distinct_two_count(
    fits: dict[str, Fit], told: dict[str, Slips], record: Record, apart: float
) -> None:
    assert promised(fits, told, ("preload", "spring_hardening", "asymmetric_friction"), record) <= apart


def test_no_course_inside_the_bounds_is_no_promise(
    fits: dict[str, Fit], told: dict[str, Slips], record: Record
) -> None:
    assert promised(fits, told, ("preload", "spring_hardening"), record, window_m=1e-9) == 0.0
