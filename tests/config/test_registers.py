"""The register table: consistent in itself, and the same as people were told."""

import math

import pytest

from config.errors import InputError
from config.registers import BY_NAME, COMMANDS, REGISTERS, register_named


def test_no_two_registers_overlap() -> None:
    taken = [address for register in REGISTERS for address in range(register.address, register.end)]
    assert len(taken) == len(set(taken))


def test_commands_lie_without_a_gap_so_that_one_write_can_give_them_all() -> None:
    assert [register.address for register in COMMANDS][1:] == [register.end for register in COMMANDS][:-1]


def test_addresses_people_rely_on() -> None:
    """Changed only with an entry in the change log and a new map version."""
    told = {"reference": 0, "mode": 3, "eta_1": 4, "state": 100, "position": 104, "a_e": 200, "k_over_c_e": 230}
    assert {name: BY_NAME[name].address for name in told} == told


def test_every_writable_register_says_what_is_allowed() -> None:
    for register in COMMANDS:
        assert register.problem_with(math.nan)
        assert register.minimum is not None
        assert register.problem_with(register.minimum) is None
        assert register.problem_with(register.minimum - 1)


def test_a_reference_beyond_the_stroke_is_named() -> None:
    assert BY_NAME["reference"].problem_with(1.00000012) == "reference: allowed is 0 to 1 p.u., got 1.00000012"
    assert BY_NAME["mode"].problem_with(3.0) == "mode: allowed is 0 to 2, got 3"
    assert BY_NAME["reference"].problem_with(1.5) == "reference: allowed is 0 to 1 p.u., got 1.5"
    assert BY_NAME["state"].problem_with(1) == "state: is read-only"


def test_a_register_of_whole_numbers_refuses_others() -> None:
    assert BY_NAME["mode"].problem_with(1.5) == "mode: allowed is a whole number, 0 to 2, got 1.5"
    assert BY_NAME["eta_1"].problem_with(0.4)
    assert BY_NAME["mode"].problem_with(2.0) is None


def test_an_unknown_name_is_answered_with_near_ones() -> None:
    with pytest.raises(InputError, match="near: position, position_m"):
        register_named("position_m_raw")
