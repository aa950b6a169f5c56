"""What a document says of a code is what the code says: tables written from it, numbers and names in the text."""

import re
from pathlib import Path
from typing import get_args

import pytest

from config import codes
from config.codes import Code, Fault, InhibitReason
from config.law_names import law_names
from docs import code_tables
from workbench.diagnosis.verdict import Verdict

DOCS = Path(__file__).parents[2] / "docs"
STALE = "stale: run python -m docs.code_tables"


def said(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def test_the_tables_are_those_of_today() -> None:
    assert said("codes.md") == code_tables.codes(), STALE
    assert said("law.md") == code_tables.with_transitions(said("law.md")), STALE
    assert said("history.md") == code_tables.with_tables(said("history.md")), STALE
    assert said("reliability.md") == code_tables.with_states(said("reliability.md")), STALE


def test_every_code_has_its_table() -> None:
    assert set(Code.__subclasses__()) == set(code_tables.SERVED)


def test_numbers_in_the_text_say_what_the_code_says() -> None:
    found = re.findall(r"`why` = (\d+)(?:, ([^;.)|\n]*[^;.)|\s]))?", said("law.md"))
    assert len(found) >= 4
    for number, words in found:
        assert words in ("", InhibitReason(int(number)).text)


def test_the_table_of_faults_has_every_code_of_a_fault() -> None:
    table = said("reliability.md").partition("\n## How a fault ends\n")[2].partition("\n## ")[0]
    assert set(re.findall(r"`Fault\.(\w+)`", table)) == {each.name for each in Fault} - {"NONE"}


def test_the_documents_have_every_verdict_and_every_law() -> None:
    assert re.findall(r"^\| `(\w+)` \|", said("diagnosis.md"), re.MULTILINE) == list(get_args(Verdict))
    laws = re.findall(r'^- `"(\w+)"`', said("law.md"), re.MULTILINE)
    assert sorted(laws) == list(law_names())


@pytest.mark.parametrize("path", sorted(DOCS.rglob("*.md")), ids=lambda path: path.name)
def test_a_code_that_is_named_exists(path: Path) -> None:
    for code, member in re.findall(r"`([A-Z]\w+)\.([A-Z][A-Z0-9_]+)`", path.read_text(encoding="utf-8")):
        if "PRESSURE_IMPLAUSIBLE" not in member:  # which a recipe adds
            assert member in getattr(codes, code).__members__
