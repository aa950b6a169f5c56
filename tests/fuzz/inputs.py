"""Inputs near those that a parser takes: bytes and lines changed, values that nobody would write."""

from collections.abc import Iterator, Sequence
from random import Random

MOST_BYTES = 400
STRANGE = (
    "", "0", "-1", "1e999", "-0.0", "nan", "inf", "9" * 5000, "0x", "1_0", "true", "null", '"', '""', "''", '"\\u0000"',
    '"\\ud800"', "[]", "[" * 2000, "{}", "{" * 2000, "[[", "]", "=", "#", ",", ";", "\\", "\0", "\ufeff", "\ud800",
    "\r", "\r\n", "\u2028", "\x1f", "٣", "1979-05-27T07:32:00Z", "25:61:61", "%s%n", "../../x", "x" * 3000,
    "$NODEID+0x", "0b1", "1e-400", "é",
)  # fmt: skip
"""What stands where a value should."""


def near(good: Sequence[bytes], count: int, seed: str, *, text: bool) -> Iterator[bytes]:
    """Yield so many inputs, of one seed the same: such as are taken after a few changes, and every fourth any bytes."""
    by = Random(seed)
    for number in range(count):
        yield _edited(by.choice(good), by, text) if number % 4 else by.randbytes(by.randint(0, MOST_BYTES))


def _edited(good: bytes, by: Random, text: bool) -> bytes:
    data = bytearray(good)
    for _ in range(by.randint(1, 4)):
        (by.choice((_a_value, _a_line, _a_byte)) if text else _a_byte)(data, by)
    return bytes(data)


def _a_byte(data: bytearray, by: Random) -> None:
    """Change, leave out, put in or cut."""
    at = by.randint(0, len(data))
    kind = by.randrange(5)
    if kind == 0 and at < len(data):
        data[at] = by.choice((0, 1, 0x7F, 0x80, 0xFF, by.randrange(256)))
    elif kind == 1:
        del data[at : at + by.choice((1, 2, 4, 50))]
    elif kind == 2:
        data[at:at] = by.randbytes(by.choice((1, 2, 4, 8)))
    elif kind == 3 and at < len(data):
        data[at] ^= 1 << by.randrange(8)
    else:
        del data[at:]


def _a_line(data: bytearray, by: Random) -> None:
    """Leave out a line, say it again, or elsewhere."""
    lines = bytes(data).split(b"\n")
    line = lines.pop(by.randrange(len(lines)))
    for _ in range(by.choice((0, 1, 2))):
        lines.insert(by.randint(0, len(lines)), line)
    data[:] = b"\n".join(lines)


def _a_value(data: bytearray, by: Random) -> None:
    """Put something strange behind one of the signs that values stand behind."""
    behind = [at + 1 for at, sign in enumerate(data) if sign in b"=:,;[{\n"] or [0]
    begin = by.choice(behind)
    ends = [at for at in range(begin, len(data)) if data[at] in b",;]}\n"]
    data[begin : ends[0] if ends else len(data)] = by.choice(STRANGE).encode(errors="surrogatepass")
