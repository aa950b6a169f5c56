"""Files as people have them: each ends in a right reading, or in one line that says what to type instead.

Every file below holds the same sixty samples, as some program would have written them.
"""

import csv
import datetime
import io
import re
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from config.recording import Recording
from config.recording_oddities import oddities
from workbench.imports.column_mapping import ExportOptions, Status, read_mapping
from workbench.imports.export_preview import preview
from workbench.imports.historian_export import PLAIN, read_export

N = 60
T = 0.5 * np.arange(N)
PV = np.round(50.0 + 21.37 * np.sin(T / 3.0), 2)
OUT = np.round(0.6 + 0.2 * np.sin(T / 3.0 + 0.3), 3)
STROKE_M = 0.04
ISO = [f"2026-01-31T12:{int(t // 60):02d}:{t % 60:04.1f}" for t in T]
WORDS = ("time_s=t", "position_m=PV:%", "command_pa=OUT:bar")
GERMAN = "%d.%m.%Y %H:%M:%S"


def day(start: datetime.datetime, form: str, step_s: float = 0.5) -> list[str]:
    return [(start + datetime.timedelta(seconds=step_s * i)).strftime(form) for i in range(N)]


def rows(
    separator: str = ",",
    decimal: str = ".",
    *,
    time: list[str] | None = None,
    pv: list[str] | None = None,
    out: list[str] | None = None,
    header: str = "t,PV,OUT",
) -> list[str]:
    """Return the lines of a text file; cells that hold the separator are quoted."""
    columns = [
        time or [f"{t:.1f}".replace(".", decimal) for t in T],
        pv or [f"{x:.2f}".replace(".", decimal) for x in PV],
        out or [f"{u:.3f}".replace(".", decimal) for u in OUT],
    ]
    cells = [[f'"{cell}"' if separator in cell else cell for cell in row] for row in zip(*columns, strict=True)]
    return [header.replace(",", separator), *(separator.join(row) for row in cells)]


def text(lines: list[str], end: str = "\n", encoding: str = "utf-8") -> bytes:
    return (end.join(lines) + end).encode(encoding)


def shuffled(lines: list[str], order: list[int]) -> list[str]:
    return [lines[0], *(lines[1 + each] for each in order)]


SWAPPED = [*range(10), 11, 10, *range(12, N)]
ZEIT = tuple(word.replace("=t", "=Zeit") for word in WORDS)
GROUPED_PA = [f"{1e5 * u:,.1f}" for u in OUT]
AUTUMN = datetime.datetime(2026, 10, 25, 2, 59, 45)
REPEATED = [
    (AUTUMN + datetime.timedelta(seconds=0.5 * i - (3600 if i >= 30 else 0))).isoformat(timespec="milliseconds")
    for i in range(N)
]
PA = (*WORDS[:2], "command_pa=OUT:Pa")
PREAMBLE = ["Plant 7", "", "Exported: 31.01.2026; user: op", ""]


NOON, NIGHT = (datetime.datetime(2026, 1, 31, hour, 59, 50) for hour in (11, 0))
IN_DIGITS = ExportOptions(time_format="%H%M%S.%f")


@dataclass(frozen=True)
class Good:
    """A file that is read, with what must be said about it."""

    data: bytes
    words: tuple[str, ...] = WORDS
    options: ExportOptions = PLAIN
    said: str = ""
    name: str = "export.csv"
    missing: tuple[int, ...] = ()


READ = {
    "plain commas": Good(text(rows())),
    "byte order mark": Good(text(rows(), encoding="utf-8-sig")),
    "UTF-16 little-endian": Good(b"\xff\xfe" + text(rows("\t"), encoding="utf-16-le"), said="encoding: utf-16"),
    "UTF-16 big-endian": Good(b"\xfe\xff" + text(rows("\t"), encoding="utf-16-be"), said="encoding: utf-16"),
    "UTF-16 without a mark": Good(text(rows(";"), encoding="utf-16-le"), said="encoding: utf-16-le"),
    "Windows-1252 names": Good(
        text(rows(";", header="Zeit,Öffnung,Stellgröße"), encoding="cp1252"),
        ("time_s=Zeit", "position_m=Öffnung:%", "command_pa=Stellgröße:bar"),
        said="encoding: cp1252",
    ),
    "semicolons and decimal commas": Good(text(rows(";", ","))),
    "the same with names in quotation marks, as R's write.csv2 writes it": Good(
        text(rows(";", ",", header='"t","PV","OUT"'), encoding="utf-16-le")
    ),
    "tabs and decimal commas": Good(text(rows("\t", ","))),
    "bars": Good(text(rows("|"))),
    "commas, decimal commas in quotation marks": Good(text(rows(",", ","))),
    "spaces behind commas": Good(text([line.replace(",", ", ") for line in rows()])),
    "CR LF": Good(text(rows(), "\r\n")),
    "lone CR": Good(text(rows(";", ","), "\r")),
    "no end of the last line": Good(text(rows())[:-1]),
    "blank lines between": Good(text(rows(), "\n\n")),
    "separators at the ends of lines": Good(text([line + ";" for line in rows(";")])),
    "sep= line of Excel": Good(text(["sep=;", *rows(";", ",")])),
    "preamble": Good(text([*PREAMBLE, *rows(";", ",")])),
    "preamble with as many columns": Good(text(["Tag;FV-101;V101", *rows(";", ",")])),
    "comments before the header": Good(text(["# made by a logger", *rows()])),
    "units in a row": Good(
        text([rows(";")[0], "s;%;bar", *rows(";")[1:]]), ("time_s=t", "position_m=PV", "command_pa=OUT")
    ),
    "units in a row of brackets": Good(
        text([rows(";")[0], "[s];[%];[bar(g)]", *rows(";")[1:]]), said="rows under the header that are no samples: 1"
    ),
    "units and types in rows": Good(text([rows(";")[0], "s;%;bar", "REAL;REAL;REAL", *rows(";")[1:]])),
    "units in the header": Good(
        text(rows(header="Time (s),PV [%],OUT / bar")), ("time_s=Time", "position_m=PV", "command_pa=OUT")
    ),
    "units behind the numbers": Good(
        text(rows(pv=[f"{x:.2f} %" for x in PV], out=[f"{u:.3f} bar" for u in OUT])),
        ("time_s=t", "position_m=PV", "command_pa=OUT"),
    ),
    "a unit of the file's own": Good(
        text([rows()[0], "s,%,bar", *rows(time=[f"{t:.1f}" for t in T])[1:]]),
        ("time_s=t", "position_m=PV", "command_pa=OUT"),
    ),
    "other case and spacing": Good(
        text(rows(header="T,pv  ,Out")), ("time_s=t", "position_m=PV:%", "command_pa=OUT:bar")
    ),
    "thousands with commas": Good(text(rows(";", out=GROUPED_PA)), PA),
    "thousands with points": Good(
        text(rows(";", ",", out=[each.translate({44: ".", 46: ","}) for each in GROUPED_PA])), PA
    ),
    "thousands with spaces": Good(
        text(rows(";", ",", out=[each.replace(",", " ").replace(".", ",") for each in GROUPED_PA])), PA
    ),
    "thousands with narrow spaces": Good(text(rows(";", out=[each.replace(",", "\u202f") for each in GROUPED_PA])), PA),
    "thousands with apostrophes": Good(text(rows(";", out=[each.replace(",", "'") for each in GROUPED_PA])), PA),
    "whole thousands, and the sign said": Good(
        text(
            rows(
                time=[str(i) for i in range(N)], pv=[f"{x:.0f}" for x in 100 * PV], out=[f"{1e5 * u:,.0f}" for u in OUT]
            )
        ),
        ("time_s=t:ms", "position_m=PV:%", "command_pa=OUT:Pa"),
        ExportOptions(decimal="."),
        said="scaled",
    ),
    "exponents": Good(text(rows(out=[f"{1e5 * u:.5E}" for u in OUT])), PA),
    "exponents with decimal commas": Good(
        text(rows(";", ",", out=[f"{1e5 * u:.5E}".replace(".", ",") for u in OUT])), PA
    ),
    "plus signs": Good(text(rows(pv=[f"+{x:.2f}" for x in PV]))),
    "words for what is not there": Good(
        text(rows(pv=["Bad", "No Data", "", "#N/A", *(f"{x:.2f}" for x in PV[4:])])),
        said="not numbers in PV: 3",
        missing=(0, 1, 2, 3),
    ),
    "ISO time stamps": Good(text(rows(time=ISO))),
    "ISO with a space and a comma": Good(
        text(rows(";", time=[each.replace("T", " ").replace(".", ",") for each in ISO]))
    ),
    "ISO with a zone": Good(text(rows(time=[each + "+01:00" for each in ISO]))),
    "ISO with seven digits and Z": Good(text(rows(time=[each + "000000Z" for each in ISO]))),
    "German dates": Good(
        text(rows(";", ",", time=day(datetime.datetime(2026, 1, 31, 12), GERMAN + ",%f"))),
        options=ExportOptions(time_format=GERMAN + ",%f"),
    ),
    "American dates, noon and all": Good(
        text(rows(time=day(datetime.datetime(2026, 1, 31, 11, 59, 50), "%m/%d/%Y %I:%M:%S.%f %p"))),
        options=ExportOptions(time_format="%m/%d/%Y %I:%M:%S.%f %p"),
    ),
    "fractions left out at whole seconds": Good(
        text(
            rows(
                time=[each.removesuffix(".000000") for each in day(datetime.datetime(2026, 1, 31, 12), GERMAN + ".%f")]
            )
        ),
        options=ExportOptions(time_format=GERMAN + ".%f"),
    ),
    "times of day across midnight": Good(
        text(rows(time=day(datetime.datetime(2026, 1, 31, 23, 59, 50), "%H:%M:%S.%f"))),
        options=ExportOptions(time_format="%H:%M:%S.%f"),
        said="midnight",
    ),
    "date and time in two columns": Good(
        text(
            [
                "Date;Time;PV;OUT",
                *(
                    ";".join(["31.01.2026", f"12:00:{t:04.1f}", f"{x:.2f}", f"{u:.3f}"])
                    for t, x, u in zip(T, PV, OUT, strict=True)
                ),
            ]
        ),
        ("time_s=Date+Time", *WORDS[1:]),
        ExportOptions(time_format=GERMAN + ".%f"),
    ),
    "milliseconds": Good(text(rows(time=[f"{1e3 * t:.0f}" for t in T])), ("time_s=t:ms", *WORDS[1:])),
    "newest first": Good(text(shuffled(rows(time=ISO), list(range(N))[::-1])), said="order: newest first"),
    "newest first, with a zone": Good(
        text(shuffled(rows(time=[each + "Z" for each in ISO]), list(range(N))[::-1])), said="order: newest first"
    ),
    "two rows swapped": Good(text(shuffled(rows(), SWAPPED)), said="order: 1 times out of order; sorted"),
    "two halves the wrong way round": Good(
        text(shuffled(rows(time=ISO), [*range(30, N), *range(30)])), said="order: 1 times out of order; sorted"
    ),
    "rows in no order": Good(
        text(shuffled(rows(time=ISO), np.random.default_rng(1).permutation(N).tolist())),
        said="times out of order; sorted",
    ),
    "rows twice": Good(text(shuffled(rows(), sorted([*range(N), 5, 6, 7]))), said="repeated rows: 3 left out"),
    "rows twice and out of order": Good(text(shuffled(rows(), [*range(N), 5, 6, 7])), said="repeated rows: 3 left out"),
    "the hour that the end of summer time repeats": Good(
        text(rows(time=REPEATED)), said="clock change: the end of summer time"
    ),
    "the repeated hour, newest first": Good(
        text(shuffled(rows(time=REPEATED), list(range(N))[::-1])), said="clock change"
    ),
    "annotations of InfluxDB, a column a field": Good(
        text(
            [
                "#group,false,false,true,true,false",
                "#datatype,string,long,dateTime:RFC3339,double,double",
                "#default,_result,,,,",
                ",result,table,_time,PV,OUT",
                *(f",,0,{stamp}Z,{x:.2f},{u:.3f}" for stamp, x, u in zip(ISO, PV, OUT, strict=True)),
            ]
        ),
        ("time_s=_time", "position_m=PV:%", "command_pa=OUT:bar"),
    ),
    "a header again in the middle": Good(text([*rows()[:30], rows()[0], *rows()[30:]]), said="header lines again: 1"),
    "averages under it": Good(
        text([*rows(), "Average,50.00,0.600", "Maximum,71.37,0.800"]), said="rows without a time at the end"
    ),
    "torn": Good((text(rows()) + b"30.0,5"), said="torn"),
    "a status column": Good(
        text(["t,PV,OUT,Q", *(f"{line},{'Bad' if i in (3, 4) else 'Good'}" for i, line in enumerate(rows()[1:]))]),
        options=ExportOptions(status=(Status("Q", ("Good",)),)),
        said="rows that are not Good in Q, read without values: 2",
        missing=(3, 4),
    ),
    "a status of numbers": Good(
        text(["t,PV,OUT,Q", *(f"{line},{0 if i == 3 else 192}" for i, line in enumerate(rows()[1:]))]),
        options=ExportOptions(status=(Status("Q", ("192", "216")),)),
        missing=(3,),
    ),
    "no header": Good(text(rows()[1:]), ("time_s=#1", "position_m=#2:%", "command_pa=#3:bar")),
    "a closing valve's position": Good(
        text(rows(pv=[f"{100 - x:.2f}" for x in PV])), ("time_s=t", "position_m=PV:-%", "command_pa=OUT:bar")
    ),
    "milliamperes": Good(
        text(rows(out=[f"{4 + 16 * (u - 0.2) / 0.8:.5f}" for u in OUT])), (*WORDS[:2], "command_pa=OUT:mA")
    ),
    "absolute pressure": Good(text(rows(out=[f"{u + 1.01325:.5f}" for u in OUT])), (*WORDS[:2], "command_pa=OUT:bara")),
    "a name with a line break": Good(
        text(['t,"PV\n(FV-101)",OUT', *rows()[1:]]), ("time_s=t", "position_m=PV (FV-101):%", "command_pa=OUT:bar")
    ),
    "spaces": Good(text(rows(" "))),
    "columns aligned with spaces": Good(
        text(
            [
                "#  logger 7",
                "      t      PV     OUT",
                *(f" {t:8.2f}  {x:7.2f} {u:7.3f}" for t, x, u in zip(T, PV, OUT, strict=True)),
            ]
        )
    ),
    "a unit in words, and a column of remarks that holds nothing": Good(
        text(["t;PV;OUT;Comment", ";% of stroke;bar;", *(f"{line};" for line in rows(";")[1:])]),
        ("time_s=t", "position_m=PV", "command_pa=OUT"),
    ),
    "units behind a colon": Good(
        text(rows(header="t:s,PV:%,OUT:bar")), ("time_s=t", "position_m=PV", "command_pa=OUT")
    ),
    "seconds with their unit behind each": Good(text(rows(time=[f"{t:.1f} s" for t in T]))),
    "milliseconds since 1970": Good(
        text(rows(time=[f"{1e3 * (1_772_612_100 + t):.0f}" for t in T])), ("time_s=t:ms", *WORDS[1:])
    ),
    "a workbook's days": Good(text(rows(time=[f"{46085.25 + t / 86400:.10f}" for t in T])), ("time_s=t:d", *WORDS[1:])),
    "comments and events between the samples": Good(
        text([*rows()[:20], "# restarted, by op", *rows()[20:40], "*** valve tripped ***,,", *rows()[40:]]),
        said="rows of words alone, left out: 2",
    ),
    "a row a value, as archives keep it": Good(
        text(
            [
                "Tag;Time;Value;Quality",
                *(
                    f"{tag};{stamp};{value:.3f};Good"
                    for stamp, x, u in zip(ISO, PV, OUT, strict=True)
                    for tag, value in (("PV", x), ("OUT", u))
                ),
                "$COUNT$;120;;",
            ]
        ),
        ("time_s=Time", *WORDS[1:]),
    ),
    "a row a value, one signal after the other": Good(
        text(
            [
                "VarName;TimeString;VarValue;Validity",
                *(f"PV;{stamp};{x:.2f};1" for stamp, x in zip(ISO, PV, strict=True)),
                *(f"OUT;{stamp};{u:.3f};1" for stamp, u in zip(ISO, OUT, strict=True)),
            ]
        ),
        ("time_s=TimeString", *WORDS[1:]),
    ),
    "InfluxDB with a row a value": Good(
        text(
            [
                "#group,false,false,false,false,true",
                "#datatype,string,long,dateTime:RFC3339,double,string",
                "#default,_result,,,,",
                ",result,table,_time,_value,_field",
                *(f",,0,{stamp}Z,{x:.2f},PV" for stamp, x in zip(ISO, PV, strict=True)),
                *(f",,1,{stamp}Z,{u:.3f},OUT" for stamp, u in zip(ISO, OUT, strict=True)),
            ]
        ),
        ("time_s=_time", *WORDS[1:]),
    ),
    "a row a signal": Good(
        text([",".join([name, *map(str, each)]) for name, each in (("t", T), ("PV", PV), ("OUT", OUT))])
    ),
    "a unit behind each number that changes from row to row": Good(
        text(
            rows(
                pv=[f"{0.04 * x:.4f} cm" if i % 2 else f"{0.4 * x:.3f} mm" for i, x in enumerate(PV)],
                out=[f"{1e3 * u:.0f} mbar" if u < 0.6 else f"{u:.3f} bar" for u in OUT],
            )
        ),
        ("time_s=t", "position_m=PV", "command_pa=OUT"),
        said="units of PV, each cell by its own: 30 mm, 30 cm",
    ),
    "such a unit that a person says too": Good(
        text(rows(out=[f"{1e3 * u:.0f} mbar" if u < 0.6 else f"{u:.3f} bar" for u in OUT])),
        said="units of OUT, each cell by its own",
    ),
    "times with a unit behind each that changes": Good(
        text(rows(time=[f"{1e3 * t:.0f} ms" if t < 1.0 else f"{t:.1f} s" for t in T]))
    ),
    "times of day in digits": Good(text(rows(time=day(NOON, "%H%M%S.%f"))), options=IN_DIGITS),
    "times of day in digits, as numbers without zeros in front": Good(
        text(rows(time=[each.lstrip("0") for each in day(NIGHT, "%H%M%S.%f")])), options=IN_DIGITS
    ),
    "seconds that pass what minutes do not": Good(text(rows(time=[f"{t + 50.0:.1f}" for t in T]))),
    "Julian days": Good(
        text(rows(time=[f"{2_461_071.99 + t / 86400:.9f}" for t in T])),
        ("time_s=t:d", *WORDS[1:]),
        said="recorded: 2026",
    ),
    "nanoseconds since 1970": Good(
        text(rows(time=[f"{1_772_612_100_000_000_000 + round(5e8 * i)}" for i in range(N)])),
        ("time_s=t:ns", *WORDS[1:]),
        said="recorded: 2026-03-04T08:15:00",
    ),
    "ticks since the year 1": Good(
        text(rows(time=[f"{639_082_953_000_000_000 + 5_000_000 * i}" for i in range(N)])),
        ("time_s=t:100ns", *WORDS[1:]),
        said="recorded: 2026-03-05T08:15:00",
    ),
    "FILETIME": Good(
        text(rows(time=[f"{134_171_721_000_000_000 + 5_000_000 * i}" for i in range(N)])),
        ("time_s=t:100ns", *WORDS[1:]),
        said="recorded: 2026-03-05T08:15:00",
    ),
    "days since the year 0": Good(
        text(rows(time=[f"{740_046.34375 + t / 86400:.9f}" for t in T])),
        ("time_s=t:d", *WORDS[1:]),
        said="recorded: 2026-03-05T08:15:00",
    ),
    "seconds since 1970": Good(
        text(rows(time=[f"{1_772_698_500 + t:.1f}" for t in T])), said="recorded: 2026-03-05T08:15:00"
    ),
    "a minus behind the number, as business programs write it": Good(
        text(rows(pv=[f"{50.0 - x:.2f}".removeprefix("-") + ("-" if x > 50.0 else "") for x in PV - 50.0])),
        ("time_s=t", "position_m=PV:-%", "command_pa=OUT:bar"),
    ),
    "no time, and a period said": Good(
        text([line.partition(",")[2] for line in rows()]),
        WORDS[1:],
        ExportOptions(period_s=0.5),
        said="rows 0.5 s apart",
    ),
    "no time and no names": Good(
        text([line.partition(",")[2] for line in rows()[1:]]),
        ("position_m=#1:%", "command_pa=#2:bar"),
        ExportOptions(period_s=0.5),
    ),
    "volts": Good(
        text(rows(pv=[f"{0.1 * x:.3f}" for x in PV], out=[f"{1 + 5 * (u - 0.2):.3f}" for u in OUT])),
        ("time_s=t", "position_m=PV:0-10V", "command_pa=OUT:1-5V"),
        said="assumed: command_pa in 1-5V: 0 % is 0.2 bar, 100 % 1 bar, for nobody has said it; --range-pa 20000",
    ),
    "columns that are not asked for": Good(
        text([f"{line},{'x' if i else 'Note'},{'äöü' if i else 'More'}" for i, line in enumerate(rows())])
    ),
}


@pytest.mark.parametrize("kind", READ)
def test_it_is_read_right_and_told(kind: str, tmp_path: Path) -> None:
    case = READ[kind]
    path = tmp_path / case.name
    path.write_bytes(case.data)
    recording = read_export(path, read_mapping(case.words, case.options.period_s), STROKE_M, options=case.options)
    if case.said == "scaled":
        np.testing.assert_allclose(recording.command_pa, np.round(1e5 * OUT))
        return
    expected = {"time_s": T, "position_m": STROKE_M * PV / 100, "command_pa": 1e5 * OUT}
    missing = list(case.missing)
    for name, column in expected.items():
        got = recording.columns[name]
        whole = np.setdiff1d(np.arange(N), missing if name == "position_m" or "Q" in str(case.options) else [])
        if name == "time_s":
            np.testing.assert_allclose(got - got[0], column, rtol=1e-6, atol=1e-4)
            continue
        np.testing.assert_allclose(got[whole], column[whole], rtol=1e-6, atol=1e-9)
    assert np.isnan(recording.position_m[missing]).all()
    said = "; ".join(f"{key}: {value}" for key, value in recording.metadata.items())
    assert case.said in said


@pytest.mark.parametrize(("share", "is_told"), [(0.01, True), (1.0, False)])
def test_shares_that_are_said_to_be_per_cent_are_asked_about(share: float, is_told: bool, tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_bytes(text(rows(pv=[f"{share * x:.4f}" for x in PV])))
    recording = read_export(path, read_mapping(WORDS), STROKE_M)
    assert ("if these are shares of 1, position_m=PV:p.u." in str(recording.metadata)) == is_told


@pytest.mark.parametrize(
    ("header", "per_bar"),
    [("kgf/cm2", 1.0197162), ("N/mm²", 0.1), ("mmHg", 750.06168), ("inH2O", 401.46308), ("atm", 0.98692327)],
)
def test_a_unit_in_brackets_is_read_with_its_slash(header: str, per_bar: float, tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_bytes(text(rows(header=f"t,PV,OUT [{header}]", out=[f"{per_bar * u:.7f}" for u in OUT])))
    recording = read_export(path, read_mapping((*WORDS[:2], f"command_pa=OUT [{header}]")), STROKE_M)
    np.testing.assert_allclose(recording.command_pa, 1e5 * OUT, rtol=1e-6)


@dataclass(frozen=True)
class Bad:
    """A file that is refused, with what the line must say."""

    data: bytes
    said: str
    words: tuple[str, ...] = WORDS
    options: ExportOptions = PLAIN
    stroke_m: float | None = STROKE_M


OPEN = rows(";", time=[str(i) for i in range(N)], pv=[f"{x:.3f}" for x in PV + 0.001], out=["1,234"] * N)
STANDSTILL = rows(time=[f"12:00:{int(t):02d}" for t in T])
OVERLAP = shuffled(rows(time=[f"{t + (0 if i < 30 else -7.27):.2f}" for i, t in enumerate(T)]), list(range(N)))


def archived(name: str) -> bytes:
    """An archive of one empty file."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        archive.writestr(name, "")
    return made.getvalue()


REFUSED = {
    "nothing": Bad(b"", "holds no samples: it is empty"),
    "blank lines": Bad(b"\n \n\n", "holds no samples"),
    "a header alone": Bad(b"t,PV,OUT\n", "holds no samples under the names of line 1"),
    "another name": Bad(text(rows(header="t,PV,MV")), "column 'OUT' is missing; line 1 names: t, PV, MV"),
    "another name under a preamble": Bad(
        text([*PREAMBLE, *rows(";", header="t,PV,MV")]), "column 'OUT' is missing; line 5 names: t, PV, MV"
    ),
    "a name twice": Bad(
        text(rows(header="t,PV,PV")),
        "column 'PV' stands 2 times in line 1",
        ("time_s=t", "position_m=PV:%", "command_pa=PV:bar"),
    ),
    "no header": Bad(text(rows()[1:]), "no line names columns; call them #1 to #3"),
    "no table": Bad(b"Trend\nof yesterday\n", "holds no table"),
    "thousand or one and a bit": Bad(
        text(rows(";", time=[str(i) for i in range(N)], pv=["50"] * N, out=["1,234"] * N)),
        "'1,234' may be 1234 or 1.234: say which sign is the decimal one, --decimal . or --decimal ,",
    ),
    "thousand or one and a bit, with points": Bad(
        text(rows(";", time=[str(i) for i in range(N)], pv=["50.123"] * N, out=["1.234"] * N)),
        "--decimal . or --decimal ,",
    ),
    "both decimal signs": Bad(
        text(rows(";", pv=[f"{x:.2f}".replace(".", ",") for x in PV])), "a decimal point and .* a decimal comma"
    ),
    "the wrong decimal sign": Bad(
        text(rows(";", ",")), "is neither seconds|--decimal ,", options=ExportOptions(decimal=".")
    ),
    "decimal commas between commas": Bad(
        text([rows()[0], *(line.replace(".", ",") for line in rows()[1:])]), "line 2: 6 fields, the header names 3"
    ),
    "a broken number": Bad(text([*rows(), "30.0,1.2.3,0.6"]), r"line 62: '1.2.3' in 'PV' is no number"),
    "a unit row of another unit": Bad(
        text([rows()[0], "s,mm,bar", *rows()[1:]]),
        "'PV' is in mm by line 2, the mapping says %: type --column position_m=PV:mm",
    ),
    "a header of another unit": Bad(
        text(rows(header="t,PV [mm],OUT")),
        "'PV' is in mm by line 1, the mapping says %: type --column position_m=PV:mm",
    ),
    "the unit of another quantity": Bad(
        text(rows(header="t,PV [kPa],OUT")), "'PV' is in kPa by line 1, and position_m takes m"
    ),
    "per cent without a stroke": Bad(text(rows()), "--stroke-m: is needed to read position_m in %", stroke_m=None),
    "German dates": Bad(
        text(rows(time=day(datetime.datetime(2026, 1, 31, 12), GERMAN + ".%f"))),
        'it can be read with --time-format "%d.%m.%Y %H:%M:%S.%f"',
    ),
    "day or month": Bad(
        text(rows(time=day(datetime.datetime(2026, 1, 2, 12), "%d/%m/%Y %H:%M:%S.%f"))),
        '--time-format "%d/%m/%Y %H:%M:%S.%f", or --time-format "%m/%d/%Y %H:%M:%S.%f"',
    ),
    "another format than said": Bad(
        text(rows(time=day(datetime.datetime(2026, 1, 31, 12), "%d/%m/%Y %H:%M:%S.%f"))),
        'is not as --time-format .* says; it can be read with --time-format "%d/%m/%Y',
        options=ExportOptions(time_format=GERMAN),
    ),
    "a word for a time": Bad(
        text(rows(time=["now", *(f"{t:.1f}" for t in T[1:])])),
        "sample 1: 'now' is neither seconds nor an ISO time stamp",
    ),
    "a time missing in the middle": Bad(
        text(rows(time=[f"{t:.1f}" if i != 20 else "" for i, t in enumerate(T)])),
        "sample 21 .line 22.: '' is neither seconds",
    ),
    "several samples of one second": Bad(
        text(STANDSTILL),
        "lines 2 and 3 are of one time and have different values, 30 of 60 rows are such: export fractions of seconds",
        options=ExportOptions(time_format="%H:%M:%S"),
    ),
    "a clock set back again and again": Bad(
        text(rows(time=[f"{t % 7.3:.2f}" for t in T])), "time goes back|different values"
    ),
    "a status that nothing has": Bad(
        text(["t,PV,OUT,Q", *(f"{line},OK" for line in rows()[1:])]),
        "no row's 'Q' is Good; it holds: OK .60.; say which are good",
        options=ExportOptions(status=(Status("Q", ("Good",)),)),
    ),
    "a column without a number": Bad(
        text(rows(pv=["Bad"] * N)), "column 'PV' holds no number, only 'Bad': map another"
    ),
    "an empty column": Bad(text(rows(pv=[" "] * N)), "column 'PV' holds no number"),
    "a quotation mark that is never closed": Bad(
        text([*rows()[:5], '2.0,"50,0.6', *rows()[6:]]), "line 6: a quotation mark is not closed"
    ),
    "a field of a megabyte": Bad(
        text([*rows()[:5], f'2.0,"{"5" * 1_000_000}",0.6']), "line 6: a field of more than 131072 characters"
    ),
    "a NUL": Bad(text(rows()) + b"30.0,5\0,0.6\n", "line 62: a NUL character"),
    "a block of NULs after a power failure": Bad(text(rows()) + b"\0" * 4096, "line 62: a NUL character"),
    "gzip": Bad(b"\x1f\x8b\x08\x00", "compressed with gzip: unpack it"),
    "old Excel": Bad(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "old Excel .*: save it as .xlsx or CSV"),
    "MATLAB 7.3": Bad(b"MATLAB 7.3 MAT-file, Platform: GLNXA64", "is a damaged HDF5 file"),
    "TDMS": Bad(b"TDSm" + bytes(200), "is a damaged TDMS file"),
    "MDF": Bad(b"MDF     4.10    " + bytes(200), "is a damaged MDF file"),
    "HDF5": Bad(b"\x89HDF\r\n\x1a\n" + bytes(200), "is a damaged HDF5 file"),
    "a PDF": Bad(b"%PDF-1.7\n", "is a PDF"),
    "bzip2": Bad(b"BZh91AY&SY", "compressed with bzip2: unpack it"),
    "xz": Bad(b"\xfd7zXZ\0", "compressed with xz: unpack it"),
    "Zstandard": Bad(b"\x28\xb5\x2f\xfd", "compressed with Zstandard: unpack it"),
    "7-Zip": Bad(b"7z\xbc\xaf\x27\x1c", "7-Zip archive: unpack it"),
    "RAR": Bad(b"Rar!\x1a\x07", "RAR archive: unpack it"),
    "SQLite": Bad(b"SQLite format 3\0" + bytes(range(256)), "SQLite database: sqlite3 -header -csv FILE"),
    "Feather": Bad(b"ARROW1\0\0", "Arrow .Feather. file: save it as Parquet or CSV"),
    "a NumPy array": Bad(b"\x93NUMPY\x01", "NumPy array without names: save it as CSV"),
    "a document": Bad(b"{\\rtf1\\ansi t,PV,OUT}", "is a document: export the numbers"),
    "a screenshot": Bad(b"\x89PNG\r\n\x1a\n", "is a picture: export the numbers"),
    "another kind of bytes": Bad(bytes(range(256)) * 4, "no text, and of no kind that is read: export it as CSV"),
    "a web page named .xls": Bad(b"\n<Table border=1><tr><td>t</td></tr></table>", "is a web page: export the numbers"),
    "a web page in UTF-16": Bad(b"\xff\xfe" + "<html>".encode("utf-16-le"), "is a web page"),
    "XML": Bad(b'<?xml version="1.0"?><trend/>', "is XML: export the numbers"),
    "JSON": Bad(b'[{"t": 0.0, "PV": 50.0}]', "is JSON: save it as CSV"),
    "JSON, a line a sample": Bad(b'{"t": 0.0}\n{"t": 0.5}\n', "is JSON: save it as CSV"),
    "lines in quotation marks": Bad(
        text([f'"{line}"' for line in rows()]), "every line stands in quotation marks as a whole.*: take them away"
    ),
    "milliseconds since 1970, not said": Bad(
        text(rows(time=[f"{1e3 * (1_772_612_100 + t):.0f}" for t in T])),
        "'1772612100000' in 't' is no time in seconds: type --column time_s=t:ms",
    ),
    "nanoseconds, not said": Bad(
        text(rows(time=[f"{1_772_612_100_000_000_000 + round(5e8 * i)}" for i in range(N)])),
        "is no time in seconds: type --column time_s=t:ns, nanoseconds since 1970",
    ),
    "nanoseconds, said to be seconds": Bad(
        text(rows(time=[f"{1_772_612_100_000_000_000 + round(5e8 * i)}" for i in range(N)])),
        "type --column time_s=t:ns",
        ("time_s=t:s", *WORDS[1:]),
    ),
    "ticks, not said": Bad(
        text(rows(time=[f"{639_082_953_000_000_000 + 5_000_000 * i}" for i in range(N)])),
        "type --column time_s=t:100ns, ticks of 100 ns since the year 1",
    ),
    "FILETIME, not said": Bad(
        text(rows(time=[f"{134_171_721_000_000_000 + 5_000_000 * i}" for i in range(N)])),
        "type --column time_s=t:100ns, FILETIME",
    ),
    "Julian days, not said": Bad(
        text(rows(time=[f"{2_461_071.99 + t / 86400:.9f}" for t in T])), "type --column time_s=t:d, Julian days"
    ),
    "times of day in digits, not said": Bad(
        text(rows(time=day(NOON, "%H%M%S.%f"))), 'are a time of day: type --time-format "%H%M%S.%f", or'
    ),
    "dates and times in digits, not said": Bad(
        text(rows(time=day(NOON, "%Y%m%d%H%M%S.%f"))), 'are a time of day: type --time-format "%Y%m%d%H%M%S.%f"'
    ),
    "the same said to be seconds": Bad(
        text(rows(time=day(NOON, "%Y%m%d%H%M%S.%f"))), "its digits are a time of day", ("time_s=t:s", *WORDS[1:])
    ),
    "datenum, not said": Bad(
        text(rows(time=[f"{740_046.34375 + t / 86400:.9f}" for t in T])),
        "type --column time_s=t:d, days since the year 0",
    ),
    "a number without a unit among such whose units change": Bad(
        text(rows(out=["0.6" if i == 7 else f"{600 + i} mbar" if i % 2 else f"0.{600 + i} bar" for i in range(N)])),
        "line 9: '0.6' in 'OUT' has no unit, and others there are in bar and mbar",
        ("time_s=t", "position_m=PV:%", "command_pa=OUT"),
    ),
    "a number in another unit than those without one": Bad(
        text(rows(out=[f"{600 + i} mbar" if i == 7 else f"0.{600 + i}" for i in range(N)])),
        "line 2: '0.600' in 'OUT' has no unit, and others there are in mbar",
    ),
    "numbers in another unit than the header's, as those without one are read": Bad(
        text(rows(out=[f"0.{600 + i}" if i == 7 else f"{600 + i} mbar" for i in range(N)], header="t,PV,OUT [bar]")),
        "line 9: '0.607' in 'OUT .bar.' has no unit, and others there are in mbar",
        ("time_s=t", "position_m=PV:%", "command_pa=OUT [bar]:mbar"),
    ),
    "a workbook's days, not said": Bad(
        text(rows(time=[f"{46085.25 + t / 86400:.10f}" for t in T])), "type --column time_s=t:d, days of a workbook"
    ),
    "a unit that nobody knows": Bad(
        text([rows()[0], "s,furlong,bar", *rows()[1:]]),
        "'PV' has 'furlong' where its unit stands, .* type --column position_m=PV:UNIT, of m, cm, mm",
        ("time_s=t", "position_m=PV", "command_pa=OUT"),
    ),
    "a truncated workbook": Bad(b"PK\x03\x04" + b"\x00" * 100, "begins as a workbook and is not whole"),
    "a workbook whose contents are damaged": Bad(
        archived("xl/workbook.xml").replace(b"PK\x01\x02", b"PK\x01\x00", 1), "is a damaged workbook"
    ),
    "a truncated Parquet file": Bad(b"PAR1" + b"\x15" * 100, "is a damaged Parquet file"),
    "a truncated MATLAB file": Bad(
        b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM\x0e\x00\x00", "damaged MATLAB file|no vectors"
    ),
    "a midnight by which a month passes": Bad(
        text(rows(time=day(datetime.datetime(2026, 1, 2, 23, 59, 58), "%d/%m/%Y %H:%M:%S.%f"))),
        'line 6: .* is 27 days off the row before it by .*; it is not by --time-format "%d/%m/%Y',
        options=ExportOptions(time_format="%m/%d/%Y %H:%M:%S.%f"),
    ),
    "a sheet of a text": Bad(
        text(rows()), "--sheet: goes with an Excel workbook", options=ExportOptions(sheet="Trend")
    ),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_it_is_refused_in_one_line_that_says_what_to_do(kind: str, tmp_path: Path) -> None:
    case = REFUSED[kind]
    path = tmp_path / "export.csv"
    path.write_bytes(case.data)
    with pytest.raises(InputError, match=case.said) as caught:
        read_export(path, read_mapping(case.words), case.stroke_m, options=case.options)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 600


ODD = {
    "mm taken for m": (rows(pv=[f"{0.4 * x:.2f}" for x in PV]), "position_m=PV", "are they in mm, or in %?"),
    "shares taken for %": (rows(pv=[f"{0.01 * x:.4f}" for x in PV]), "position_m=PV:%", "are they shares of 1"),
    "a valve that air closes": (rows(pv=[f"{100 - x:.2f}" for x in PV]), "position_m=PV:%", "air closes this valve"),
    "constant position": (rows(pv=["50.0"] * N), "position_m=PV:%", "a stem that never moves says nothing"),
    "constant command": (rows(out=["0.6"] * N), "position_m=PV:%", "nothing drives the stem"),
    "five rows": (rows()[:6], "position_m=PV:%", "5 rows are too few"),
    "a number for no value": (
        rows(pv=["-9999" if i in (3, 4, 5) else f"{x:.2f}" for i, x in enumerate(PV)]),
        "position_m=PV:%",
        "3 positions are -4 m, all others 0.0114. to 0.0285. m: does this number mean that there is no value?",
    ),
    "the hour that summer time takes": (
        rows(time=[f"{t + 3600.0 * (t > 15.0):.1f}" for t in T]),
        "position_m=PV:%",
        "a clock change in spring",
    ),
    "half of it missing": (rows(pv=["" if i % 2 else f"{x:.2f}" for i, x in enumerate(PV)]), "position_m=PV:%", "50 %"),
}


@pytest.mark.parametrize("kind", ODD)
def test_what_is_odd_is_said_before_anything_is_fitted(kind: str, tmp_path: Path) -> None:
    lines, word, said = ODD[kind]
    (tmp_path / "export.csv").write_bytes(text(lines))
    mapping = read_mapping(("time_s=t", word, "command_pa=OUT:bar"))
    recording = read_export(tmp_path / "export.csv", mapping, STROKE_M)
    assert re.search(said, "; ".join(oddities(recording, STROKE_M)))


def test_a_clock_that_was_set_back_is_said() -> None:
    time_s = np.where(np.arange(100) < 60, 1.0, 0.0) * 2.0 + np.arange(100)
    recording = Recording({"time_s": time_s, "command_pa": 1e4 * time_s, "position_m": 1e-4 * time_s})
    said = "time_s does not increase at sample 61: the clock was set back; the workbench begins anew there"
    assert said in oddities(recording, STROKE_M)


@pytest.mark.parametrize("separator", [";", ",", "\t", "|"])
def test_what_is_proposed_is_read_with_the_separator_that_was_shown(separator: str, tmp_path: Path) -> None:
    """The names are in the header of several readings, and the cells of one alone are numbers."""
    other = "," if separator != "," else ";"
    named = separator.join(["t", "PV", "OUT", f"why{other} who"])
    lines = [named, *(f"{line}{separator}a{other} b" for line in rows(separator)[1:])]
    (tmp_path / "a.csv").write_bytes(text([f"Trend{other} t{other} PV{other} OUT", *lines]))
    found = preview(tmp_path / "a.csv")
    sources = read_mapping([word for word in found.words if "=" in word])
    recording = read_export(tmp_path / "a.csv", sources, STROKE_M)
    np.testing.assert_allclose(recording.time_s, T, atol=1e-6)
    np.testing.assert_allclose(recording.position_m, STROKE_M * PV / 100, rtol=1e-6)


def beside(header: str, *cells: str) -> list[str]:
    """Return a text file of ISO times and, in every row, these cells."""
    return [header, *(",".join((stamp, *cells)) for stamp in ISO)]


PROPOSED = {
    "a loop's flow before the travel": (
        beside("Time,FIC1.OP,FIC1.PV,FV1.Travel", "12.7", "40.4", "11.7"),
        "--column time_s=Time --column position_m=FV1.Travel:% --column command_pa=FIC1.OP:%",
    ),
    "a loop's set point before its output": (
        beside("Time,FIC1.SP %,FIC1.PV m3/h,FIC1.OP %,FV1.ZT %", "40", "23.4", "12.7", "11.7"),
        "--column time_s=Time --column position_m=FV1.ZT %:% --column command_pa=FIC1.OP %:%",
    ),
    "a set point alone": (
        beside("Time,FV1.SP,FV1.Travel", "49.7", "50.1"),
        "--column time_s=Time --column position_m=FV1.Travel:% --column reference_m=FV1.SP:%",
    ),
    "a set point that is a pressure": (
        beside("Time,Sollwert [bar],Hub [mm]", "1.2", "50.1"),
        "--column time_s=Time --column position_m=Hub [mm]:mm --column command_pa=Sollwert [bar]:bar",
    ),
    "a range in the unit's place": (
        beside("Time,OP [4-20 mA],PV [0-100 %]", "13.7", "59.0"),
        "--column time_s=Time --column position_m=PV [0-100 %]:% --column command_pa=OP [4-20 mA]:mA",
    ),
    "qualities by number": (
        [*beside("Time,OP(%),PV(%),Qual.", "61.0", "59.0", "192"), "2026-10-25T03:00:00,61.0,59.0,64"],
        "--column time_s=Time --column position_m=PV(%):% --column command_pa=OP(%):% --status Qual.=192",
    ),
    "units in words over a shorter table": (
        ["Report;FV-101", "", "Timestamp;FV-101 Travel;FV-101 I/P output;Comment", ";% of stroke;kPa;"]
        + [f"{stamp};{x};{u};" for stamp, x, u in zip(ISO, PV, OUT, strict=True)],
        "--column time_s=Timestamp --column position_m=FV-101 Travel:% --column command_pa=FV-101 I/P output:kPa",
    ),
    "names in capitals and small letters": (
        rows(header="LogTime,stemPos_mm,actuatorCmd_bar"),
        "--column time_s=LogTime --column position_m=stemPos_mm:mm --column command_pa=actuatorCmd_bar:bar",
    ),
    "units in words behind a point or a space": (
        rows(header="Zeit,Hub.Prozent,Stelldruck mbar"),
        "--column time_s=Zeit --column position_m=Hub.Prozent:% --column command_pa=Stelldruck mbar:mbar",
    ),
    "French": (
        rows(";", header="Temps;Consigne (%);Position vanne (%)"),
        "--column time_s=Temps --column position_m=Position vanne (%):% --column reference_m=Consigne (%):%",
    ),
    "Spanish": (
        rows(";", header="Tiempo;Salida (%);Posición válvula (%)"),
        "--column time_s=Tiempo --column position_m=Posición válvula (%):% --column command_pa=Salida (%):%",
    ),
    "Italian": (
        rows(";", header="Data e ora;Uscita (%);Posizione (%)"),
        "--column time_s=Data e ora --column position_m=Posizione (%):% --column command_pa=Uscita (%):%",
    ),
    "Polish": (
        rows(";", header="Czas;Sygnał (%);Położenie (%)"),
        "--column time_s=Czas --column position_m=Położenie (%):% --column command_pa=Sygnał (%):%",
    ),
    "a time in a language that nobody has listed": (
        rows(";", header="Aeg;Hub [mm];Stelldruck [bar]"),
        "--column time_s=Aeg --column position_m=Hub [mm]:mm --column command_pa=Stelldruck [bar]:bar",
    ),
    "no time": (
        [line.partition(",")[2] for line in rows(header="t,Hub [mm],Stelldruck [bar]")],
        "--column position_m=Hub [mm]:mm --column command_pa=Stelldruck [bar]:bar --period-s S",
    ),
    "volts": (
        rows(header="t,Hub [V],Stelldruck [bar]", pv=[f"{0.1 * x:.3f}" for x in PV]),
        "--column time_s=t --column position_m=Hub [V]:0-10V --column command_pa=Stelldruck [bar]:bar",
    ),
    "a clock in milliseconds": (
        rows(time=[f"{1e3 * (1_772_612_100 + t):.0f}" for t in T], header="ts,PV,OP"),
        "--column time_s=ts:ms --column position_m=PV:% --column command_pa=OP:bar",
    ),
}


@pytest.mark.parametrize("kind", PROPOSED)
def test_the_words_that_read_it_are_proposed(kind: str, tmp_path: Path) -> None:
    lines, words = PROPOSED[kind]
    (tmp_path / "export.csv").write_bytes(text(lines))
    assert (
        " ".join(preview(tmp_path / "export.csv").words).partition(" --stroke-m M")[0].partition(" --range-pa")[0]
        == words
    )


@pytest.mark.parametrize("quality", ["", ";192", ";Good"])
def test_the_signals_of_a_table_with_a_row_a_value_are_proposed(tmp_path: Path, quality: str) -> None:
    """A historian's has a quality beside, which as a number was taken for a second signal."""
    rows = (f"{tag};{stamp};{i}1.5{quality}" for stamp in ISO for i, tag in enumerate(("FV1.ZT", "FV1.OUT")))
    (tmp_path / "export.csv").write_bytes(text([f"Tag;Time;Value{quality and ';Quality'}", *rows]))
    words = preview(tmp_path / "export.csv").words
    assert {"time_s=Time", "position_m=FV1.ZT:p.u.", "command_pa=FV1.OUT:%"} <= set(words)


def by_pandas(path: Path, write: Callable[["object"], None]) -> None:
    import pandas

    stamps = pandas.to_datetime([each.replace("T", " ") for each in ISO])
    write(pandas.DataFrame({"t": stamps, "PV": PV, "OUT": OUT}))


def write_pandas_csv(path: Path) -> None:
    by_pandas(path, lambda frame: frame.to_csv(path, sep=";", decimal=",", index=False, encoding="utf-8-sig"))  # type: ignore[attr-defined]


def write_pandas_excel(path: Path) -> None:
    by_pandas(path, lambda frame: frame.to_excel(path, index=True, startrow=3, sheet_name="Trend"))  # type: ignore[attr-defined]


def write_pandas_parquet(path: Path) -> None:
    by_pandas(path, lambda frame: frame.to_parquet(path))  # type: ignore[attr-defined]


def write_excel_dialect(path: Path) -> None:
    buffer = io.StringIO(newline="")
    writer = csv.writer(buffer, dialect="excel-tab")
    writer.writerows([["t", "PV", "OUT"], *zip(ISO, PV.tolist(), OUT.tolist(), strict=True)])
    path.write_text(buffer.getvalue(), encoding="utf-16", newline="")


def write_openpyxl(path: Path) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    book.active.title = "Cover"
    book.active["A1"] = "Trend of FV-101"
    page = book.create_sheet("Data")
    page.append(["t", "PV", "OUT"])
    page.append([None, "%", "bar"])
    for stamp, x, u in zip(ISO, PV.tolist(), OUT.tolist(), strict=True):
        page.append([datetime.datetime.fromisoformat(stamp), x, u])
    book.save(path)


def write_savemat(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"t": T, "PV": PV[:, None], "OUT": OUT, "fs": 2.0, "who": "rig 3"})


def write_savemat_struct(path: Path) -> None:
    from scipy.io import savemat

    savemat(path, {"log": {"t": T, "signals": {"PV": PV, "OUT": OUT}}}, do_compression=True)


def write_line_protocol(path: Path) -> None:
    """As Telegraf writes two valves and a temperature into a file: a series a valve, not in the order of time."""
    begin_ns = 1_700_000_000_000_000_000
    lines = [
        f'positioner,host=gateway\\ 1,valve=FV-{valve} position={x / valve!r},command={u / valve!r},mode=2i,why="a, b" '
        f"{begin_ns + round(t * 1e9)}"
        for valve in (2, 1)
        for t, x, u in zip(T.tolist(), PV.tolist(), OUT.tolist(), strict=True)
    ]
    path.write_text("\n".join([*lines, f"room temperature=21.5 {begin_ns}", ""]))


LINE_PROTOCOL_WORDS = (
    "time_s=time",
    "position_m=positioner,host=gateway 1,valve=FV-1.position:%",
    "command_pa=positioner,host=gateway 1,valve=FV-1.command:bar",
)


OTHERS: dict[str, tuple[Callable[[Path], None], str, tuple[str, ...]]] = {
    "pandas.to_csv": (write_pandas_csv, "a.csv", WORDS),
    "pandas.to_excel": (write_pandas_excel, "a.xlsx", WORDS),
    "pandas.to_parquet": (write_pandas_parquet, "a.parquet", WORDS),
    "csv, excel-tab, UTF-16": (write_excel_dialect, "a.txt", WORDS),
    "openpyxl": (write_openpyxl, "a.xlsx", ("time_s=t", "position_m=PV", "command_pa=OUT")),
    "line protocol": (write_line_protocol, "a.lp", LINE_PROTOCOL_WORDS),
    "scipy.io.savemat": (write_savemat, "a.mat", WORDS),
    "scipy.io.savemat, a struct": (
        write_savemat_struct,
        "a.mat",
        ("time_s=log.t", "position_m=log.signals.PV:%", "command_pa=log.signals.OUT:bar"),
    ),
}


@pytest.mark.parametrize("program", OTHERS)
def test_what_other_programs_write_is_read(program: str, tmp_path: Path) -> None:
    write, name, words = OTHERS[program]
    write(tmp_path / name)
    recording = read_export(tmp_path / name, read_mapping(words), STROKE_M)
    np.testing.assert_allclose(recording.time_s, T, atol=1e-6)
    np.testing.assert_allclose(recording.position_m, STROKE_M * PV / 100)
    np.testing.assert_allclose(recording.command_pa, 1e5 * OUT)


def test_line_protocol_tells_when_it_was_recorded_in_whatever_unit(tmp_path: Path) -> None:
    path = tmp_path / "a.lp"
    words = read_mapping(("time_s=time", "position_m=x:m", "command_pa=valve.u:bar"))
    for digits in (1, 1_000, 1_000_000, 1_000_000_000):
        points = [f"valve x={0.01 * i},u=1.{i} {(1_700_000_000 + i) * digits}\n" for i in range(4)]
        path.write_text("".join([*points, f"other u=1 {1_700_000_000 * digits}\n"]))
        recording = read_export(path, words, STROKE_M)
        np.testing.assert_allclose(recording.time_s, [0.0, 1.0, 2.0, 3.0])
        assert recording.metadata["recorded"] == "2023-11-14T22:13:20+00:00"


def test_a_line_of_line_protocol_that_is_no_point_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.lp"
    path.write_text("valve position=1.0 1700000000000\nvalve position= 1700000000100\n")
    with pytest.raises(InputError, match="line 2: is no point with a time stamp: 'valve position= 17"):
        read_export(path, read_mapping(("time_s=time", "position_m=position", "command_pa=command")), STROKE_M)


def test_sheets_that_both_have_the_columns_are_named_and_one_can_be_said(tmp_path: Path) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    for page in (book.active, book.create_sheet("Again")):
        page.append(["t", "PV", "OUT"])
        page.append([0.0, 50.0, 0.6])
        page.append([0.5, 51.0, 0.7])
    book.save(tmp_path / "a.xlsx")
    mapping = read_mapping(WORDS)
    with pytest.raises(
        InputError, match=r"the sheets 'Sheet', 'Again' all have these columns: say which, --sheet NAME"
    ):
        read_export(tmp_path / "a.xlsx", mapping, STROKE_M)
    again = ExportOptions(sheet="Again")
    assert len(read_export(tmp_path / "a.xlsx", mapping, STROKE_M, options=again)) == 2
    with pytest.raises(InputError, match="has no sheet 'None such'; it has: Sheet, Again"):
        read_export(tmp_path / "a.xlsx", mapping, STROKE_M, options=ExportOptions(sheet="None such"))


@pytest.mark.parametrize("count", [1, 2, 5])
def test_few_rows_are_read(count: int, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(text(rows(time=ISO)[: count + 1]))
    assert len(read_export(path, read_mapping(WORDS), STROKE_M)) == count


@pytest.mark.parametrize("pause_s", [600, 3000])
def test_the_end_of_summer_time_in_a_pause_does_not_turn_the_rows_round(pause_s: int, tmp_path: Path) -> None:
    clock = [
        (AUTUMN + datetime.timedelta(seconds=0.5 * i + (pause_s - 3600 if i >= 30 else 0))).isoformat(sep=" ")
        for i in range(N)
    ]
    (tmp_path / "export.csv").write_bytes(text(rows(time=clock)))
    recording = read_export(tmp_path / "export.csv", read_mapping(WORDS), STROKE_M)
    np.testing.assert_allclose(recording.time_s, T + np.where(np.arange(N) >= 30, pause_s, 0.0))
    np.testing.assert_allclose(recording.position_m, STROKE_M * PV / 100)
    assert "from sample 31 on an hour is added" in recording.metadata["clock change"]


def test_the_fields_of_a_structure_are_proposed_by_their_own_names(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "a.mat", {"logsout": {"t": T, "p_cmd": OUT, "pos": PV}})
    words = [word for word in preview(tmp_path / "a.mat").words if "=" in word]
    assert words == ["time_s=logsout.t", "position_m=logsout.pos:%", "command_pa=logsout.p_cmd:bar"]


def test_rows_of_one_time_and_a_step_back_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t,PV,OUT\n5,1,1\n5,2,1\n5,3,1\n5,4,1\n3,1,1\n")
    with pytest.raises(InputError, match="of one time and have different values"):
        read_export(path, read_mapping(WORDS), STROKE_M)


def test_a_clock_set_back_now_and_then_is_left_for_the_workbench(tmp_path: Path) -> None:
    t = np.where(np.arange(400) < 200, 0.5 * np.arange(400), 0.5 * np.arange(400) - 7.27)
    path = tmp_path / "a.csv"
    path.write_text("t,PV,OUT\n" + "".join(f"{each:.2f},{50 + i % 7},0.6\n" for i, each in enumerate(t)))
    recording = read_export(path, read_mapping(WORDS), STROKE_M)
    np.testing.assert_allclose(recording.time_s, t)


def test_our_own_recordings_may_have_a_byte_order_mark_and_name_the_way_out(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("time_s,command_pa,position_m\n0,1,2\n1,1,3\n", encoding="utf-8-sig")
    assert len(Recording.read(path)) == 2
    path.write_bytes(text(rows(";")))
    with pytest.raises(InputError, match=r"column time_s is missing; .*`positioner import .*` says how to read it"):
        Recording.read(path)
