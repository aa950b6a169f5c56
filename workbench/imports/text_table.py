"""Tables as text: UTF-8 with or without a byte order mark, UTF-16, else Windows-1252; any ends of lines.

Separators are tried, tab, semicolon, bar, comma: the header says which it is, for it must hold all names that are asked
for. Where most lines hold none of these, it is spaces, one or many. Quotation marks are read strictly, so that one that
is never closed is found and not swallowed to the end.
"""

import csv
import io
import re
from collections.abc import Iterator
from functools import partial
from itertools import islice
from pathlib import Path

from config.errors import InputError, explain_failure
from config.plain_file import MOST_COLUMNS
from workbench.imports.labview_file import is_labview, labview_table
from workbench.imports.raw_table import Cell, RawTable

SEPARATORS = {"\t": "tab", ";": "semicolon", "|": "bar", ",": "comma"}
SPACES = " "
HEADER_LINES = 50
"""Lines by which it is told whether spaces separate, and whether every line stands in quotation marks."""
NO_TABLES = {
    r"\s*<(!doctype|html|table)\b": "is a web page: export the numbers as CSV",
    r"\s*<\?xml\b": "is XML: export the numbers as CSV or .xlsx",
    r'\s*(\[\s*)?\{\s*"|\s*\[\s*\[': "is JSON: save it as CSV, as pandas.read_json(FILE).to_csv does",
}
"""How a text begins that is no table, and what to do."""
ANNOTATIONS = ("#group", "#datatype", "#default")
"""Lines in which InfluxDB says what the columns of a CSV file are, before the one that names them."""
MARKS = {
    b"\xef\xbb\xbf": "utf-8-sig",
    b"\xff\xfe\x00\x00": "utf-32",
    b"\x00\x00\xfe\xff": "utf-32",
    b"\xff\xfe": "utf-16",
    b"\xfe\xff": "utf-16",
}
"""Byte order marks, and the encodings they announce."""


def text_tables(path: Path) -> list[RawTable]:
    """Return the tables that a text may be, one a separator that occurs in it.

    Raises:
        InputError: it is no text, or empty.
    """
    text, encoding = decode_text(path)
    if not text.strip():
        raise InputError(str(path), "holds no samples: it is empty")
    for begin, problem in NO_TABLES.items():
        if re.match(begin, text, re.IGNORECASE):
            raise InputError(str(path), problem)
    ended = text.endswith(("\n", "\r"))
    if is_labview(text):
        return [labview_table(text, ended=ended)]
    text = _without_annotations(text)
    first = [line.strip() for line in islice(io.StringIO(text), 4 * HEADER_LINES) if line.strip()][:HEADER_LINES]
    _require_fields(path, first)
    notes = () if encoding.startswith("utf-8") else (("encoding", encoding),)
    length = text.count("\n") or text.count("\r")
    found = [each for each in SEPARATORS if each in text] or [","]
    if 2 * sum(_has_spaces_alone(line) for line in first) > len(first):
        return [
            RawTable(
                "fields separated by spaces", "line", partial(_split_at_spaces, text), SPACES, "", ended, notes, length
            )
        ]
    return [
        RawTable(
            f"fields separated by {SEPARATORS[each]}",
            "line",
            partial(_rows, path, text, each),
            separator=each,
            ended=ended,
            notes=notes,
            length=length,
        )
        for each in found
    ]


def _require_fields(path: Path, lines: list[str]) -> None:
    """Check that it is not every line as a whole that stands in quotation marks, as after a table saved twice.

    Raises:
        InputError: it is.
    """
    whole = [line[:1] == line[-1:] == '"' and '"' not in line[1:-1].replace('""', "") for line in lines]
    if len(lines) > 1 and all(whole) and any(each in line for line in lines for each in SEPARATORS):
        problem = "every line stands in quotation marks as a whole, so that nothing separates its fields"
        raise InputError(str(path), f"{problem}: take them away, sed 's/^\"//; s/\"$//' FILE > export.csv")


def _has_spaces_alone(line: str) -> bool:
    """Return whether nothing but spaces can separate a line's fields, and the last of several begins as a number."""
    *before, last = line.split()
    return bool(before) and not any(each in line for each in SEPARATORS) and last.lstrip("+-.")[:1].isdigit()


def _split_at_spaces(text: str) -> Iterator[tuple[int, list[Cell]]]:
    for number, line in enumerate(io.StringIO(text), start=1):
        yield number, [cell.strip('"') for cell in line.split()]


def _without_annotations(text: str) -> str:
    """Return an annotated CSV file of InfluxDB with its annotations empty; the numbers of lines stay."""
    if not text.startswith(ANNOTATIONS):
        return text
    lines = text.splitlines(keepends=True)
    return "".join("\n" if each.startswith(ANNOTATIONS) else each for each in lines)


def decode_text(path: Path) -> tuple[str, str]:
    """Return the text of a file and its encoding.

    Raises:
        InputError: it cannot be read, or is no text; names the line of a NUL character.
    """
    with explain_failure(path, "cannot be read"):
        data = path.read_bytes()
    encoding = _encoding(data)
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        if b"\0" in data[:1000]:
            raise InputError(str(path), "is no text, and of no kind that is read: export it as CSV or .xlsx") from None
        raise InputError(str(path), f"is no text: byte {error.start + 1} is not {encoding}; save it as UTF-8") from None
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        raise InputError(
            str(path), f"line {line}: a NUL character: the file is damaged there, or no text; cut it before"
        )
    return text, encoding


def _encoding(data: bytes) -> str:
    for mark, encoding in MARKS.items():
        if data.startswith(mark):
            return encoding
    if guessed := _utf_16_without_mark(data[:1000]):
        return guessed
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def _utf_16_without_mark(data: bytes) -> str | None:
    """Return which UTF-16 it is, by the NUL that is half of each of its Latin characters; None if it is none."""
    even, odd = data[::2].count(0), data[1::2].count(0)
    if max(even, odd) < 0.2 * len(data) or min(even, odd) > 0.1 * max(even, odd):
        return None
    return "utf-16-be" if even > odd else "utf-16-le"


def _rows(path: Path, text: str, separator: str) -> Iterator[tuple[int, list[Cell]]]:
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True, skipinitialspace=True)
    while True:
        begin = reader.line_num + 1
        try:
            row = next(reader, None)
        except csv.Error as error:
            raise InputError(str(path), f"line {begin}: {_describe_error(error)}") from None
        if row is None:
            return
        if len(row) > MOST_COLUMNS:
            raise InputError(str(path), f"line {begin}: {len(row)} fields; allowed are {MOST_COLUMNS}")
        yield reader.line_num, [cell.strip() for cell in row]


def _describe_error(error: csv.Error) -> str:
    if "field larger" in str(error):
        return f"a field of more than {csv.field_size_limit()} characters; is a quotation mark not closed?"
    if "unexpected end" in str(error):
        return "a quotation mark is not closed before the file ends"
    return f"quotation marks that no field separator follows ({error})"
