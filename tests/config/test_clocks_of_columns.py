"""Columns of different clocks: pairs in a table, a sheet a tag, stores of pandas: each value at its own time."""

import datetime
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from workbench.imports.column_mapping import ExportOptions, read_mapping
from workbench.imports.export_preview import preview
from workbench.imports.historian_export import read_export

BEGIN = datetime.datetime(2026, 3, 5, 8, 15)
STEM_S = np.arange(0.0, 30.0, 0.5)
STEM_MM = np.round(20.0 + 10.0 * np.sin(STEM_S / 3.0), 3)
ASKED_S = np.arange(-4.0, 30.0, 4.0)
ASKED_BAR = np.round(0.6 + 0.05 * np.cos(ASKED_S), 4)
HELD_BAR = ASKED_BAR[np.searchsorted(ASKED_S, STEM_S, side="right") - 1]


def stamps(times_s: np.ndarray) -> list[str]:
    return [(BEGIN + datetime.timedelta(seconds=float(t))).isoformat(timespec="milliseconds") for t in times_s]


def pairs(path: Path, *header: str, counted: bool = False) -> None:
    """Write a table in which each signal has its own clock before it, and the longer one goes on alone."""
    asked, stem = (ASKED_S, STEM_S) if counted else (stamps(ASKED_S), stamps(STEM_S))
    lines = list(header)
    for i in range(len(STEM_S)):
        first = f"{asked[i]},{ASKED_BAR[i]}" if i < len(ASKED_S) else ","
        lines.append(f"{first},{stem[i]},{STEM_MM[i]}")
    path.write_text("\n".join(lines) + "\n")


def sheets(path: Path) -> None:
    """Write a sheet a tag, each with the same names."""
    import openpyxl

    book = openpyxl.Workbook()
    for page, name, times_s, values in (
        (book.active, "FV1.OUT", ASKED_S, ASKED_BAR),
        (book.create_sheet(), "FV1.ZT", STEM_S, STEM_MM),
    ):
        page.title = name
        page.append(["Time", "Value", "Status"])
        for stamp, value in zip(stamps(times_s), values.tolist(), strict=True):
            page.append([datetime.datetime.fromisoformat(stamp), value, "Good"])
    book.save(path)


def archive(path: Path) -> None:
    """Write a row a value, both signals in the order of time."""
    rows = [(t, "FV1.OUT", u) for t, u in zip(ASKED_S, ASKED_BAR, strict=True)]
    rows += [(t, "FV1.ZT", x) for t, x in zip(STEM_S, STEM_MM, strict=True)]
    lines = [f"{tag};{stamps(np.array([t]))[0]};{value}" for t, tag, value in sorted(rows)]
    path.write_text("\n".join(["Tag;Time;Value", *lines]) + "\n")


WRITTEN: dict[str, tuple[str, Callable[[Path], None], tuple[str, str, str]]] = {
    "pairs of one name": (
        "pairs.csv",
        lambda path: pairs(path, "Name,uCmd,Name,xStem", counted=True),
        ("time_s=Name", "command_pa=uCmd:bar", "position_m=xStem:mm"),
    ),
    "pairs under the tags": (
        "pairs.csv",
        lambda path: pairs(path, "FV1.OUT,,FV1.ZT,", "Timestamp,Value,Timestamp,Value"),
        ("time_s=Timestamp", "command_pa=FV1.OUT Value:bar", "position_m=FV1.ZT Value:mm"),
    ),
    "counted pairs under the tags": (
        "pairs.csv",
        lambda path: pairs(path, "FV1.OUT,,FV1.ZT,", "Timestamp,Value,Timestamp,Value", counted=True),
        ("time_s=Timestamp", "command_pa=FV1.OUT Value:bar", "position_m=FV1.ZT Value:mm"),
    ),
    "pairs by their places": (
        "pairs.csv",
        lambda path: pairs(path, "Timestamp,Value,Timestamp,Value"),
        ("time_s=#3", "command_pa=#2:bar", "position_m=#4:mm"),
    ),
    "clocks of different names, the wrong one said": (
        "pairs.csv",
        lambda path: pairs(path, "T_OUT,OUT,T_ZT,ZT"),
        ("time_s=T_OUT", "command_pa=OUT:bar", "position_m=ZT:mm"),
    ),
    "a sheet a tag": (
        "tags.xlsx",
        sheets,
        ("time_s=Time", "command_pa=FV1.OUT:bar", "position_m=FV1.ZT:mm"),
    ),
    "a row a value": (
        "archive.csv",
        archive,
        ("time_s=Time", "command_pa=FV1.OUT:bar", "position_m=FV1.ZT:mm"),
    ),
}


@pytest.mark.parametrize("kind", WRITTEN)
def test_each_value_is_taken_at_its_own_time(kind: str, tmp_path: Path) -> None:
    name, write, words = WRITTEN[kind]
    write(tmp_path / name)
    recording = read_export(tmp_path / name, read_mapping(words), None)
    np.testing.assert_allclose(recording.time_s - recording.time_s[0], STEM_S, atol=1e-6)
    np.testing.assert_allclose(recording.position_m, 1e-3 * STEM_MM)
    np.testing.assert_allclose(recording.command_pa, 1e5 * HELD_BAR)
    assert "command_pa from 9 samples" in recording.metadata["clocks"]


@pytest.mark.parametrize("kind", WRITTEN)
def test_the_proposal_reads_the_same(kind: str, tmp_path: Path) -> None:
    name, write, _ = WRITTEN[kind]
    write(tmp_path / name)
    proposed = {
        word.partition("=")[0]: word.rpartition(":")[0] for word in preview(tmp_path / name).words if "=" in word
    }
    if kind == "pairs by their places":  # nothing tells which is which
        return
    clock = next(word for word in preview(tmp_path / name).words if word.startswith("time_s"))
    words = [clock, f"{proposed['command_pa']}:bar", f"{proposed['position_m']}:mm"]
    np.testing.assert_allclose(read_export(tmp_path / name, read_mapping(words), None).command_pa, 1e5 * HELD_BAR)


def test_a_second_clock_beside_the_rows_is_no_other_time(tmp_path: Path) -> None:
    rows = zip(stamps(STEM_S), range(len(STEM_S)), 1e3 * STEM_S, STEM_MM, STEM_MM / 50, strict=True)
    lines = ["Time,Index,uptime_ms,ZT,OUT", *(",".join(map(str, row)) for row in rows)]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    read = read_export(
        tmp_path / "a.csv", read_mapping(["time_s=Time", "position_m=ZT:mm", "command_pa=OUT:bar"]), None
    )
    np.testing.assert_allclose(read.time_s, STEM_S)
    assert "clocks" not in read.metadata


@pytest.mark.parametrize(
    ("second", "name"),
    [
        ([f"{t:.1f}" for t in STEM_S], "Elapsed time"),
        ([f"{1e3 * t + 77e6:.0f}" for t in STEM_S], "Uptime [ms]"),
        ([f"{1e3 * t:.0f}" for t in STEM_S], "Uptime"),
        (stamps(STEM_S + 3600.0), "Local time"),
        (stamps(STEM_S - 19_800.0), "Local time"),
    ],
)
def test_a_clock_between_the_columns_that_tells_the_same_instants_leaves_the_rows_as_they_are(
    second: list[str], name: str, tmp_path: Path
) -> None:
    first = [f"{t:.1f}" for t in STEM_S] if name == "Uptime" else stamps(STEM_S)
    rows = zip(first, STEM_MM / 50, second, STEM_MM, strict=True)
    (tmp_path / "a.csv").write_text("\n".join([f"Time,OUT,{name},ZT", *(",".join(map(str, row)) for row in rows)]))
    read = read_export(
        tmp_path / "a.csv", read_mapping(("time_s=Time", "position_m=ZT:mm", "command_pa=OUT:bar")), None
    )
    assert len(read) == len(STEM_S)
    np.testing.assert_allclose(read.command_pa, 2e3 * STEM_MM)
    np.testing.assert_allclose(read.position_m, 1e-3 * STEM_MM)


def test_what_counts_runs_between_the_columns_is_no_clock(tmp_path: Path) -> None:
    rows = zip(STEM_S, STEM_MM / 50, np.arange(len(STEM_S)) // 20, STEM_MM, strict=True)
    (tmp_path / "a.csv").write_text("\n".join(["Time,OUT,Run time,ZT", *(",".join(map(str, row)) for row in rows)]))
    read = read_export(
        tmp_path / "a.csv", read_mapping(("time_s=Time", "position_m=ZT:mm", "command_pa=OUT:bar")), None
    )
    np.testing.assert_allclose(read.time_s, STEM_S)
    np.testing.assert_allclose(read.command_pa, 2e3 * STEM_MM)


def test_a_unit_in_a_column_of_its_own_goes_with_its_value(tmp_path: Path) -> None:
    values = [
        (t, *each)
        for t, u, x in zip(stamps(STEM_S), STEM_MM / 50, STEM_MM, strict=True)
        for each in (("FV1.OUT", u, "bar"), ("FV1.ZT", x, "mm"))
    ]
    lines = ["Tag;Time;Value;Unit", *(f"{tag};{t};{value};{unit}" for t, tag, value, unit in values)]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    assert "position_m=FV1.ZT:mm" in preview(tmp_path / "a.csv").words
    sources = read_mapping(("time_s=Time", "position_m=FV1.ZT", "command_pa=FV1.OUT"))
    read = read_export(tmp_path / "a.csv", sources, None)
    np.testing.assert_allclose(read.position_m, 1e-3 * STEM_MM)
    np.testing.assert_allclose(read.command_pa, 2e3 * STEM_MM)


def test_what_is_asked_is_not_made_up_where_nobody_has_recorded_it(tmp_path: Path) -> None:
    """The stem's rows go on four times as long as the command's."""
    rows = zip(STEM_S, STEM_MM / 50, 4.0 * STEM_S, STEM_MM, strict=True)
    (tmp_path / "a.csv").write_text("\n".join(["Name,u,Name,x", *(",".join(map(str, row)) for row in rows)]))
    read = read_export(tmp_path / "a.csv", read_mapping(["time_s=Name", "position_m=x:mm", "command_pa=u:bar"]), None)
    assert read.time_s[-1] <= STEM_S[-1] + 0.5
    assert read.metadata["rows at times of which the other columns say nothing, left out"] == "45"


def test_clocks_that_cannot_be_laid_side_by_side_are_refused(tmp_path: Path) -> None:
    rows = zip(stamps(STEM_S), STEM_MM / 50, np.sort(STEM_S + 0.2 * np.sin(STEM_S)), STEM_MM, strict=True)
    (tmp_path / "a.csv").write_text("\n".join(["Time,u,Time,x", *(",".join(map(str, row)) for row in rows)]))
    with pytest.raises(InputError, match=r"tells the day and .* does not"):
        read_export(tmp_path / "a.csv", read_mapping(["time_s=Time", "position_m=x:mm", "command_pa=u:bar"]), None)
    lines = ["Name,u,Name,x", *(f"{t},0.5,{t + 100},20" for t in STEM_S)]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    with pytest.raises(InputError, match="no time is common"):
        read_export(tmp_path / "a.csv", read_mapping(["time_s=Name", "position_m=x:mm", "command_pa=u:bar"]), None)


def test_a_command_that_changes_between_samples_keeps_its_instants(tmp_path: Path) -> None:
    """A historian keeps the changes of a command: the stem answers by its next sample, and not before it was asked."""
    asked_s, asked_bar = np.arange(0.3, 30.0, 4.0), ASKED_BAR[: len(np.arange(0.3, 30.0, 4.0))]
    lines = ["T_OUT,OUT,T_ZT,ZT"]
    for i in range(len(STEM_S)):
        first = f"{asked_s[i]},{asked_bar[i]}" if i < len(asked_s) else ","
        lines.append(f"{first},{STEM_S[i]},{STEM_MM[i]}")
    (tmp_path / "a.csv").write_text("\n".join(lines))
    words = ("time_s=T_ZT", "position_m=ZT:mm", "command_pa=OUT:bar")
    read = read_export(tmp_path / "a.csv", read_mapping(words), None)
    changes = np.flatnonzero(np.diff(read.command_pa)) + 1
    np.testing.assert_allclose(read.time_s[changes], asked_s[1:])
    assert np.isnan(read.position_m[changes]).all()
    measured = np.isfinite(read.position_m)
    np.testing.assert_allclose(read.position_m[measured], 1e-3 * STEM_MM[1:])


def test_signals_of_an_archive_without_a_readable_time_are_laid_side_by_side_by_a_period(tmp_path: Path) -> None:
    values = [each for u, x in zip(STEM_MM / 50, STEM_MM, strict=True) for each in (("U", u), ("X", x))]
    lines = [f"{tag};12:00:00;{value}" for tag, value in values]
    (tmp_path / "a.csv").write_text("\n".join(["Tag;Time;Value", *lines]))
    sources = read_mapping(["position_m=X:mm", "command_pa=U:bar"], 0.5)
    read = read_export(tmp_path / "a.csv", sources, None, options=ExportOptions(period_s=0.5))
    np.testing.assert_allclose(read.time_s, STEM_S)
    np.testing.assert_allclose(read.position_m, 1e-3 * STEM_MM)
    np.testing.assert_allclose(read.command_pa, 2e3 * STEM_MM)


def test_of_two_clocks_that_contradict_each_other_the_finer_is_not_proposed(tmp_path: Path) -> None:
    """Whole seconds beside millionths of days is a better clock, unless it tells another span."""
    for factor, finer in ((1e6, True), (1e3, False)):
        days = 46086.34375e6 + factor * STEM_S / 86400
        rows = zip(day(STEM_S), days, STEM_MM, STEM_MM / 50, strict=True)
        lines = ["TimeString;Time_ms;Hub;Stelldruck", *(f"{a};{b:.6f};{c};{d}" for a, b, c, d in rows)]
        (tmp_path / "a.csv").write_text("\n".join(lines))
        proposed = preview(tmp_path / "a.csv").words
        assert ("time_s=Time_ms:ud" in proposed) == finer
        assert ("time_s=TimeString" in proposed) != finer
        signals = zip(day(STEM_S), days, STEM_MM, STEM_MM / 50, strict=True)
        values = [f"{tag};{a};{v};{b:.6f}" for a, b, c, d in signals for tag, v in (("Hub", c), ("Stelldruck", d))]
        (tmp_path / "b.csv").write_text("\n".join(["VarName;TimeString;VarValue;Time_ms", *values]))
        assert ("time_s=Time_ms:ud" in preview(tmp_path / "b.csv").words) == finer


def test_what_stands_where_a_clock_has_its_unit_is_said_with_what_is_taken(tmp_path: Path) -> None:
    """A scope's labels stand under its clocks: no unit that is known, and not an empty one."""
    lines = (f"{1e3 * t:.1f}\t{x}\t{x / 50}" for t, x in zip(STEM_S, STEM_MM, strict=True))
    (tmp_path / "a.csv").write_text("\n".join(["Name\txStem\tuCmd", "SymbolName\tmm\tbar", *lines]))
    (said,) = preview(tmp_path / "a.csv").proposal.open
    assert said.startswith("the unit of 'Name' is 'SymbolName' by the file, none known: s is taken; :ms")


@pytest.mark.parametrize("labels", [("SymbolName", "SampleTime[ms]"), ("SampleTime [ms]", "Unit")])
def test_a_clock_goes_by_the_unit_in_what_describes_it(labels: tuple[str, str], tmp_path: Path) -> None:
    """A scope's clock has the labels of its signals in its column, among them `SampleTime[ms]`."""
    lines = (f"{1e3 * t:.1f}\t{x}\t{x / 50}" for t, x in zip(STEM_S, STEM_MM, strict=True))
    below = [f"{labels[0]}\tMAIN.x\tMAIN.u", f"{labels[1]}\tmm\tbar"]
    (tmp_path / "a.csv").write_text("\n".join(["Name\txStem\tuCmd", *below, *lines]))
    assert "time_s=Name:ms" in preview(tmp_path / "a.csv").words
    sources = read_mapping(["time_s=Name", "position_m=xStem", "command_pa=uCmd"])
    np.testing.assert_allclose(read_export(tmp_path / "a.csv", sources, None).time_s, STEM_S - STEM_S[0])


@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M:%S", "%d.%m.%Y %H:%M:%S", "%m/%d/%Y %I:%M:%S %p"])
@pytest.mark.parametrize(("unit", "count"), [("ms", 1e3), ("100ns", 1e7), ("min", 1 / 60)])
def test_begin_and_end_above_the_names_tell_what_a_clock_counts(
    form: str, unit: str, count: float, tmp_path: Path
) -> None:
    """A scope's clocks without a unit last as long as its header says; a travel that only rises is no clock."""
    begin, end = BEGIN.strftime(form), (BEGIN + datetime.timedelta(seconds=30)).strftime(form)
    rows = [f"{count * t:.6f},{20 + t:.3f},{count * t:.6f},{t / 50}" for t in STEM_S]
    export = tmp_path / "a.csv"
    for first, last, told in ((begin, end, True), (begin, begin, False), (begin, "unknown", False)):
        above = [f"StartTime,{first}", f"EndTime,{last}", ""]
        export.write_text("\n".join([*above, "Name,xStem,Name,uCmd", *rows]))
        shown = preview(export)
        assert (f"time_s=Name:{unit}" in shown.words, f"'Name' counts {unit}" in shown.summary()) == (told, told)
        sources = read_mapping(["time_s=#1", "position_m=xStem:mm", "command_pa=uCmd:bar"], None)
        np.testing.assert_allclose(
            read_export(export, sources, None).time_s, STEM_S * (1 if told else count), atol=1e-4
        )


def day(times_s: np.ndarray) -> list[str]:
    return [(BEGIN + datetime.timedelta(seconds=float(t))).strftime("%d.%m.%Y %H:%M:%S") for t in times_s]
