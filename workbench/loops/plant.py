"""Many loops: ranked by what they cost and how sure it is, and which of them oscillate together.

A manifest is a CSV file: `loop,file`, and where the file does not say it by itself the columns `time,op,pv,sp,mode`; a
file may be named by many loops. What was worked out of a file is kept in a folder, as a fleet's examinations are: of
5000 loops the next night works out only those that are new.

Loops that oscillate regularly with one period are a group. The likeliest source of it is the valve that sticks surest;
else the loop whose PV is ahead of all others by up to a quarter of a period, where records are of one time; else that
with the most harmonics: friction makes them, and what is downstream of it filters them out (Thornhill and Hagglund
1997).
"""

import csv
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from config.errors import InputError
from config.plain_file import read_plain
from config.results.block import Table
from workbench.data.kept_results import KeptResults, key_of
from workbench.imports.loop_reader import ROLES, read_loop
from workbench.loops.causes import CAUSES_FORM, Causes
from workbench.loops.loop_diagnosis import LoopDiagnosis, diagnose_loop
from workbench.loops.loop_record import LoopRecord
from workbench.loops.loop_thresholds import LIMITS
from workbench.loops.oscillation import without_trend


@dataclass(frozen=True, slots=True)
class Entry:
    """A line of the manifest: the loop's name, its file, and columns by role where they are named."""

    loop: str
    file: Path
    named: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Group:
    """Loops that oscillate together: their names, the period, s, the likeliest source and why."""

    loops: tuple[str, ...]
    period_s: float
    source: str
    because: str


@dataclass(frozen=True, slots=True)
class Plant:
    """The loops of a plant, ranked, the first the one to look at; those of no record; groups."""

    ranked: tuple[LoopDiagnosis, ...]
    unreadable: tuple[tuple[str, str], ...]
    groups: tuple[Group, ...]

    @property
    def ranking(self) -> Table:
        """A line a loop."""
        rows = [
            (e.record.name, e.verdict, e.sticks_said, e.stiction_said, f"{100 * e.variance_cost:.2g}", e.because)
            for e in self.ranked
        ]
        return Table(("loop", "", "sticks, %", "stiction, % of output", "error's std, % of PV", ""), rows)

    def count(self, verdict: str) -> int:
        """Return how many loops have a verdict."""
        return sum(each.verdict == verdict for each in self.ranked)


def read_manifest(path: Path) -> tuple[Entry, ...]:
    """Read a manifest.

    Raises:
        InputError: it cannot be read, lacks a column, has one that is none, names no loop, or one twice.
    """
    lines = read_plain(path).splitlines()
    reader = csv.DictReader(lines, delimiter=";" if lines and ";" in lines[0] else ",")
    columns = [each.strip() for each in reader.fieldnames or ()]
    if not {"loop", "file"} <= set(columns) <= {"loop", "file", *ROLES}:
        raise InputError(str(path), f"columns must be loop, file, any of {', '.join(ROLES)}; got {', '.join(columns)}")
    reader.fieldnames = columns
    entries = []
    for row in reader:
        held = {key: (value or "").strip() for key, value in row.items() if isinstance(key, str)}
        if not held["loop"] or not held["file"]:
            raise InputError(str(path), f"line {reader.line_num}: loop and file must both be given")
        named = tuple((role, held[role]) for role in ROLES if held.get(role))
        entries.append(Entry(held["loop"], path.parent / held["file"], named))
    names = [each.loop for each in entries]
    if not entries:
        raise InputError(str(path), "names no loop: under its first line stands a row for each")
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise InputError(str(path), f"names the loop {twice} {names.count(twice)} times; allowed is once")
    return tuple(entries)


def diagnose_plant(
    entries: Sequence[Entry],
    workers: int | None,
    tell: Callable[[LoopDiagnosis], None],
    out: Path | None = None,
    notation: Mapping[str, Any] | None = None,
) -> Plant:
    """Return the loops of a manifest, ranked.

    Args:
        entries: of the manifest.
        workers: processes; None: one a core.
        tell: is given each as it is done.
        out: folder in which what was worked out is kept; None: nothing is.
        notation: how numbers and dates of all files are written, as `read_loop` takes it.

    Raises:
        InputError: the folder cannot be written, or is none of this.
    """
    done: list[LoopDiagnosis] = []
    unreadable: list[tuple[str, str]] = []
    if out is not None:
        KeptResults(out, Causes)
    one = partial(_diagnosed, out, notation or {})
    with ProcessPoolExecutor(max_workers=workers or os.cpu_count()) as pool:
        for entry, found in zip(entries, pool.map(one, entries, chunksize=1), strict=True):
            if isinstance(found, str):
                unreadable.append((entry.loop, found))
            else:
                done.append(found)
                tell(found)
    return Plant(tuple(sorted(done, key=_rank)), tuple(unreadable), tuple(find_groups(done)))


def _diagnosed(out: Path | None, notation: Mapping[str, Any], entry: Entry) -> LoopDiagnosis | str:
    try:
        read = read_loop(entry.file, dict(entry.named), **notation)
        record = LoopRecord.of_export(read, entry.loop)
        if out is None:
            return diagnose_loop(record)
        kept = KeptResults(out, Causes)
        key = key_of(entry.file, ["loop", CAUSES_FORM, entry.named, *sorted(notation.items())])
        before = kept.get(key)
        found = diagnose_loop(record, before)
        if before is None and found.causes is not None:
            kept.put(key, found.causes)
        return found
    except InputError as error:
        return str(error)


def _rank(each: LoopDiagnosis) -> tuple[bool, float]:
    """Return what loops are sorted by: sticking ones first, each by probability times variance cost."""
    return each.verdict != "sticks", -(each.probability or 0.0) * each.variance_cost


def find_groups(loops: Sequence[LoopDiagnosis]) -> list[Group]:
    """Return the groups of loops that oscillate together, the largest first."""
    left = sorted((each for each in loops if each.oscillation.regular), key=lambda each: each.oscillation.period_s)
    groups: list[Group] = []
    while left:
        first = left[0].oscillation.period_s
        together = [each for each in left if each.oscillation.period_s <= first * (1.0 + LIMITS.together_period)]
        left = left[len(together) :]
        if len(together) > 1:
            groups.append(_group(together))
    return sorted(groups, key=lambda each: -len(each.loops))


def _group(together: Sequence[LoopDiagnosis]) -> Group:
    sticking = [each for each in together if each.verdict == "sticks"]
    period_s = float(np.median([each.oscillation.period_s for each in together]))
    if sticking:
        source, because = max(sticking, key=lambda each: each.probability or 0.0), "its valve sticks"
    elif ahead := [each for each in together if _is_ahead(each, together, period_s)]:
        source, because = ahead[0], "its process value is ahead of all others"
    else:
        source, because = max(together, key=harmonic_share), "it has the most harmonics"
    return Group(tuple(each.record.name for each in together), period_s, source.record.name, because)


def _is_ahead(first: LoopDiagnosis, together: Sequence[LoopDiagnosis], period_s: float) -> bool:
    late_s = [delay_s(first.record, each.record, period_s) for each in together if each is not first]
    least_s = max(first.record.period_s, LIMITS.together_period * period_s)
    return all(each is not None and each > least_s for each in late_s)


def delay_s(first: LoopRecord, second: LoopRecord, period_s: float) -> float | None:
    """Return by how much a PV comes after another, s, within a quarter of a period; None without common cycles.

    Either PV may fall as the other rises: it is where their correlation is largest in magnitude.
    """
    step_s = max(first.period_s, second.period_s)
    begin_s = max(first.time_s, second.time_s)
    end_s = min(first.time_s + first.duration_s, second.time_s + second.duration_s)
    if end_s - begin_s < LIMITS.fewest_cycles * period_s:
        return None
    at_s = np.arange(begin_s, end_s, step_s)
    one, other = (
        without_trend(np.interp(at_s, r.time_s + r.period_s * np.arange(r.pv.size), r.pv)) for r in (first, second)
    )
    reach = int(0.25 * period_s / step_s)
    inner = slice(reach, at_s.size - reach)
    lags = range(-reach, reach + 1)
    products = [abs(float(one[inner] @ other[inner.start + lag : inner.stop + lag])) for lag in lags]
    return step_s * lags[int(np.argmax(products))]


def harmonic_share(each: LoopDiagnosis) -> float:
    """Return the power of PV at twice to five times the frequency of its oscillation, of that at all of them."""
    values = without_trend(each.record.pv)
    power = np.abs(np.fft.rfft(values * np.hanning(values.size))) ** 2
    place = np.fft.rfftfreq(values.size, each.record.period_s) * each.oscillation.period_s
    near = np.abs(place - np.round(place)) < 0.15
    base = float(power[near & (np.round(place) == 1)].sum())
    higher = float(power[near & (np.round(place) >= 2) & (np.round(place) <= 5)].sum())
    return higher / max(base + higher, 1e-300)
