"""What is applied after an identification: the whole table."""

from dataclasses import replace
from math import nan

import pytest

from config.codes import Refusal
from positioner.estimation.acceptance import Applied, Ratios, accept
from positioner.estimation.estimates import Directions, Estimate, Estimates, no_estimates

IN_USE = Applied(Ratios(-8e5, -2e4), count=3, refusals=1, last_refusal=Refusal.VALID)
VALID, UNCERTAIN, NOT_ASKED = Refusal.VALID, Refusal.TOO_UNCERTAIN, Refusal.NOT_ASKED


def estimated(slope: Estimate, friction: Estimate) -> Estimates:
    return replace(no_estimates(Refusal.NOISE_DOMINATES), b_over_c=slope, k_over_c=friction, progress=1.0, time_s=5.0)


def value(number: float, reason: Refusal = VALID) -> Estimate:
    return Estimate(number, abs(number) * 1e-3, reason)


NONE = Estimate(nan, nan, NOT_ASKED)
TABLE = [
    # in use, b/c, k/c -> ratios, refused
    (IN_USE, value(-7e5), value(-3e4), Ratios(-7e5, -3e4), VALID),
    (IN_USE, value(-7e5), NONE, Ratios(-7e5, -2e4), VALID),
    (IN_USE, NONE, value(-3e4), Ratios(-8e5, -3e4), VALID),
    (IN_USE, NONE, NONE, IN_USE.ratios, NOT_ASKED),
    (IN_USE, value(-7e5, UNCERTAIN), value(-3e4), IN_USE.ratios, UNCERTAIN),
    (IN_USE, value(-7e5), value(-3e4, UNCERTAIN), IN_USE.ratios, UNCERTAIN),
    (
        IN_USE,
        value(-7e5),
        value(3e4, Refusal.K_OVER_C_NOT_NEGATIVE),
        IN_USE.ratios,
        Refusal.K_OVER_C_NOT_NEGATIVE,
    ),
    (IN_USE, value(-8e6), value(-3e4), IN_USE.ratios, Refusal.IMPLAUSIBLE_CHANGE),
    (IN_USE, value(-7e5), value(-4e3), IN_USE.ratios, Refusal.IMPLAUSIBLE_CHANGE),
    (Applied(), value(-7e5), value(-3e4), Ratios(-7e5, -3e4), VALID),
    (Applied(), value(-7e5), NONE, None, NOT_ASKED),
    (Applied(), value(-7e5), value(-3e4, UNCERTAIN), None, UNCERTAIN),
]


@pytest.mark.parametrize(("before", "slope", "friction", "ratios", "refused"), TABLE)
def test_a_bad_identification_never_replaces_a_good_one(
    before: Applied, slope: Estimate, friction: Estimate, ratios: Ratios | None, refused: Refusal
) -> None:
    after = accept(before, estimated(slope, friction))
    assert after.ratios == ratios
    assert after.last_refusal is refused
    accepted = refused is VALID
    assert (after.count - before.count, after.refusals - before.refusals) == (accepted, not accepted)


ONE_WAY = [
    # in use: φ up, φ down, known -> found: φ, direction; then φ up, φ down, known
    ((20e3, 20e3, "BOTH"), (30e3, "UP"), (30e3, 30e3, "BOTH")),  # nothing but friction: it has grown alike
    ((30e3, 10e3, "BOTH"), (30.5e3, "UP"), (30.5e3, 10.5e3, "BOTH")),  # a preload, and nothing has changed
    ((30e3, 10e3, "BOTH"), (36e3, "UP"), (36e3, 16e3, "UP")),  # friction, or all of it: 16 or 12 kPa
    ((30e3, 10e3, "BOTH"), (13e3, "DOWN"), (33e3, 13e3, "DOWN")),
    ((30e3, 30e3, "UP"), (10e3, "DOWN"), (30e3, 10e3, "BOTH")),  # what was a guess says nothing
    ((30e3, 30e3, "UP"), (30e3, "UP"), (30e3, 30e3, "UP")),
]


@pytest.mark.parametrize(("before", "found", "after"), ONE_WAY)
def test_a_motion_one_way_says_friction_of_that_direction(
    before: tuple[float, float, str], found: tuple[float, str], after: tuple[float, float, str]
) -> None:
    in_use = Applied(Ratios.of(8e5, *before[:2], Directions[before[2]]))
    estimates = replace(estimated(NONE, value(-found[0])), directions=Directions[found[1]])
    ratios = accept(in_use, estimates).ratios
    assert ratios is not None
    assert (ratios.friction_pa(1), ratios.friction_pa(-1)) == pytest.approx(after[:2])
    assert ratios.directions is Directions[after[2]]
    s = ratios.directions.value or 1
    assert ratios.balance_pa(0.05, s) == pytest.approx(8e5 * 0.05 + s * ratios.friction_pa(s))


@pytest.mark.parametrize("reason", [each for each in Refusal if each is not VALID])
def test_nothing_found_is_a_refusal_that_says_why(reason: Refusal) -> None:
    after = accept(IN_USE, no_estimates(reason))
    assert after.ratios == IN_USE.ratios
    assert after.last_refusal is reason


def test_every_reason_has_its_own_text() -> None:
    assert len({reason.text for reason in Refusal}) == len(Refusal)
