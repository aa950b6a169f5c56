"""The static law from landings: exact, under noise, and when it is refused."""

from collections.abc import Iterable

import numpy as np
import pytest

from config.codes import Refusal
from positioner.estimation.acceptance import Applied, Ratios
from positioner.estimation.estimates import Estimate, Estimates
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.local_balance import LocalBalance
from positioner.estimation.landings.static_identification import StaticIdentification
from positioner.estimation.landings.static_law import StaticLaw, static_law

STROKE_M = 0.1016
SLOPE, UP, DOWN = 814e3, 31e3, 13e3
PLACES = (0.35, 0.45, 0.55, 0.65, 0.75)


def landing(position_m: float, direction: int, command_pa: float, std_m: float = 1e-6) -> SlideOutcome:
    return SlideOutcome(0.0, direction, position_m - direction * 0.01, command_pa, position_m, std_m, True, True)


def landings(
    *,
    slope: float = SLOPE,
    up: float = UP,
    down: float = DOWN,
    noise_pa: float = 0.0,
    seed: int = 0,
    bow: float = 0.0,
) -> list[SlideOutcome]:
    """Return landings at the same places each way; `bow` bends the line, Pa in the middle of the stroke."""
    rng = np.random.default_rng(seed)
    found = []
    for direction, friction in ((1, up), (-1, -down)):
        for place in PLACES:
            x = (place + 0.02 * rng.uniform(-1, 1)) * STROKE_M
            p = slope * x + friction + bow * 4 * (x / STROKE_M) * (1 - x / STROKE_M) + rng.normal(0.0, 1.0) * noise_pa
            found.append(landing(x, direction, p))
    return found


def test_exact_landings_give_each_direction_its_friction() -> None:
    law = static_law(landings(), STROKE_M)
    assert law.valid
    assert (law.slope.value, law.up.value, law.down.value) == pytest.approx((SLOPE, UP, DOWN))
    ratios = law.ratios
    found = (ratios.b_over_c, ratios.k_over_c, ratios.offset_pa)
    assert found == pytest.approx((-SLOPE, -(UP + DOWN) / 2, (UP - DOWN) / 2))


def test_three_deviations_hold_the_truth() -> None:
    """99.7 % of normal residuals, and of so few landings."""
    off = []
    for seed in range(400):
        law = static_law(landings(noise_pa=300.0, seed=seed), STROKE_M)
        for each, true in ((law.slope, SLOPE), (law.up, UP), (law.down, DOWN)):
            off.append(abs(each.value - true) / each.std)
    assert np.mean(np.array(off) > 3.0) < 0.01
    assert np.mean(np.array(off) > 1.0) > 0.1, "not so wide that they say nothing"


def test_one_slide_that_went_wrong_does_not_bend_the_law() -> None:
    bad = landing(0.5 * STROKE_M, 1, SLOPE * 0.5 * STROKE_M + UP + 8e3)
    law = static_law([*landings(noise_pa=30.0), bad], STROKE_M)
    assert law.slope.value == pytest.approx(SLOPE, rel=0.02)
    assert abs(law.slope.value - SLOPE) < 3 * law.slope.std


def test_a_packing_that_gave_way_is_no_slide() -> None:
    """Stuck inside its band the stem moves a little with the pressure: far less than a slide would go."""
    gave_way = [
        SlideOutcome(0.0, -1, 0.07, SLOPE * 0.0694 + each, 0.0694, 1e-6, True, True) for each in (20e3, 10e3, 0.0)
    ]
    law = static_law([*landings(), *gave_way], STROKE_M)
    assert law.landings == len(landings())
    assert law.down.value == pytest.approx(DOWN)


@pytest.mark.parametrize(
    ("found", "reason"),
    [
        (landings()[:5], Refusal.LANDINGS_TOO_FEW),
        ([], Refusal.LANDINGS_TOO_FEW),
        (landings(slope=-SLOPE, up=150e3, down=150e3), Refusal.B_OVER_C_NOT_NEGATIVE),
        (landings(up=-9e3, down=-9e3), Refusal.K_OVER_C_NOT_NEGATIVE),
        (landings(noise_pa=9e3, seed=3), Refusal.LANDINGS_NOT_STRAIGHT),
        (landings(noise_pa=3e3), Refusal.TOO_UNCERTAIN),
    ],
)
def test_what_cannot_be_is_refused_with_its_reason(found: list[SlideOutcome], reason: Refusal) -> None:
    law = static_law(found, STROKE_M)
    assert not law.valid
    assert law.reason is reason


def identified(found: list[SlideOutcome]) -> StaticIdentification:
    statics = StaticIdentification(STROKE_M)
    for each in found:
        statics.take(each)
    return statics


def seeds_estimates(b_over_c: float, k_over_c: float) -> Estimates:
    one = Estimate(-1.0, 0.01, Refusal.VALID)
    return Estimates(
        one, one, one, one, Estimate(b_over_c, 10.0, Refusal.VALID), Estimate(k_over_c, 10.0, Refusal.VALID), 1.0, 0.0
    )


def test_the_seeds_model_is_refused_where_landings_contradict_it() -> None:
    """Identified upward only, preload and friction are one number: k/c is 41 % off, with a small deviation."""
    statics = identified(landings())
    tested = statics.tested(seeds_estimates(-SLOPE, -UP))
    assert tested.k_over_c.reason is Refusal.CONTRADICTED_BY_LANDINGS
    assert not tested.law_ready
    corrected = statics.corrected(Applied(Ratios(-SLOPE, -UP), 1))
    assert corrected.ratios == statics.law.ratios
    assert corrected.last_refusal is Refusal.CONTRADICTED_BY_LANDINGS


def test_the_seeds_model_stands_where_landings_agree() -> None:
    statics = identified(landings(up=22e3, down=22e3, noise_pa=20.0))
    estimates = seeds_estimates(-SLOPE, -22e3)
    assert statics.tested(estimates) is estimates
    applied = Applied(Ratios(-SLOPE, -22e3), 1)
    assert statics.corrected(applied) is applied


def balance(ratios: Ratios, landings: Iterable[SlideOutcome]) -> LocalBalance:
    return LocalBalance(ratios=ratios, landings=tuple(landings), stroke_m=STROKE_M)


def test_a_local_landing_corrects_the_straight_law() -> None:
    law: StaticLaw = static_law(landings(bow=2e3), STROKE_M)
    place_m = 0.5 * STROKE_M
    true_pa = SLOPE * place_m + UP + 2e3
    near = landing(place_m, 1, true_pa)
    assert abs(balance(law.ratios, ()).pressure_pa(place_m, 1) - true_pa) > 100
    assert abs(balance(law.ratios, (near,)).pressure_pa(place_m, 1) - true_pa) < 30
    other_pa = balance(law.ratios, (near,)).pressure_pa(place_m, -1)
    assert other_pa == pytest.approx(law.ratios.balance_pa(place_m, -1), rel=1e-9)


def bent_pa(share: float, s: int) -> float:
    """The pressure of a spring that hardens by 30 % and of friction that grows by 30 %, Pa."""
    return SLOPE * STROKE_M * (share + 0.3 * share**3) + s * 8e3 * (1 + 0.3 * share)


def test_landings_bend_the_law_as_the_valve_is_bent() -> None:
    """Eight slides in all, none where the law is asked: a straight law is off there by 1.5 % of stroke."""
    shares = (0.2, 0.4, 0.6, 0.8)
    landed = [landing(each * STROKE_M, s, bent_pa(each, s)) for s in (1, -1) for each in shares]
    law = static_law(landed, STROKE_M)
    for share, s in ((0.5, 1), (0.5, -1), (0.3, 1), (0.75, -1)):
        off_pa = balance(law.ratios, law.slides).pressure_pa(share * STROKE_M, s) - bent_pa(share, s)
        assert abs(off_pa) < 1e-3 * SLOPE * STROKE_M
    assert balance(law.ratios, law.slides).scatter_m < 1e-3 * STROKE_M < law.residual_m


def test_one_landing_that_lies_apart_does_not_bend_the_law() -> None:
    shares = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
    landed = [landing(each * STROKE_M, s, bent_pa(each, s)) for s in (1, -1) for each in shares]
    apart = [landed[3]._replace(command_pa=landed[3].command_pa + 0.02 * SLOPE * STROKE_M), *landed[:3], *landed[4:]]
    law = static_law(landed, STROKE_M)
    for share, s in ((0.3, 1), (0.75, -1)):
        off_pa = balance(law.ratios, apart).pressure_pa(share * STROKE_M, s) - bent_pa(share, s)
        assert abs(off_pa) < 2e-3 * SLOPE * STROKE_M


def test_the_residual_says_how_far_a_bent_valve_lands_off_where_there_were_no_landings() -> None:
    """Friction that grows over the travel, and landings of each direction in one part of it only."""

    def true_pa(share: float, s: int) -> float:
        return SLOPE * STROKE_M * share + s * 8e3 * (1 + 0.3 * share)

    ups = [landing(each * STROKE_M, 1, true_pa(each, 1)) for each in np.linspace(0.1, 0.9, 20)]
    downs = [landing(each * STROKE_M, -1, true_pa(each, -1)) for each in np.linspace(0.5, 0.85, 8)]
    law = static_law([*ups, *downs], STROKE_M)
    off_m = (law.ratios.balance_pa(0.35 * STROKE_M, -1) - true_pa(0.35, -1)) / SLOPE
    assert abs(off_m) > 5e-3 * STROKE_M
    assert abs(off_m) < 3 * law.residual_m


def test_what_the_last_slides_missed_alike_everywhere_is_corrected_everywhere() -> None:
    """Friction has grown by 300 Pa since: the last slides up, far apart, say so for a place that none has been to."""
    ratios = Ratios(-SLOPE, -UP)
    before = [(x, s, 0.0) for x in np.linspace(0.02, 0.08, 8) for s in (1, -1)]
    lately = [(x, 1, 300.0) for x in (0.08, 0.02, 0.065)]
    landings = [
        SlideOutcome(float(i), s, 0.0, SLOPE * x + s * UP + off, x, 1e-6, True, True)
        for i, (x, s, off) in enumerate([*before, *lately])
    ]
    found = balance(ratios, landings[::-1]).pressure_pa(0.045, 1) - (SLOPE * 0.045 + UP)
    assert 60.0 < found < 330.0  # without: 13 Pa
    assert abs(balance(ratios, landings[::-1]).pressure_pa(0.045, -1) - (SLOPE * 0.045 - UP)) < 60.0


@pytest.mark.parametrize("rho", [0.0, 0.02, 0.3])
def test_a_stem_that_swings_past_its_balance_has_its_law_all_the_same(rho: float) -> None:
    """r = 0.43 of a damping ratio of 0.26: of slides of 2 to 12 % each sticks up to 3.6 % past its balance."""
    rng = np.random.default_rng(1)
    found = []
    for direction, friction in ((1, UP), (-1, -DOWN)):
        for place in np.linspace(0.3, 0.7, 8):
            way = direction * rng.uniform(0.02, 0.12) * STROKE_M
            at = place * STROKE_M
            balance = at - rho * way
            found.append(SlideOutcome(0.0, direction, at - way, SLOPE * balance + friction, at, 1e-6, True, True))
    law = static_law(found, STROKE_M)
    assert law.swing == pytest.approx(rho, abs=1e-6)
    for each, true in ((law.slope, SLOPE), (law.up, UP), (law.down, DOWN)):
        assert abs(each.value - true) < 3 * each.std
        assert each.std < 0.01 * true


def test_scatter_is_no_swing() -> None:
    assert all(static_law(landings(noise_pa=300.0, seed=seed), STROKE_M).swing == 0.0 for seed in range(100))


@pytest.mark.parametrize("direction", [1, -1])
def test_a_short_slide_lands_where_long_ones_stick_short_of_their_balance(direction: int) -> None:
    """Behind a slow I/P: each long one 0.2 % of stroke short, one of 1 % not; no landing is near the next."""
    margin_m, short_m = 0.01 * STROKE_M, 2e-3 * STROKE_M

    def landed(at_m: float, way_m: float, s: int, sent_m: float) -> SlideOutcome:
        from_m = at_m - s * way_m
        lands_m = at_m if way_m < 2.0 * margin_m else at_m - s * short_m
        command_pa = SLOPE * (at_m + s * sent_m) + (UP if s > 0 else -DOWN)
        return SlideOutcome(0.0, s, from_m, command_pa, lands_m + s * sent_m, 1e-6, True, True)

    places_m = np.linspace(0.3, 0.7, 6) * STROKE_M
    landings = [landed(float(at_m), 0.1 * STROKE_M, s, 0.0) for at_m in places_m for s in (1, -1)]
    ratios, missed_m = static_law(landings, STROKE_M).ratios, []
    for at_m in np.linspace(0.35, 0.65, 7) * STROKE_M:
        asked_pa = balance(ratios, landings).pressure_pa(float(at_m), direction, margin_m)
        sent_m = direction * (asked_pa - SLOPE * at_m - (UP if direction > 0 else -DOWN)) / SLOPE
        landings.insert(0, landed(float(at_m), margin_m, direction, sent_m))
        missed_m.append(abs(sent_m))
    assert missed_m[0] > 0.9 * short_m
    assert missed_m[-1] < 0.1 * short_m
    long_pa = balance(ratios, landings).pressure_pa(0.5 * STROKE_M, direction, 0.1 * STROKE_M)
    assert abs(long_pa - ratios.balance_pa(0.5 * STROKE_M, direction)) < 0.1 * SLOPE * short_m, "long ones go as before"
