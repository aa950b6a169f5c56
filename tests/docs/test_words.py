"""What is counted as hard to read; the counts themselves are held by `make lint`."""

from pathlib import Path

from docs.words import constants, participles

TEXT = '''
MOST = 5
REACH_S = 2.0
FEW, MANY = 3, 4
"""Rows that are few, and many."""
SHARE = 0.1  # of the stroke
NAME = "no number"


def carried() -> None: ...
def carry_state() -> None: ...
def speed() -> None: ...
class Model:
    @property
    def judged(self) -> bool: ...
    def begun(self) -> None: ...
'''


def test_a_number_is_explained_by_its_unit_its_docstring_or_a_comment(tmp_path: Path) -> None:
    path = tmp_path / "module.py"
    path.write_text(TEXT)
    told = {name: (value, explained) for name, value, _, explained in constants(path)}
    assert told == {
        "MOST": ("5", False),
        "REACH_S": ("2.0", True),
        "FEW": ("3", True),
        "MANY": ("4", True),
        "SHARE": ("0.1", True),
    }
    assert {name for name, _ in participles(path)} == {"carried", "begun"}
