"""Records that cannot tell: each says what cannot be known, and nothing is named."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from config.errors import InputError
from config.recording import Column, Recording
from tests.cases import few_always
from tests.workbench.valves import NOISE_M, SEED
from workbench.blind.hiding import Hidden, hide
from workbench.diagnosis.diagnosis import diagnose

Spoil = Callable[[dict[str, Column], Column], dict[str, Column]]


@cache
def hidden(seed: int) -> Hidden:
    return hide(seed, duration_s=20.0)


REFUSED: dict[str, tuple[Spoil, str]] = {
    "no slip": (lambda c, noise: {"position_m": 0.05 + noise}, "the stem moves 0 times"),
    "one slip": (
        lambda c, noise: {"position_m": np.where(c["time_s"] < c["time_s"][-1] / 2.0, 0.03, 0.05) + noise},
        "the stem moves 1 times",
    ),
    "creeps": (lambda c, noise: {"position_m": 0.03 + 1e-3 * c["time_s"] + noise}, "creeps or moves throughout"),
}
UNJUDGED: dict[str, tuple[Spoil, str]] = {
    "another command": (lambda c, _: {"command_pa": hidden(308).fit.command_pa}, "against its command"),
    "clocks far apart": (lambda c, _: {"command_pa": np.roll(c["command_pa"], 70)}, "its command"),
    "motion all the time": (
        lambda c, noise: {"position_m": 0.05 + 0.03 * np.sin(2.0 * np.pi * c["time_s"] / 3.0) + noise},
        "against its command",
    ),
}


def spoilt(spoil: Spoil) -> Recording:
    columns = dict(hidden(307).fit.columns)
    noise = NOISE_M * np.random.default_rng(1).standard_normal(len(columns["time_s"]))
    return Recording(columns | spoil(columns, noise))


@pytest.mark.parametrize("case", REFUSED)
def test_too_few_rests_are_refused_with_what_is_missing(case: str) -> None:
    spoil, said = REFUSED[case]
    with pytest.raises(InputError, match=said):
        diagnose(spoilt(spoil), SEED, effects=("preload",), workers=1)


@pytest.mark.parametrize("case", few_always(list(UNJUDGED), 2))
def test_what_the_command_did_not_do_is_not_judged(case: str) -> None:
    spoil, said = UNJUDGED[case]
    found = diagnose(spoilt(spoil), SEED, effects=("preload",), workers=1)
    assert (found.verdict, found.missing) == ("unjudged", ())
    assert said in found.sentence


def test_ten_bits_are_said_and_no_effect_is_named_for_them() -> None:
    bare = hide(307, duration_s=12.0, effects=0)
    quantum_m = SEED.valve.stroke_m / 1024.0
    columns = dict(bare.fit.columns)
    rounded_m = quantum_m * np.round(columns["position_m"] / quantum_m)
    found = diagnose(Recording(columns | {"position_m": rounded_m}), bare.base, effects=("preload",), workers=1)
    assert found.missing == ()
    assert "is rounded to" in found.summary()
