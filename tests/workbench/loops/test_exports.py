"""Loops in the forms of other programs, from file to verdict by what the messages say."""

import json
import re
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from config.errors import InputError
from positioner.cli.main import main
from workbench.bench.drawn_loops import draw_loop
from workbench.imports.loop_reader import read_loop
from workbench.loops import LoopRecord

LOOP = draw_loop(10, "sticks")
BEGIN = datetime(2026, 3, 2, 6, tzinfo=UTC)
Row = tuple[datetime, dict[str, float]]
ROWS: list[Row] = [
    (BEGIN + timedelta(seconds=float(time_s)), {"OP": op, "PV": pv, "SP": sp})
    for time_s, op, pv, sp in zip(LOOP.time_s, LOOP.op_pct, LOOP.pv, LOOP.sp, strict=True)
]
SOME = ROWS[:120]
"""Enough to be read."""
NAMES = ("OP", "PV", "SP")


def pi_datalink() -> Iterator[str]:
    """Yield PI DataLink's: a function array a tag, each with its own clock, and words where a value is bad."""
    yield ",".join(f"FIC101.{name}," for name in NAMES)
    yield ",".join(["Timestamp,Value"] * 3)
    for row, (at, values) in enumerate(SOME):
        late = [at + timedelta(seconds=0.137 * place) for place in range(3)]
        cells = [f"{values[name]:.4f}" for name in NAMES]
        cells[1] = "Bad Input" if row % 97 == 5 else cells[1]
        yield ",".join(
            f"{t:%d-%b-%y %H:%M:%S}.{t.microsecond // 1000:03d},{c}" for t, c in zip(late, cells, strict=True)
        )


def aspen() -> Iterator[str]:
    """Yield Aspen Process Explorer's: names, descriptions and units above a column each."""
    yield "Name,FIC101.PV,FIC101.SP,FIC101.OP"
    yield "Description,Feed to column,Feed to column,Feed valve"
    yield "Units,m3/h,m3/h,%"
    yield from (f"{t:%d-%b-%y %H:%M:%S}.0,{v['PV']:.4f},{v['SP']:.4f},{v['OP']:.4f}" for t, v in SOME)


def ignition() -> Iterator[str]:
    """Yield Ignition's data set: lines of names, kinds and the number of rows."""
    yield from ('"#NAMES"', '"t_stamp","FIC101/PV","FIC101/SP","FIC101/OP"', '"#TYPES"', '"date","D","D","D"')
    yield f'"#ROWS","{len(SOME)}"'
    yield from (f'"{t:%Y-%m-%d %H:%M:%S}.000","{v["PV"]:.6f}","{v["SP"]:.6f}","{v["OP"]:.6f}"' for t, v in SOME)


def ignition_script() -> Iterator[str]:
    """Yield what Ignition's scripts write: Java's dates."""
    yield "t_stamp,FIC101_PV,FIC101_OP"
    for t, v in SOME:
        yield f'"{t:%b} {t.day}, {t.year} {t:%I}:{t:%M:%S} {t:%p}",{v["PV"]:.6f},{v["OP"]:.6f}'


def grafana(rows: Sequence[Row] = SOME) -> Iterator[str]:
    """Yield Grafana's, formatted: each cell with its unit."""
    yield '"Time","FIC101.PV","FIC101.SP","FIC101.OP"'
    yield from (f'"{t:%Y-%m-%d %H:%M:%S}","{v["PV"]:.2f} m³/h","{v["SP"]:.2f} m³/h","{v["OP"]:.2f}%"' for t, v in rows)


def grafana_unformatted() -> Iterator[str]:
    """Yield Grafana's, unformatted: milliseconds."""
    yield '"Time","FIC101.PV","FIC101.OP"'
    yield from (f"{1000 * int(t.timestamp())},{v['PV']:.4f},{v['OP']:.4f}" for t, v in SOME)


def opc_hda() -> Iterator[str]:
    """Yield an OPC HDA client's: a row a value, one item after the other, with its quality."""
    yield "ItemID,Timestamp,Value,Quality"
    for name in NAMES:
        yield from (f"Plant.FIC101.{name},{t:%Y-%m-%dT%H:%M:%S}.000Z,{v[name]:.4f},192" for t, v in SOME)


def wincc() -> Iterator[str]:
    """Yield WinCC's: a row a value, decimal commas."""
    yield '"VarName";"TimeString";"VarValue";"Validity"'
    for t, v in SOME:
        for name in NAMES:
            yield f'"FIC101_{name}";"{t:%d.%m.%Y %H:%M:%S}";' + f"{v[name]:.4f}".replace(".", ",") + ";1"


def sampled_data() -> Iterator[str]:
    """Yield PI's sampled data on a German desk: no word above the clock, and tags that begin with their unit."""
    yield ";30FIC101.PV;30FIC101.SP;30FIC101.OUT;30FIC101.MODE"
    for t, v in SOME:
        yield f"{t:%d.%m.%Y %H:%M:%S};" + f"{v['PV']:.4f};{v['SP']:.4f};{v['OP']:.4f};AUTO".replace(".", ",")


def ignition_history() -> Iterator[str]:
    """Yield Ignition's history: a row a value, the output as its control variable CV."""
    yield "tagpath,t_stamp,floatvalue,dataintegrity"
    for t, v in SOME:
        for theirs, name in (("PV", "PV"), ("CV", "OP")):
            yield f"area1/FIC101/{theirs},{1000 * int(t.timestamp())},{v[name]:.4f},192"


@pytest.mark.parametrize(
    "form",
    [
        sampled_data,
        ignition_history,
        pi_datalink,
        aspen,
        ignition,
        ignition_script,
        grafana,
        grafana_unformatted,
        opc_hda,
        wincc,
    ],
)
def test_another_programs_export_is_read_by_what_the_messages_say(
    form: Callable[[], Iterator[str]], tmp_path: Path
) -> None:
    path = tmp_path / "export.csv"
    path.write_text("\n".join(form()) + "\n", encoding="utf-8")
    try:
        read = read_loop(path)
    except InputError as error:  # one line says the words to type
        said = str(error)
        named = {"time": words[0]} if (words := re.findall(r"--time (\S+:ms)", said)) else {}
        formats = re.findall(r'--time-format "([^"]+)"', said)
        assert len(formats) + len(named) == 1
        read = read_loop(path, named, time_format=next(iter(formats), None))
    assert "FIC101" in read.name
    assert read.time_s.size == len(SOME)
    assert read.op_pct[10] == pytest.approx(LOOP.op_pct[10], abs=0.06)
    assert read.pv[10] == pytest.approx(LOOP.pv[10], abs=0.01)


def test_from_a_formatted_export_to_the_verdict(tmp_path: Path) -> None:
    export, found = tmp_path / "export.csv", tmp_path / "found.json"
    export.write_text("\n".join(grafana(ROWS)) + "\n", encoding="utf-8")
    assert main(["loop", str(export), "--json", str(found)]) == 1
    (told,) = json.loads(found.read_text())
    assert (told["loop"], told["verdict"]) == ("FIC101", "sticks")
    assert told["stiction_pct"] == pytest.approx(LOOP.truth.stiction_pct, rel=0.2)


def scaled(row: int) -> str:
    """Return a line of a display that scales by itself."""
    flow = f"{900 + row} L/h" if row < 100 else f"{0.9 + row / 1000:.3f} m³/h"
    return f"{row},{flow},{50 + row % 9} %"


def counted(*periods: int) -> Callable[[int], str]:
    """Return lines of time and of numbers that come back after some rows."""
    return lambda row: ",".join(map(str, (row, *(50 + row % each for each in periods))))


@pytest.mark.parametrize(
    ("header", "row", "said"),
    [
        ("Time,FIC101.PV,FIC101.OP", scaled, "is in L/h and in m³/h"),
        ("Zeit;FIC101.PV;FIC101.MV", lambda row: f"{row};{100 + row};4{row % 9},125", "--decimal"),
        ("Time,FIC101.PV,FIC101.OP,FV101.ZT", counted(7, 9, 8), "positioner diagnose"),
        (
            "Time,FIC1.PV,FIC1.OP,LIC2.PV,LIC2.OP",
            counted(7, 9, 5, 8),
            "say which by --op NAME, its output: 'FIC1.OP' of FIC1, ",
        ),
        ("time_s,command_pa,position_m", counted(7, 9), "positioner diagnose"),
        (
            "Time,FIC101.PV,FIC101.OP",
            lambda row: f"{row},{50 + row % 9},{9000 + 10 * (row % 7)}",
            "--op FIC101.OP --pv FIC101.PV --op-range 0 27648",
        ),
        ("Time,FIC101.PV,FIC101.OP", lambda row: f"{row},{50 + row % 9},0.{40 + row % 7}", "--op-range 0 1,"),
        ("Time,FIC101.PV", counted(7), "no loop is recognised"),
    ],
)
def test_what_a_person_must_say_is_one_line(
    header: str, row: Callable[[int], str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export = tmp_path / "export.csv"
    export.write_text("\n".join([header, *map(row, range(200))]) + "\n", encoding="utf-8")
    assert main(["loop", str(export)]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(("unit", "first", "note"), [(" [mA]", 50.0, ""), ("", 12.0, "--op-range 4 20")])
def test_an_output_in_ma_is_told_by_its_unit_or_asked_for(unit: str, first: float, note: str, tmp_path: Path) -> None:
    export = tmp_path / "export.csv"
    rows = [f"{row},{50 + row % 9},{12 + 0.1 * (row % 7)}" for row in range(200)]
    export.write_text("\n".join([f"Time,FIC101.PV,FIC101.OP{unit}", *rows]), encoding="utf-8")
    read = read_loop(export)
    assert read.op_pct[0] == pytest.approx(first)
    assert note in "".join(LoopRecord.of_export(read).notes)


def test_of_two_loops_the_output_says_which(tmp_path: Path) -> None:
    export = tmp_path / "export.csv"
    rows = map(counted(7, 9, 5, 8), range(200))
    export.write_text("\n".join(["Time,FIC1.PV,FIC1.OP,LIC2.PV,LIC2.OP", *rows]), encoding="utf-8")
    read = read_loop(export, {"op": "LIC2.OP"})
    assert (read.name, read.pv[5], read.op_pct[5]) == ("LIC2", 50.0, 55.0)
