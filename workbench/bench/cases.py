"""The cases of a benchmark's folder, with truth: `cases.csv`, one line a record; a case may have several.

    set             drawn, effects, or a set of labelled loops
    case            its name
    file            a loop's time_s, op_pct, pv, sp, or op alone; of an effect the folder of `positioner hide`
    truth           1 or 0, whether the valve sticks; of an effect its name
    stiction_pct    apparent stiction S, % of the output, where it is known

Files are named from the folder on.
"""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from config.errors import InputError, explain_failure
from workbench.bench.drawn_loops import draw_loops, simulate
from workbench.blind.hiding import hide
from workbench.blind.sealing import seal
from workbench.loops.stem_and_process import compiled

CASES = "cases.csv"
COLUMNS = ("set", "case", "file", "truth", "stiction_pct")
LABELS = {"file", "loop", "sticks", "set"}
"""Columns of a folder of labelled loops' `labels.csv`; a loop without 1 or 0 is left out."""
EFFECTS = "effects"


@dataclass(frozen=True, slots=True)
class Case:
    """A case: set, name, its records' files, truth, and S, %, or None."""

    set: str
    name: str
    files: tuple[Path, ...]
    truth: str
    stiction_pct: float | None


def write_cases(folder: Path, drawn: int, effects: int, first_seed: int, labelled: Path | None) -> None:
    """Write a benchmark's cases into a folder.

    Raises:
        InputError: the folder cannot be written, holds cases already, or the labelled loops cannot be read.
    """
    if (folder / CASES).exists():
        raise InputError(str(folder), f"holds {CASES} already")
    rows: list[tuple[str, ...]] = [] if labelled is None else list(_labelled(labelled))
    with explain_failure(folder, "cannot be written"):
        folder.mkdir(parents=True, exist_ok=True)
        rows += [*_drawn(folder, drawn, first_seed), *_hidden(folder, effects, first_seed)]
        with (folder / CASES).open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows([COLUMNS, *rows])


def _drawn(folder: Path, count: int, first_seed: int) -> Iterator[tuple[str, ...]]:
    for loop in draw_loops(count, compiled(simulate), first_seed=first_seed):
        truth, path = loop.truth, Path("loops") / f"{loop.truth.seed}.csv"
        (folder / path).parent.mkdir(exist_ok=True)
        columns = np.column_stack([loop.time_s, loop.op_pct, loop.pv, loop.sp])
        np.savetxt(folder / path, columns, "%.9g", ",", header="time_s,op_pct,pv,sp", comments="")
        sticks = truth.cause == "sticks"
        size = f"{truth.stiction_pct:.6g}" if sticks else ""
        yield "drawn", str(truth.seed), str(path), str(int(sticks)), size


def _hidden(folder: Path, count: int, first_seed: int) -> Iterator[tuple[str, ...]]:
    for seed in range(first_seed, first_seed + count):
        hidden = hide(seed)
        path = Path(EFFECTS) / str(seed)
        seal(folder / path, hidden)
        yield EFFECTS, str(seed), str(path), hidden.truth.effect[0].name, ""


def _labelled(folder: Path) -> Iterator[tuple[str, ...]]:
    path = folder / "labels.csv"
    for row in _rows(path, LABELS):
        if row["sticks"] in ("0", "1"):
            yield row["set"], row["loop"], str((folder / row["file"]).resolve()), row["sticks"], ""


def read_cases(folder: Path) -> list[Case]:
    """Return the cases of a folder.

    Raises:
        InputError: `cases.csv` cannot be read, or lacks a column.
    """
    found: dict[tuple[str, str], Case] = {}
    for row in _rows(folder / CASES, set(COLUMNS)):
        key = (row["set"], row["case"])
        files = (*(found[key].files if key in found else ()), folder / row["file"])
        size = float(row["stiction_pct"]) if row["stiction_pct"] else None
        found[key] = Case(*key, files, row["truth"], size)
    return list(found.values())


def _rows(path: Path, columns: set[str]) -> list[dict[str, str]]:
    with explain_failure(path, "cannot be read"), path.open(encoding="utf-8", newline="") as file:
        reader = csv.DictReader(file)
        if lacks := columns - set(reader.fieldnames or ()):
            raise InputError(str(path), f"lacks the columns {', '.join(sorted(lacks))}")
        return list(reader)
