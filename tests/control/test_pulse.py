"""The pulse's closed forms against a plain integration of the same stem, and what the filter learns from outcomes."""

from dataclasses import replace
from math import exp, log

import pytest

from positioner.control.pulse import Pulse, PulseResponse, unidentified_response

OMEGA, ZETA = 196.5, 1.146
LIMIT_M = 27e-3
PUSH_M = 5.6e-3
STEP_S = 2e-6
NEAR_M = 1e-6


def response(omega: float = OMEGA, zeta: float = ZETA, bias_m: float = 0.0) -> PulseResponse:
    return replace(unidentified_response(1e-4), theta=(log(omega), log(zeta), bias_m, bias_m))


def integrated_m(pulse: Pulse, omega: float, zeta: float, bias_m: float = 0.0) -> float:
    """Return where a stem ends that is pushed, then held, and kept by static friction when it first stops."""
    x = v = t = 0.0
    while t < 1.0:
        z = pulse.push_m
        if t >= pulse.duration_s:
            fall = exp(-(t - pulse.duration_s) / pulse.lag_s) if pulse.lag_s else 0.0
            z = pulse.hold_m + (pulse.push_m - pulse.hold_m) * fall
        acceleration = -2 * zeta * omega * v - omega * omega * (x - z - bias_m)
        v += STEP_S * acceleration
        x += STEP_S * v
        t += STEP_S
        if v <= 0.0:
            break
    return x


@pytest.mark.parametrize("zeta", [0.6, 1.0, ZETA, 3.0])
@pytest.mark.parametrize(
    "pulse",
    [
        Pulse(PUSH_M, -LIMIT_M, 1e-3, 1),
        Pulse(PUSH_M, 1e-4, 1e-3, -1),
        Pulse(PUSH_M, 3e-3, 1e-3, 1),
        Pulse(PUSH_M, -LIMIT_M, 4e-3, 1, 0.05),
        Pulse(PUSH_M, 2e-3, 4e-3, 1, 0.05),
        Pulse(PUSH_M, PUSH_M, 45e-3, -1),
        Pulse(PUSH_M, -LIMIT_M, 0.15, 1, 0.05),
    ],
    ids=["braked", "barely braked", "slide", "slow pressure, braked", "slow pressure", "long", "long, slow pressure"],
)
def test_the_end_is_where_an_integration_ends(pulse: Pulse, zeta: float) -> None:
    bias_m = 2e-4
    found = response(OMEGA, zeta, bias_m).end(pulse, NEAR_M)
    assert found.travel_m == pytest.approx(integrated_m(pulse, OMEGA, zeta, bias_m), rel=5e-3)


def test_the_end_comes_no_later_than_it_says() -> None:
    slide = Pulse(PUSH_M, 3e-3, 1e-3, 1)
    found = response().end(slide, 1e-5)
    x = v = t = 0.0
    while t < found.time_s:
        z = slide.push_m if t < slide.duration_s else slide.hold_m
        v += STEP_S * (-2 * ZETA * OMEGA * v - OMEGA * OMEGA * (x - z))
        x += STEP_S * v
        t += STEP_S
    assert abs(x - slide.hold_m) < 2e-5


@pytest.mark.parametrize("travel_m", [1.5e-4, 3e-4, 1e-3, 8e-3])
@pytest.mark.parametrize("lag_s", [0.0, 0.05])
def test_a_pulse_is_aimed_at_a_distance(travel_m: float, lag_s: float) -> None:
    push = Pulse(PUSH_M, 0.0, 1e-3, 1, lag_s)
    reaching = response(bias_m=3e-4).reaching(travel_m, push, -LIMIT_M)
    found = response(bias_m=3e-4).end(reaching, NEAR_M).travel_m
    shortest = response(bias_m=3e-4).end(push._replace(hold_m=-LIMIT_M), NEAR_M).travel_m
    assert found == pytest.approx(max(travel_m, shortest), rel=5e-3)


@pytest.mark.parametrize("zeta", [0.9, 1.1])
def test_a_push_that_outlasts_the_motion_takes_the_stem_as_far_as_it_is_asked(zeta: float) -> None:
    """It was predicted to go nowhere, so that no pulse was given: a healthy valve followed no reference any more."""
    push = Pulse(PUSH_M, 0.0, 0.5, -1, 0.02)
    quick = response(8e3, zeta)
    reaching = quick.reaching(0.3 * LIMIT_M, push, -LIMIT_M)
    assert quick.end(reaching, NEAR_M).travel_m == pytest.approx(0.3 * LIMIT_M, rel=5e-3)


def test_no_hold_is_deeper_than_asked() -> None:
    push = Pulse(PUSH_M, 0.0, 1e-3, 1)
    assert response().reaching(1e-6, push, -LIMIT_M).hold_m == -LIMIT_M


def test_outcomes_teach_the_response_from_nothing() -> None:
    """A valve of which nothing is known: after a dozen pulses of the true one both kinds are predicted."""
    true, known = response(bias_m=2e-4), unidentified_response(3e-4)
    for travel_m in (3e-4, 8e-4, 2e-4, 3e-3, 4e-4, 1.5e-4, 5e-4, 6e-3, 3e-4, 2e-4, 1e-3, 4e-4):
        pulse = known.reaching(travel_m, Pulse(PUSH_M, 0.0, 1e-3, 1), -LIMIT_M)
        known = known.updated(pulse, true.end(pulse, NEAR_M).travel_m, (3e-6) ** 2, 3e-5)
    assert known.bias_m(1) == pytest.approx(2e-4, abs=2e-5)
    assert known.bias_m(-1) == 0.0
    for hold_m in (-LIMIT_M, -1e-3, 2e-3):
        pulse = Pulse(PUSH_M, hold_m, 1e-3, 1)
        assert known.end(pulse, NEAR_M).travel_m == pytest.approx(true.end(pulse, NEAR_M).travel_m, rel=0.05)


def test_a_surprise_beyond_reason_does_not_throw_the_response_off() -> None:
    """A braked pulse ends 5 mm farther than it could: no parameter leaps farther than that."""
    known = response().updated(Pulse(PUSH_M, -LIMIT_M, 1e-3, -1), 5e-3, (3e-6) ** 2, 3e-5)
    assert abs(known.bias_m(-1)) < 5e-3
    assert abs(known.theta[0] - log(OMEGA)) < 0.71


def test_what_was_learnt_lowers_the_doubt() -> None:
    pulse = Pulse(PUSH_M, 3e-3, 1e-3, 1)
    first = unidentified_response(3e-4)
    later = first.updated(pulse, first.end(pulse, NEAR_M).travel_m, (3e-6) ** 2, 3e-5)
    assert later.std_m(pulse) < 0.5 * first.std_m(pulse)


def test_a_new_identification_keeps_the_difference_of_the_directions() -> None:
    """It brings its own doubt about the balance; the stem's poles and what differs between directions stay."""
    pulse = Pulse(PUSH_M, 3e-3, 1e-3, -1)
    before = unidentified_response(3e-4).updated(pulse, 4e-3, (3e-6) ** 2, 3e-5)
    after = before.with_new_balance(2e-4)
    assert after.theta == before.theta
    assert after.std_m(pulse) ** 2 == pytest.approx(before.std_m(pulse) ** 2 + 2e-4**2, rel=1e-3)
