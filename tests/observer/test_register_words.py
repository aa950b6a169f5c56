"""Registers in words, and what must hold before the valve is identified."""

import math

import pytest

from config.codes import Code, ExperimentState, Fault, Mode, State, texts
from config.registers import BY_NAME, REGISTERS
from northbound.observer.identify_permissives import IDENTIFY_READS, identify_permissives
from northbound.observer.register_words import (
    CAUSE_BITS,
    CODES,
    IDENTIFIED,
    code_text,
    estimates_in_words,
    in_words,
    ne107_causes,
)

READY = {
    "mode": Mode.AUTOMATIC,
    "fault": Fault.NONE,
    "sample_age": 0.01,
    "period": 1e-3,
    "state": State.S0_START,
    "experiment_state": ExperimentState.COMPLETE,
}


@pytest.mark.parametrize("register", CODES)
def test_every_code_is_said_as_the_table_says_it(register: str) -> None:
    for code in CODES[register]:
        assert code_text(register, float(code)) == code.text
    assert register in BY_NAME


def test_every_register_that_lists_codes_is_said_in_words() -> None:
    of = {
        register.name: code for register in REGISTERS for code in Code.__subclasses__() if texts(code) in register.text
    }
    assert len(of) >= 9
    assert of.items() <= CODES.items()


def test_every_bit_and_switch_is_said_in_words() -> None:
    """Whatever a table's text numbers by bits, or says by 0 and 1, nobody has to look up."""
    bits = {each.name for each in REGISTERS if "is cause n" in each.text}
    assert bits == set(CAUSE_BITS)
    assert len(bits) == 5
    for name, less in CAUSE_BITS.items():
        assert in_words(name, 1 << 4, {}) == code_text("ne107_cause", 5 + less)
    for each in (each.name for each in REGISTERS if each.text.startswith(("0 switches", "1 when the estimate"))):
        assert in_words(each, 0, {}) != in_words(each, 1, {}) != ""


def test_causes_are_all_named() -> None:
    assert ne107_causes(0b1001) == ["fault", "not identified"]
    assert ne107_causes(math.nan) == []


def test_an_estimate_has_its_interval_or_its_reason_and_never_both() -> None:
    values = {f"{name}_{what}": 0.0 for name in IDENTIFIED for what in ("e", "std", "valid", "reason")}
    values |= {"a_e": -100.0, "a_std": 10.0, "a_valid": 1.0, "b_e": 5.0, "b_reason": 12.0}
    a, b, *_ = estimates_in_words(values)
    assert (a.value, a.refusal) == (-100.0, "")
    assert a.half_width == pytest.approx(19.6)
    assert math.isnan(b.value)
    assert b.refusal == "b did not come out negative: the spring would push the stem away from rest"
    assert list(estimates_in_words({})) == []


def test_all_permissives_hold_of_a_valve_that_is_ready() -> None:
    assert set(READY) == set(IDENTIFY_READS)
    assert all(each.holds for each in identify_permissives(READY))


@pytest.mark.parametrize(
    ("change", "which"),
    [
        ({"mode": Mode.HOLD}, 0),
        ({"fault": Fault.STALE}, 1),
        ({"sample_age": 5.0}, 2),
        ({"sample_age": math.nan}, 2),
        ({"state": State.S3_IDENTIFY}, 3),
        ({"experiment_state": ExperimentState.UNDER_WAY}, 3),
    ],
)
def test_each_permissive_may_fail_alone(change: dict[str, float], which: int) -> None:
    held = [each.holds for each in identify_permissives(READY | change)]
    assert held == [number != which for number in range(4)]


def test_what_was_not_read_does_not_hold() -> None:
    assert not any(each.holds for each in identify_permissives({}))
