"""Records of the control core are given by name: of neighbours of one type, none can be swapped unseen."""

import ast
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import positioner.control

CORE = Path(positioner.control.__file__).parent
MOST_BY_PLACE = 1
"""Values: one alone has no neighbour to be swapped with."""


def records() -> dict[str, list[str]]:
    """Return the fields' types of each tuple with names in the core that has alike neighbours."""
    found = {}
    for path in CORE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef) and any(ast.unparse(base) == "NamedTuple" for base in node.bases):
                found[node.name] = [
                    ast.unparse(each.annotation) for each in node.body if isinstance(each, ast.AnnAssign)
                ]
    return {name: types for name, types in found.items() if any(a == b for a, b in pairwise(types))}


def by_place(source: str, names: set[str]) -> Iterator[int]:
    """Yield the lines in which one of them is given more than one value by place."""
    for node in ast.walk(ast.parse(source)):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in names):
            continue
        if len(node.args) > MOST_BY_PLACE or any(isinstance(each, ast.Starred) for each in node.args):
            yield node.lineno


def test_no_record_of_the_core_takes_alike_neighbours_by_place() -> None:
    names = set(records())
    assert {"ControllerMemory", "Decision", "SupervisionMemory", "MonitorMemory", "Seen"} <= names
    found = {
        f"{path.relative_to(CORE)}:{line}" for path in CORE.rglob("*.py") for line in by_place(path.read_text(), names)
    }
    assert not found


def test_one_by_place_is_found() -> None:
    assert list(by_place("a = Decision(1.0, 2.0)\nb = Decision(command_pa=1.0)", {"Decision"})) == [1]
