"""A number that a person types is read as it was meant, or refused: nothing of it is dropped."""

import pytest

from config.errors import InputError
from webpage.number_field import read_number


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("50", 50.0),
        ("5.5", 5.5),
        ("5,5", 5.5),
        (",5", 0.5),
        ("0,125", 0.125),
        (" -3 ", -3.0),
        ("1e2", 100.0),
        ("7,", 7.0),
    ],
)
def test_a_point_and_a_comma_are_read(typed: str, meant: float) -> None:
    assert read_number("reference, %", typed) == meant


@pytest.mark.parametrize(
    "typed", ["5x5", "1.234,5", "1,234.5", "1 000", "5,5,5", "nan", "inf", "0x10", "1_0", "%", "\u0663", "\u00b2"]
)
def test_what_is_no_number_is_refused_with_what_was_typed(typed: str) -> None:
    with pytest.raises(InputError, match="reference, %: must be a number") as refused:
        read_number("reference, %", typed)
    assert repr(typed) in str(refused.value)


def test_what_may_be_either_of_two_is_refused() -> None:
    with pytest.raises(InputError, match=r"type 1\.500 or 1500; it may be either, got '1,500'"):
        read_number("stroke, mm", "1,500")


def test_nothing_typed_is_no_number() -> None:
    assert read_number("reference, %", "  ") is None
