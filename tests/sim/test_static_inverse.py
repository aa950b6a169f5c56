"""The inverse of an extended valve: what it says is where the simulated stem lands, and what has none is refused."""

from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from config.extended_valve import ExtendedValve, Inverse
from config.valve_file import EffectTable, ValveFile
from sim.effect import Effect, read_effect
from sim.open_loop import respond
from sim.static_inverse import extended_valve
from tests.cases import few_always
from tests.sim.library import EFFECTS, SEED, Series, library, table, theta_with

L = SEED.valve.stroke_m
A, K_S, F_C, F_S = 0.0645, 52538.0, 1423.4, 1708.09
each_effect = pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)
LAND_S = 3.0
YIELDS_S = 0.5
"""Of a ramp so slow that a packing yields before it lets go."""
WEAK = {"friction_drift": 0, "ip_lag": 0, "stribeck": 0, "supply_limit": 0}
"""Which start is taken of effects whose landings depend on more than the balance, or which do not let the stem up:
behind a slow pressure, for one, a stem sticks a little before the pressure has arrived."""


def values_of(effect: Effect) -> tuple[float, ...]:
    strengths = effect.strengths(SEED.valve)
    return strengths[WEAK.get(effect.name, len(strengths) // 2)]


def inverse_of(*tables: EffectTable) -> ExtendedValve:
    return extended_valve(ValveFile(valve=SEED.valve, effect=tables), "better.toml")


def after(theta: Series, from_m: float, held_pa: float, command_pa: float, ramp_s: float = 1e-3) -> tuple[float, float]:
    """Return where a stem at rest and what is indicated of it are, m, long after a change of the pressure."""
    ramp_pa = np.linspace(held_pa, command_pa, round(ramp_s / 1e-3) + 1)[1:]
    periods_s = np.append(np.full(ramp_pa.size, 1e-3), LAND_S)
    commands_pa = np.append(ramp_pa, command_pa)
    answer = respond(library(), theta, commands_pa, periods_s, position_m=from_m, pressure_pa=held_pa, step_s=5e-4)
    return float(answer.position_m[-1]), float(answer.indicated_m[-1])


def test_the_bare_valve_by_hand() -> None:
    bare = inverse_of()
    x = 0.04
    for s in (1, -1):
        assert bare.landing_pa(x, s) == pytest.approx((K_S * x + s * F_C) / A, rel=1e-9)
        assert bare.breakaway_pa(x, s) == pytest.approx((K_S * x + s * F_S) / A, rel=1e-9)
        assert bare.margin_m(x, s) == pytest.approx((F_S - F_C) / K_S, rel=1e-6)
        assert bare.stem_m(x, s) == pytest.approx(x)
    assert bare.inverse == Inverse()


@each_effect
def test_a_slide_lands_where_the_inverse_says(effect: Effect) -> None:
    inverse, theta = inverse_of(table(effect, values_of(effect))), theta_with(effect, values_of(effect))
    for s, to_m in ((1, 0.55 * L), (-1, 0.5 * L)):
        from_m = to_m - s * 0.15 * L
        rests_pa = 0.5 * (inverse.landing_pa(from_m, 1) + inverse.landing_pa(from_m, -1))
        stem_m, indicated_m = after(theta, from_m, rests_pa, inverse.landing_pa(to_m, s))
        assert stem_m == pytest.approx(to_m, abs=2e-4 * L)
        quantum_m = values_of(effect)[0] if effect.name == "quantisation" else 0.0
        assert inverse.stem_m(indicated_m, s) == pytest.approx(to_m, abs=2e-4 * L + quantum_m)


@each_effect
@pytest.mark.parametrize("s", few_always([-1, 1]))
def test_a_stem_breaks_loose_where_the_inverse_says(effect: Effect, s: int) -> None:
    if effect.name == "supply_limit" and s > 0:
        pytest.skip("beyond the supply")
    inverse, theta = inverse_of(table(effect, values_of(effect))), theta_with(effect, values_of(effect))
    x = 0.5 * L
    loose_pa, held_pa = inverse.breakaway_pa(x, s), inverse.landing_pa(x, -s)
    away_pa = s * (loose_pa - inverse.landing_pa(x, s))
    held_m, _ = after(theta, x, held_pa, loose_pa - s * 0.03 * away_pa, YIELDS_S)
    loose_m, _ = after(theta, x, held_pa, loose_pa + s * 0.03 * away_pa, YIELDS_S)
    assert abs(held_m - x) < 3e-3 * L
    assert s * (loose_m - x) == pytest.approx(1.03 * inverse.margin_m(x, s), rel=0.05)


def test_lags_are_added_and_the_narrowest_limits_hold() -> None:
    first = Inverse(lag_s=0.1, most_pa=3e5, filling_pa_per_s=1e5, lowest_m=0.01)
    second = Inverse(lag_s=0.2, dead_time_s=0.05, most_pa=2e5, least_pa=1e4, filling_pa_per_s=4e4)
    both = first.joined(second)
    assert both.lag_s == pytest.approx(0.3)
    assert both.dead_time_s == 0.05
    assert (both.lowest_m, both.highest_m) == (0.01, float("inf"))
    assert (both.least_pa, both.most_pa, both.filling_pa_per_s) == (1e4, 2e5, 4e4)


OWN = """from typing import Annotated, NamedTuple
from sim.effect import Parameter
class Parameters(NamedTuple):
    weight_n: Annotated[float, Parameter("weight", 0.0, 1e6)]
{declared}
def force(q, x): return {force}
"""


def own(tmp_path: Path, declared: str, force: str = "-q.weight_n") -> EffectTable:
    path = tmp_path / "own.py"
    path.write_text(OWN.format(declared=declared, force=force))
    return EffectTable.model_validate({"name": str(path), "weight_n": 100.0})


def refusal(*tables: EffectTable) -> str:
    with pytest.raises(InputError) as caught:
        inverse_of(*tables)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_an_own_effect_needs_no_more_than_the_word(tmp_path: Path) -> None:
    extended = inverse_of(own(tmp_path, 'INVERSE = "balance"'))
    assert extended.landing_pa(0.05, 1) == pytest.approx((K_S * 0.05 + F_C + 100.0) / A, rel=1e-9)


def test_an_effect_without_an_inverse_is_refused_by_name(tmp_path: Path) -> None:
    said = refusal(own(tmp_path, ""))
    assert said.startswith('better.toml: effect own declares no inverse: neither INVERSE = "balance" nor inverse(q)')


@pytest.mark.parametrize(
    ("force", "said"),
    [
        ("60000.0 * x", "does not rise with the position from 0 to"),
        ("5e4 * (x > 0.05)", "does not rise with the position from 0.04978 to"),
    ],
)
def test_what_is_not_monotone_is_refused(tmp_path: Path, force: str, said: str) -> None:
    assert f"better.toml: the pressure that lands it opening {said}" in refusal(
        own(tmp_path, 'INVERSE = "balance"', force)
    )


@pytest.mark.parametrize(
    ("declared", "force", "said"),
    [
        ('INVERSE = "balance"', "1.0 / 0.0 * x", "fails: ZeroDivisionError: float division by zero"),
        ('INVERSE = "balance"', "none_such(x)", "fails: NameError: name 'none_such' is not defined"),
        ("def inverse(q): return None", "0.0", "inverse(q) of effect own: an Inverse is needed, got None"),
        (
            "def inverse(q): return 1.0 / 0.0",
            "0.0",
            "inverse(q) of effect own fails: ZeroDivisionError: float division",
        ),
    ],
)
def test_an_own_effect_that_fails_is_one_line(tmp_path: Path, declared: str, force: str, said: str) -> None:
    assert said in refusal(own(tmp_path, declared, force))


def test_a_parameter_out_of_its_range_is_refused() -> None:
    assert "asymmetry: must be a number from -0.9 to 0.9" in refusal(table(EFFECTS["asymmetric_friction"], [1.5]))


@pytest.mark.parametrize(
    ("declared", "said"),
    [
        ('INVERSE = "none"', "INVERSE: allowed is \"balance\", got 'none'"),
        ('INVERSE = "balance"\ndef inverse(q): return None', "not both"),
    ],
)
def test_a_declaration_is_one_of_two(tmp_path: Path, declared: str, said: str) -> None:
    table_of_it = own(tmp_path, declared)
    with pytest.raises(InputError, match=r"own\.py") as caught:
        read_effect(Path(table_of_it.name))
    assert said in str(caught.value)


@pytest.mark.parametrize("share", np.linspace(0.0, 1.0, 7).tolist())
def test_what_is_indicated_leads_back_to_the_stem(share: float) -> None:
    bowed = inverse_of(table(EFFECTS["sensor_nonlinearity"], [0.02 * L, L]))
    indicated_m = share * L + 4 * 0.02 * L * share * (1 - share)
    assert bowed.stem_m(indicated_m, 0) == pytest.approx(share * L, abs=1e-5 * L)
