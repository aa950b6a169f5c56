"""Values as registers: the words of known numbers, both word orders, what does not fit."""

import math
import struct

import pytest

from config.register_format import Format, Order, WireType
from fieldbus.modbus.register_packing import Layout


@pytest.mark.parametrize(
    ("kind", "order", "value", "words"),
    [
        ("float32", "big", 1.0, [0x3F80, 0x0000]),
        ("float32", "little", 1.0, [0x0000, 0x3F80]),
        ("float64", "big", -2.0, [0xC000, 0, 0, 0]),
        ("float64", "little", -2.0, [0, 0, 0, 0xC000]),
        ("uint32", "big", 0x12345678, [0x1234, 0x5678]),
        ("uint32", "little", 0x12345678, [0x5678, 0x1234]),
        ("uint64", "little", 0x1122334455667788, [0x7788, 0x5566, 0x3344, 0x1122]),
        ("int16", "big", -1, [0xFFFF]),
        ("int32", "big", -2, [0xFFFF, 0xFFFE]),
    ],
)
def test_known_numbers_lie_as_the_specification_has_them(
    kind: WireType, order: Order, value: float, words: list[int]
) -> None:
    assert Format(kind, order).encode(value) == words
    if kind != "uint64":  # decode gives a float, which holds 53 bits
        assert Format(kind, order).decode(words) == value


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        ("uint16", 65536),
        ("uint16", -1),
        ("int16", 32768),
        ("float32", 1e39),
        ("int32", math.nan),
        ("uint64", math.inf),
        ("uint16", 1.5),
    ],
)
def test_what_does_not_fit_is_refused(kind: WireType, value: float) -> None:
    with pytest.raises(ValueError, match="does not fit"):
        Format(kind).encode(value)


def test_a_wrong_number_of_words_is_refused() -> None:
    with pytest.raises(ValueError, match="takes 2 registers, not 3"):
        Format("float32").decode([0, 0, 0])


PLACES = [
    (7, Format("float32", "little")),
    (3, Format("int16")),
    (4, Format("uint32", "little")),
    (10, Format("uint64")),
]


def test_a_layout_agrees_with_the_formats_it_is_made_of() -> None:
    layout = Layout(PLACES)
    values = (0.15625, -3, 0xDEADBEEF, 123456789012)
    run = struct.unpack(f">{layout.words}H", layout.pack(values))
    assert (layout.address, layout.words) == (3, 11)
    for (address, form), value in zip(PLACES, values, strict=True):
        assert list(run[address - 3 : address - 3 + form.words]) == form.encode(value)
    assert run[6 - 3] == run[9 - 3] == 0, "registers between two values"
    assert layout.unpack(layout.pack(values)) == values


def test_a_layout_without_gaps_is_the_plain_packing() -> None:
    layout = Layout([(0, Format("float32")), (2, Format("uint16"))])
    assert layout.pack((2.0, 5)) == struct.pack(">fH", 2.0, 5)
    assert layout.unpack(struct.pack(">fH", 2.0, 5)) == (2.0, 5)


def test_a_layout_refuses_what_does_not_fit() -> None:
    with pytest.raises(ValueError, match="does not fit"):
        Layout([(0, Format("int16"))]).pack((40000,))
