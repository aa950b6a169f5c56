"""Loops of others in the forms of other programs, from file to verdict by what the messages say."""

import json
import re
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from positioner.cli.main import main

SHARED = Path(__file__).parents[4] / "shared"
LOOP = SHARED / "data/loops/refinery_012_02.csv"
FLOW = SHARED / "cases/exports/13-loop-sp-pv-mv/loop.csv"
needs_data = pytest.mark.skipif(not LOOP.exists(), reason="the refinery's loops are not here")
BEGIN = datetime(2026, 3, 2, 6)
TAGS = {"OP": "op_pct", "PV": "pv", "SP": "sp"}


def pairs(path: Path) -> None:
    """Write a clock a tag, side by side, each some tenths of a second later."""
    columns = np.genfromtxt(LOOP, delimiter=",", names=True)
    lines = [",".join(f"FIC012.{tag}," for tag in TAGS), ",".join(["Timestamp,Value"] * 3)]
    for row in columns:
        at = [BEGIN + timedelta(seconds=row["time_s"] + 0.137 * late) for late in range(3)]
        stamps = [f"{each:%d-%b-%y %H:%M:%S}.{each.microsecond // 1000:03d}" for each in at]
        lines.append(",".join(f"{s},{row[name]:.4f}" for s, name in zip(stamps, TAGS.values(), strict=True)))
    path.write_text("\n".join(lines) + "\n")


def row_a_value(path: Path) -> None:
    """Write a row a value, decimal commas, tags in the first column."""
    columns = np.genfromtxt(LOOP, delimiter=",", names=True)
    lines = ['"VarName";"TimeString";"VarValue";"Validity"']
    for row in columns:
        stamp = f"{BEGIN + timedelta(seconds=row['time_s']):%d.%m.%Y %H:%M:%S}"
        lines += [f'"FIC012_{t}";"{stamp}";{row[name]:.4f};1' for t, name in TAGS.items()]
    path.write_text("\n".join(re.sub(r";(\d+)\.(\d+);", r";\1,\2;", line) for line in lines) + "\n")


@needs_data
@pytest.mark.parametrize("write", [pairs, row_a_value])
def test_a_refinerys_loop_goes_from_another_programs_export_to_its_verdict(
    write: Callable[[Path], None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export, found = tmp_path / "export.csv", tmp_path / "found.json"
    write(export)
    words = ["loop", str(export), "--json", str(found)]
    if main(words) == 2:  # what is open is said, with the words to type
        (formatted,) = re.findall(r'--time-format "([^"]+)"', capsys.readouterr().err)
        assert main([*words, "--time-format", formatted]) == 1
    (told,) = json.loads(found.read_text())
    assert (told["loop"], told["verdict"]) == ("FIC012", "sticks")
    assert told["stiction_pct"] == pytest.approx(0.6, rel=0.2)


@pytest.mark.skipif(not FLOW.exists(), reason="the export of a flow loop is not here")
def test_a_flow_loop_of_another_program_is_told_at_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["loop", str(FLOW)]) == 1
    assert "cannot be told" in capsys.readouterr().out
