"""The glossary: each term with its meaning, a source that is spelt out and a place in the code that exists."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
TERMS, _, SOURCES = TEXT.partition("\n## Sources\n")


TERM = re.compile(r"^- \*\*(.+?)\*\*(?:, [^:]+)?: (.+?\.) \((.+); ((?:`[^`]+` ?)+)\)$", re.MULTILINE)
ENTRIES = TERM.findall(TERMS)
SPELT_OUT = {*re.findall(r"^- \*\*(.+?)\*\*: ", SOURCES, re.MULTILINE), "ours"}


def test_there_are_some_sixty_terms_and_none_twice() -> None:
    terms = [row[0] for row in ENTRIES]
    assert len(terms) == TERMS.count("\n- ") >= 60
    assert len(set(terms)) == len(terms)


@pytest.mark.parametrize("row", ENTRIES, ids=lambda row: row[0])
def test_a_term_has_a_meaning_a_source_and_a_place(row: tuple[str, str, str, str]) -> None:
    _, meaning, source, place = row
    assert meaning.endswith(".")
    assert "`" not in meaning or "register `why`" in meaning
    assert set(re.sub(r" \(.*?\)", "", source).split(", ")) <= SPELT_OUT
    path, *names = re.findall(r"`([^`]+)`", place)
    text = (ROOT / path).read_text(encoding="utf-8")
    for name in names:
        assert re.search(rf"\b{re.escape(name)}\b", text), f"{path} has no {name}"
