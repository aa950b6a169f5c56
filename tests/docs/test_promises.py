"""Each promise of the documents that have a table of them names a test, and there is such a test; so in security.md."""

import ast
import re
from pathlib import Path

import pytest

from benchmarks.broken_promises import BREAKAGES, Breakage

ROOT = Path(__file__).parents[2]
DOCUMENTS = ("reliability.md", "history.md", "interfaces.md")
TABLES = [
    (ROOT / "docs" / name).read_text().partition("\n| promise | test |\n")[2].partition("\n\n")[0] for name in DOCUMENTS
]
PROMISES = [row.strip("| ").split(" | ") for table in TABLES for row in table.splitlines()[1:]]


def test_there_are_promises() -> None:
    assert len(PROMISES) > 30
    assert all(TABLES)
    assert all(len(each) == 2 for each in PROMISES)


@pytest.mark.parametrize("row", PROMISES, ids=lambda row: row[0][:40])
def test_a_promise_names_a_test_that_is_there(row: list[str]) -> None:
    named = re.fullmatch(r"`(tests/[\w/]+\.py)::(test_\w+)`", row[1])
    assert named, row
    module = ast.parse((ROOT / named[1]).read_text(encoding="utf-8"))
    assert named[2] in {each.name for each in ast.walk(module) if isinstance(each, ast.FunctionDef)}


@pytest.mark.parametrize("each", BREAKAGES, ids=lambda each: each.promise[:40])
def test_the_line_that_keeps_a_promise_is_there_to_be_broken(each: Breakage) -> None:
    assert (ROOT / each.file).read_text(encoding="utf-8").count(each.kept) == 1


THREATS = [
    row.strip("| ").split(" | ")
    for row in (ROOT / "docs" / "security.md").read_text().splitlines()
    if row.startswith("| ") and row.count("|") >= 5 and not row.startswith("| threat |")
]


def test_every_foundational_requirement_has_threats_and_each_test_named_is_there() -> None:
    text = (ROOT / "docs" / "security.md").read_text()
    assert re.findall(r"^## FR (\d):", text, re.MULTILINE) == [str(n) for n in range(1, 8)]
    assert len(THREATS) > 25
    for named in re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", text):
        module = ast.parse((ROOT / named[0]).read_text(encoding="utf-8"))
        names = {each.name for each in ast.walk(module) if isinstance(each, ast.FunctionDef | ast.ClassDef)}
        assert named[1] in {*names, ""}, named


def test_a_threat_without_a_test_says_so_by_an_empty_cell() -> None:
    """There is one: that nothing secret is ever logged is shown by nothing."""
    untested = [row[0] for row in THREATS if "`tests/" not in " ".join(row)]
    assert untested == ["keys and passwords in logs"]
