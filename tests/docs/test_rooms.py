"""The docstring of a room lists its files and the rooms in it."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FLOORS = ("config", "signals", "webpage", "fieldbus", "drivers", "sim", "workbench", "positioner", "northbound")
LISTED_ELSEWHERE = {
    "sim/effects": "docs/effects.md, from their own declarations",
    "positioner": "the library's facade: docs/architecture.md",
    "positioner/cli": "one file a command: `positioner --help`",
}
ROOMS = [str(path.parent.relative_to(ROOT)) for floor in FLOORS for path in sorted((ROOT / floor).rglob("__init__.py"))]


@pytest.mark.parametrize("room", [each for each in ROOMS if each not in LISTED_ELSEWHERE])
def test_a_room_lists_its_files_and_no_others(room: str) -> None:
    module = ast.parse((ROOT / room / "__init__.py").read_text(encoding="utf-8"))
    listed = {
        name
        for line in (ast.get_docstring(module, clean=False) or "").splitlines()
        if (columns := re.fullmatch(r" {4}(\w+(?:, \w+)*) {2,}\S.*", line))
        for name in columns[1].split(", ")
    }
    files = {each.stem for each in (ROOT / room).glob("*.py")} - {"__init__", "__main__"}
    folders = {each.parent.name for each in (ROOT / room).glob("*/__init__.py")}
    assert listed == files | folders


def test_every_room_stands_in_the_architecture() -> None:
    table = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").partition("\n## The rooms\n")[2]
    told = set(re.findall(r"^\| `([\w/]+?)/?` \|", table.partition("\n## ")[0], re.MULTILINE))
    inside = {"fieldbus", "workbench", "positioner", "positioner/cli/parts"}
    assert set(ROOMS) - inside <= told
