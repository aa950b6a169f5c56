"""The questions of `docs/architecture.md`: what answers each stands where it says."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROW = re.compile(r"^\| (.+\?) \| `([\w/.]+)` `(\w+)` \|$", re.MULTILINE)
GUIDE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
QUESTIONS = ROW.findall(GUIDE.partition("\n## Where is it?\n")[2].partition("\n## ")[0])
ROOMS = (
    *("config", "drivers", "drivers/canopen", "fieldbus/canopen", "fieldbus/modbus", "sim", "sim/effects", "sim/slave"),
    *(
        "positioner/cli",
        "positioner/control",
        "positioner/control/laws",
        "positioner/daemon",
        "positioner/daemon/health",
        "positioner/estimation",
    ),
    *("benchmarks/paper", "positioner/response", "positioner/virtual"),
    *("workbench/blind", "workbench/compare", "workbench/data", "workbench/fit", "workbench/forces", "workbench/model"),
    *("workbench/report", "workbench/select"),
)


def test_there_are_thirty_from_every_great_room() -> None:
    assert len(QUESTIONS) == 30
    assert {str(Path(file).parent) for _, file, _ in QUESTIONS} == set(ROOMS)


@pytest.mark.parametrize(("question", "file", "name"), QUESTIONS, ids=lambda each: each)
def test_the_answer_is_there(question: str, file: str, name: str) -> None:
    text = (ROOT / file).read_text(encoding="utf-8")
    assert re.search(rf"^\s*(class |def )?{name}\b", text, re.MULTILINE), f"{file} defines no {name}"
