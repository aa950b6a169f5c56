"""The docstring of a room lists its files."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = (
    "positioner/control",
    "positioner/daemon",
    "positioner/daemon/health",
    "positioner/estimation",
    "positioner/paper",
    "positioner/response",
    "positioner/virtual",
    "positioner/cli/parts",
)


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_lists_its_files_and_no_others(room: str) -> None:
    docstring = (
        ast.get_docstring(ast.parse((ROOT / room / "__init__.py").read_text(encoding="utf-8")), clean=False) or ""
    )
    listed = {
        name
        for line in docstring.splitlines()
        if (columns := re.fullmatch(r" {4}(\w+(?:, \w+)*) {2,}\S.*", line))
        for name in columns[1].split(", ")
    }
    files = {each.stem for each in (ROOT / room).glob("*.py")} - {"__init__"}
    folders = {each.parent.name for each in (ROOT / room).glob("*/__init__.py")}
    assert listed == files | folders
