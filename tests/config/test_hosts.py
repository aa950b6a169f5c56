"""Names and addresses of hosts, as a file may give them."""

import pytest

from config.hosts import is_host


@pytest.mark.parametrize(
    "text", ["127.0.0.1", "::1", "fe80::1", "valve-7", "plant_3", "a.b.example", "a.b.example.", "X" * 63, "7"]
)
def test_an_address_or_a_name_is_a_host(text: str) -> None:
    assert is_host(text)


@pytest.mark.parametrize("text", ["", ".", "a..b", "-a", "a-", "a b", "a/b", "a\n", "ü", "[::1]", "http://x", "X" * 64])
def test_what_cannot_be_a_name_is_none(text: str) -> None:
    assert not is_host(text)


def test_a_name_has_at_most_253_characters() -> None:
    assert is_host("a." * 126 + "a")
    assert not is_host("a." * 126 + "aa")
