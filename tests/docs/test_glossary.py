"""The glossary: each term in one sentence, with a source that is spelt out and a place in the code that exists."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
TERMS, _, SOURCES = TEXT.partition("\n## Sources\n")


def rows(text: str) -> list[list[str]]:
    """Return the rows of the tables, without their heads."""
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line[:1] == "|"]
    return [row for row in cells if set(row[0]) != {"-"} and row[0] not in {"term", "short"}]


ENTRIES = rows(TERMS)
SPELT_OUT = {row[0] for row in rows(SOURCES)} | {"ours"}


def test_there_are_some_sixty_terms_and_none_twice() -> None:
    terms = [row[0] for row in ENTRIES]
    assert len(terms) >= 60
    assert len(set(terms)) == len(terms)


@pytest.mark.parametrize("row", ENTRIES, ids=lambda row: row[0])
def test_a_term_is_one_sentence_with_a_source_and_a_place(row: list[str]) -> None:
    _, meaning, _, source, place = row
    assert meaning.endswith(".")
    assert "`" not in meaning or "register `why`" in meaning
    assert set(re.sub(r" \(.*?\)", "", source).split(", ")) <= SPELT_OUT
    path, *names = re.findall(r"`([^`]+)`", place)
    text = (ROOT / path).read_text(encoding="utf-8")
    for name in names:
        assert re.search(rf"\b{re.escape(name)}\b", text), f"{path} has no {name}"
