"""Each promise of `docs/promises.md` names a test that is there; so does each threat of `docs/security.md`."""

import ast
import re
from pathlib import Path

import pytest

from benchmarks.broken_promises import BREAKAGES, Breakage

ROOT = Path(__file__).parents[2]
PROMISES = re.findall(
    r"^- (.+) `(tests/[\w/]+\.py)::(test_\w+)`$", (ROOT / "docs" / "promises.md").read_text(), re.MULTILINE
)


def test_there_are_promises_and_none_without_a_test() -> None:
    assert len(PROMISES) > 60
    assert len(PROMISES) == (ROOT / "docs" / "promises.md").read_text().count("\n- ")


@pytest.mark.parametrize(("promise", "file", "name"), PROMISES, ids=lambda each: each[:40])
def test_a_promise_names_a_test_that_is_there(promise: str, file: str, name: str) -> None:
    module = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    assert name in {each.name for each in ast.walk(module) if isinstance(each, ast.FunctionDef)}, promise


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
