"""docs/library.md: every example says what it gives, and every name has one."""

import doctest
import re
from pathlib import Path

import pytest

import positioner as pos

PAGE = Path(__file__).parents[2] / "docs" / "library.md"


@pytest.mark.long
def test_every_example_gives_what_the_page_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    results = doctest.testfile(str(PAGE), module_relative=False, optionflags=doctest.ELLIPSIS, encoding="utf-8")
    assert results.failed == 0
    assert results.attempted > len(pos.__all__)


def test_every_name_has_an_example() -> None:
    examples = "".join(each.source for each in doctest.DocTestParser().get_examples(PAGE.read_text(encoding="utf-8")))
    used = set(re.findall(r"\bpos\.(\w+)", examples))
    assert {*pos.__all__, "__version__"} - used == {"InputError"}, "raised in an example, and shown there"
    assert "InputError" in PAGE.read_text(encoding="utf-8")
