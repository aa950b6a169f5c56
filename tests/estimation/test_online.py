"""The whole identification on the seed's valve: 1 ms, white noise, both directions, and everything that goes wrong."""

from collections.abc import Callable
from dataclasses import replace
from math import isnan, nan, sin

import numpy as np
import pytest

from config.codes import Refusal
from positioner.estimation.estimates import Estimates
from positioner.estimation.online import Identification, IdentificationSettings
from tests.estimation.stem import NOISE, PSI, STROKE, TRUTH, Run, feed, grid, identified, run, swing

SINGLY, LAW = ("a", "b", "c", "k"), ("b_over_c", "k_over_c")


def down(time_s: float) -> float:
    return PSI * (4.0 - 1.92 * sin(time_s)) if time_s >= 0 else 8.5 * PSI


UPWARD = run(swing, grid(1e-3, -0.2, 1.0))
DOWNWARD = run(down, grid(1e-3, -0.2, 1.0), position_m=0.07)
FROM_MIDDLE = run(lambda t: swing(t) + 4 * PSI if t >= 0 else 4 * PSI, grid(1e-3, -0.2, 1.0), position_m=0.03)
QUIET = 1e-9


def error(estimates: Estimates, name: str) -> float:
    """Relative error."""
    return float(getattr(estimates, name).value) / TRUTH[name] - 1


def reasons(estimates: Estimates) -> set[Refusal]:
    return {getattr(estimates, name).reason for name in SINGLY + LAW}


@pytest.mark.parametrize("motion", [UPWARD, DOWNWARD, FROM_MIDDLE], ids=["up", "down", "middle"])
def test_exact_samples_give_exact_estimates(motion: Run) -> None:
    estimates = identified(motion, noise_std_m=QUIET).estimates
    assert reasons(estimates) == {Refusal.VALID}
    for name in SINGLY + LAW:
        assert abs(error(estimates, name)) < 2e-4, name
    assert estimates.progress == 1.0
    assert estimates.time_s == pytest.approx(0.8, abs=2e-3)


@pytest.mark.parametrize("motion", [UPWARD, DOWNWARD], ids=["up", "down"])
def test_white_noise_leaves_the_law_its_numbers_and_their_standard_deviation(motion: Run) -> None:
    rng = np.random.default_rng(0)
    found = [identified(motion.noisy(rng)).estimates for _ in range(15)]
    assert all(estimates.law_ready for estimates in found)
    for name in LAW:
        errors = [error(estimates, name) for estimates in found]
        stds = [getattr(estimates, name).std / abs(TRUTH[name]) for estimates in found]
        assert max(map(abs, errors)) < 0.01
        assert np.std(errors) < 0.003
        assert 0.5 < np.std(errors) / np.median(stds) < 2.0
        assert abs(np.mean(errors)) < np.median(stds)


def test_parameters_that_noise_has_spoiled_say_so() -> None:
    rng = np.random.default_rng(1)
    for _ in range(10):
        noise = 1e-3 * STROKE
        estimates = identified(UPWARD.noisy(rng, noise), noise_std_m=noise).estimates
        assert {getattr(estimates, name).reason for name in SINGLY} == {Refusal.NOISE_DOMINATES}


def test_valid_parameters_are_as_good_as_their_standard_deviation() -> None:
    """Up to the noise that is usual: the windows that hold the jerk tell a, b, c apart."""
    rng = np.random.default_rng(2)
    for number in range(12):
        noise = (3e-6, 1e-4)[number % 2] * STROKE
        estimates = identified(UPWARD.noisy(rng, noise), noise_std_m=noise).estimates
        for name in SINGLY:
            estimate = getattr(estimates, name)
            assert estimate.valid
            assert abs(estimate.value - TRUTH[name]) < 4 * estimate.std


def test_noise_is_measured_where_it_is_not_known() -> None:
    noisy = UPWARD.noisy(np.random.default_rng(3))
    measured, known = identified(noisy, noise_std_m=None).estimates, identified(noisy).estimates
    assert measured.b_over_c.std == pytest.approx(known.b_over_c.std, rel=0.2)
    assert measured.law_ready


def test_pressure_noise_counts() -> None:
    rng = np.random.default_rng(4)
    for noise_pa, names in ((10.0, SINGLY + LAW), (500.0, LAW)):
        noise = rng.normal(0, noise_pa, len(UPWARD.time_s))
        noisy = Run(UPWARD.time_s, UPWARD.position_m, UPWARD.pressure_pa + noise)
        estimates = identified(noisy, noise_std_m=QUIET, pressure_noise_std_pa=noise_pa).estimates
        for name in names:
            assert getattr(estimates, name).valid
            assert abs(error(estimates, name)) < 4 * getattr(estimates, name).std / abs(TRUTH[name])
    assert estimates.a.reason is Refusal.NOISE_DOMINATES


def test_missing_samples_and_jittered_stamps() -> None:
    rng = np.random.default_rng(5)
    t = grid(1e-3, -0.2, 1.0)
    t = t + rng.uniform(-2e-4, 2e-4, len(t))
    motion = run(swing, t[rng.random(len(t)) > 0.01])
    for noise in (QUIET, NOISE):
        estimates = identified(motion.noisy(rng, noise), noise_std_m=noise).estimates
        assert estimates.law_ready
        for name in LAW:
            assert abs(error(estimates, name)) < 0.01


def test_a_sample_that_is_not_a_number_is_a_missing_sample() -> None:
    position = UPWARD.position_m.copy()
    position[300:302] = nan
    holed = identified(replace(UPWARD, position_m=position), noise_std_m=QUIET).estimates
    without = identified(UPWARD.kept(~np.isnan(position)), noise_std_m=QUIET).estimates
    assert holed == without
    assert holed.law_ready


def test_samples_before_the_motion_do_not_matter() -> None:
    """Time zero is put where motion begins, whether the identification began long before or just then."""
    early = identified(UPWARD, noise_std_m=QUIET).estimates
    late = identified(UPWARD.kept(UPWARD.time_s > -0.0015), noise_std_m=QUIET).estimates
    assert late.b.value == pytest.approx(early.b.value, rel=1e-3)


def ripple(time_s: float) -> float:
    """The seed's excitation with a ripple too small to turn the motion round."""
    return swing(time_s) + (0.03 * PSI * sin(20 * time_s) if time_s >= 0 else 0.0)


def restarted(motion: Run, noise_std_m: float = QUIET) -> Identification:
    identification = identified(motion.kept(motion.time_s < 0.2), noise_std_m=noise_std_m)
    identification.restart()
    assert reasons(identification.estimates) == {Refusal.WAITING_FOR_MOTION}
    feed(identification, motion.kept(motion.time_s >= 0.2))
    return identification


def test_restart_in_the_middle_of_the_motion() -> None:
    estimates = restarted(run(ripple, grid(1e-3, -0.2, 1.1))).estimates
    assert estimates.progress == 1.0
    assert estimates.law_ready
    for name in LAW:
        assert abs(error(estimates, name)) < 1e-3


@pytest.mark.parametrize("noise", [QUIET, NOISE])
def test_restart_after_the_jerk_of_a_slow_motion_leaves_the_ratios_at_most(noise: float) -> None:
    """What is left is a slow motion along the balance of forces, which knows nothing of the mass."""
    estimates = restarted(UPWARD.noisy(np.random.default_rng(6), noise), noise).estimates
    assert estimates.progress > 0.85
    assert not any(getattr(estimates, name).valid for name in SINGLY)
    for name in LAW:
        estimate = getattr(estimates, name)
        assert abs(estimate.value - TRUTH[name]) < 4 * estimate.std


def test_progress_grows_to_the_end() -> None:
    settings = IdentificationSettings(stroke_m=STROKE, pressure_pa=1e5, noise_std_m=QUIET)
    identification = Identification(settings)
    assert reasons(identification.estimates) == {Refusal.NOT_STARTED}
    identification.restart()
    progress, ready = [], []
    for sample in UPWARD.samples():
        estimates = identification.update(*sample, parameters=True, friction=True)
        progress.append(estimates.progress)
        ready.append(estimates.law_ready)
        assert isnan(estimates.time_s) or estimates.time_s <= sample[0]
    assert progress == sorted(progress)
    assert progress[-1] == 1.0
    first = ready.index(True)
    assert all(ready[first:])
    assert progress[first] == pytest.approx(0.5, abs=0.03)


# --- what goes wrong


def rest(_: float) -> float:
    return 2 * PSI


def short(time_s: float) -> float:
    return swing(time_s) if time_s < 0.2 else 0.0 * time_s + 5.0 * PSI


@pytest.mark.parametrize(
    ("pressure", "until_s", "reason"),
    [
        (rest, 1.0, Refusal.WAITING_FOR_MOTION),
        (swing, 0.3, Refusal.WINDOW_TOO_SHORT),
        (short, 1.0, Refusal.MOTION_ENDED),
    ],
    ids=["no motion", "too short", "stopped"],
)
@pytest.mark.parametrize("noise", [QUIET, NOISE])
def test_refusals(pressure: Callable[[float], float], until_s: float, reason: Refusal, noise: float) -> None:
    motion = run(pressure, grid(1e-3, -0.2, until_s)).noisy(np.random.default_rng(6), noise)
    assert reasons(identified(motion, noise_std_m=noise).estimates) == {reason}


def test_a_constant_pressure_is_refused() -> None:
    def creep(time_s: float) -> float:
        return 6.4 * PSI if time_s >= 0 else 0.0

    motion = run(creep, grid(1e-3, -0.2, 1.0))
    drift = replace(motion, position_m=motion.position_m + 0.02 * np.maximum(motion.time_s, 0))
    estimates = identified(drift).estimates
    assert estimates.b_over_c.reason is Refusal.ILL_CONDITIONED
    assert estimates.k_over_c.reason is Refusal.PARAMETERS_MISSING


def test_a_stem_that_the_pressure_pulls_back_is_unphysical() -> None:
    upside_down = replace(UPWARD, pressure_pa=-UPWARD.pressure_pa)
    estimates = identified(upside_down, noise_std_m=QUIET).estimates
    assert estimates.c.reason is Refusal.C_NOT_POSITIVE
    assert estimates.b_over_c.reason is Refusal.B_OVER_C_NOT_NEGATIVE
    assert not estimates.law_ready


def test_friction_of_the_wrong_sign_is_unphysical() -> None:
    pushed = replace(UPWARD, pressure_pa=UPWARD.pressure_pa - 2 * TRUTH["k_over_c"] * -1)
    estimates = identified(pushed, noise_std_m=QUIET).estimates
    assert estimates.k.reason is Refusal.K_NOT_NEGATIVE
    assert estimates.k_over_c.reason is Refusal.K_OVER_C_NOT_NEGATIVE
    assert estimates.b_over_c.valid


def test_a_gap_breaks_the_record_and_motion_after_it_is_used() -> None:
    motion = run(ripple, grid(1e-3, -0.1, 1.2))
    holed = motion.kept((motion.time_s < 0.2) | (motion.time_s > 0.25))
    before = identified(holed.kept(holed.time_s < 0.26), noise_std_m=QUIET).estimates
    assert reasons(before) == {Refusal.RECORD_BROKEN}
    estimates = identified(holed, noise_std_m=QUIET).estimates
    assert estimates.law_ready
    for name in LAW:
        assert abs(error(estimates, name)) < 1e-3


@pytest.mark.parametrize("jump", [0.0, -5.0])
def test_a_clock_that_does_not_advance_breaks_the_record(jump: float) -> None:
    identification = identified(UPWARD.kept(UPWARD.time_s < 0.3), noise_std_m=QUIET)
    identification.update(UPWARD.time_s[499] + jump, 0.03, 5e4, parameters=True, friction=True)
    assert reasons(identification.estimates) == {Refusal.RECORD_BROKEN}
    assert identification.direction == 0


def stick(time_s: float) -> float:
    """Up for 0.6 s, a hold in which the stem sticks, and on."""
    return swing(min(time_s, 0.6)) if time_s < 0.8 else swing(time_s - 0.2) + 2 * PSI


def test_what_a_long_enough_motion_has_given_remains_when_the_stem_sticks() -> None:
    motion = run(stick, grid(1e-3, -0.1, 1.1))
    for noise in (QUIET, NOISE):
        noisy = motion.noisy(np.random.default_rng(8), noise)
        for until_s in (0.7, 0.79, 1.1):
            estimates = identified(noisy.kept(noisy.time_s < until_s), noise_std_m=noise).estimates
            assert estimates.law_ready
            for name in LAW:
                assert abs(error(estimates, name)) < (2e-3 if noise == QUIET else 2e-2)


def test_a_later_motion_that_tells_less_replaces_nothing_until_it_tells_more() -> None:
    """Information decides, not the clock: after the stop the window begins anew, with less of the motion in it."""
    noisy = run(stick, grid(1e-3, -0.1, 1.3)).noisy(np.random.default_rng(8))
    before = identified(noisy.kept(noisy.time_s < 0.79)).estimates
    identification = Identification(IdentificationSettings(stroke_m=STROKE, pressure_pa=1e5, noise_std_m=NOISE))
    identification.restart()
    doubts, readings = [], 0
    for sample in noisy.samples():
        estimates = identification.update(*sample, parameters=True, friction=True)
        if estimates.acceptable:
            doubts.append(estimates.relative_variance)
            readings += estimates.progress > 0.5 and estimates.time_s < 0.66 and sample[0] > 1.25
    assert doubts == sorted(doubts, reverse=True)
    assert before.acceptable
    assert readings, "a reading of the second motion that was refused"


def test_no_standstill_gets_into_the_estimates() -> None:
    """Held against the same motion that goes on: the last estimates before the stop are no worse."""
    stopped = identified(run(stick, grid(1e-3, -0.1, 0.79)), noise_std_m=QUIET).estimates
    assert abs(error(stopped, "b")) < 1e-3
    assert stopped.time_s < 0.66


def test_a_reversal_closes_the_window_and_the_way_back_is_used() -> None:
    def there_and_back(time_s: float) -> float:
        if time_s < 0:
            return 4 * PSI
        return swing(time_s) + 4 * PSI if time_s < 0.3 else PSI * (3.0 - 1.92 * sin(time_s - 0.3))

    motion = run(there_and_back, grid(1e-3, -0.1, 1.3), position_m=0.03)
    identification = identified(motion, noise_std_m=QUIET)
    assert identification.direction == -1
    for name in LAW:
        assert abs(error(identification.estimates, name)) < 1e-3
    assert identification.estimates.law_ready


# --- what is asked for


def test_parameters_alone_and_friction_alone() -> None:
    identification = identified(UPWARD, noise_std_m=QUIET, friction=False)
    assert identification.estimates.b_over_c.valid
    assert identification.estimates.k_over_c.reason is Refusal.NOT_ASKED
    assert identification.estimates.acceptable

    identification.restart()
    feed(identification, DOWNWARD, parameters=False)
    estimates = identification.estimates
    assert estimates.b_over_c.reason is Refusal.NOT_ASKED
    assert abs(error(estimates, "k_over_c")) < 2e-3
    assert estimates.acceptable
    assert not estimates.law_ready


def test_friction_needs_parameters() -> None:
    estimates = identified(UPWARD, noise_std_m=QUIET, parameters=False).estimates
    assert estimates.k_over_c.reason is Refusal.PARAMETERS_MISSING


def test_nothing_asked_is_nothing_found() -> None:
    identification = identified(UPWARD, parameters=False, friction=False)
    assert isnan(identification.estimates.a.value)
    assert identification.velocity_m_per_s == pytest.approx(0.009, abs=0.004)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"stroke_m": 0.0}, "stroke_m"),
        ({"pressure_pa": -1.0}, "pressure_pa"),
        ({"window_s": 0.3}, "minimum_window_s"),
        ({"derivative_window_s": 0.0}, "derivative_window_s"),
    ],
)
def test_settings_that_make_no_sense(settings: dict[str, float], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        IdentificationSettings(**{"stroke_m": STROKE, "pressure_pa": 1e5} | settings)  # type: ignore[arg-type]
