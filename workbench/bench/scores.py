"""The results file, and how good each method is by it: by case, never by record.

    set, case, method    as in `cases.csv`; the method's name
    score                of a loop: higher, the surer it sticks; any scale
    says                 of a loop: sticks, or nothing where the method calls none; of an effect: the names it may be
    stiction_pct         apparent stiction S, % of the output, where the method has one

The area under the ROC curve has a 95 % interval, by cases drawn anew 2000 times.
"""

import csv
from collections.abc import Collection, Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from math import isfinite
from pathlib import Path

import numpy as np
import numpy.typing as npt

from config.errors import InputError
from workbench.bench.cases import EFFECTS, Case

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
WITHIN = 0.2
"""Relative error of S that counts as right."""
DRAWN_ANEW = 2000  # draws of the loops: a 95 % end is good to 0.005


@dataclass(frozen=True, slots=True)
class Answer:
    """A line of the results file."""

    set: str
    case: str
    method: str
    score: float
    says: str
    stiction_pct: float | None


def add_results(path: Path, answers: Sequence[Answer]) -> None:
    """Add to a results file, or begin it."""
    with path.open("a", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        if file.tell() == 0:
            writer.writerow([each.name for each in fields(Answer)])
        writer.writerows(astuple(each) for each in answers)


def read_results(path: Path, cases: Sequence[Case]) -> list[Answer]:
    """Read a results file.

    Raises:
        InputError: it cannot be read, lacks a column, or a line is no answer to a case; says the line.
    """
    found: dict[tuple[str, str, str], Answer] = {}
    known = {(each.set, each.name) for each in cases}
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            for row in csv.DictReader(file):
                key = row["set"], row["case"], row["method"]
                size = float(row["stiction_pct"]) if row.get("stiction_pct") else None
                answer = Answer(*key, float(row["score"]), row.get("says") or "", size)
                if problem := _problem(answer, known, twice=key in found):
                    raise ValueError(problem)
                found[key] = answer
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from None
    except KeyError as error:
        raise InputError(str(path), f"lacks the column {error.args[0]}") from None
    except ValueError as error:
        raise InputError(str(path), f"line {len(found) + 2}: {error}") from None
    return list(found.values())


def _problem(answer: Answer, known: Collection[tuple[str, str]], *, twice: bool) -> str:
    if (answer.set, answer.case) not in known:
        return f"there is no case {answer.case} of set {answer.set}"
    if twice:
        return f"{answer.method} answers case {answer.case} a second time"
    if answer.set != EFFECTS and answer.says not in ("", "sticks"):
        return f"says must be sticks or nothing, got {answer.says}"
    return "" if isfinite(answer.score) else f"score must be a number, got {answer.score}"


def tell_scores(cases: Sequence[Case], answers: Sequence[Answer]) -> Iterator[str]:
    """Yield a line a method, set by set."""
    for name in dict.fromkeys(each.set for each in cases):
        of_set = {each.name: each for each in cases if each.set == name}
        hidden = name == EFFECTS
        yield f"{name}: {len(of_set)} cases" + (
            "" if hidden else f", {sum(each.truth == '1' for each in of_set.values())} stick"
        )
        for method in dict.fromkeys(each.method for each in answers if each.set == name):
            mine = [each for each in answers if (each.set, each.method) == (name, method) and each.case in of_set]
            truths = [of_set[each.case] for each in mine]
            told = _of_effects(truths, mine) if hidden else _of_loops(truths, mine)
            missed = f"; {len(of_set) - len(mine)} without an answer" if len(mine) < len(of_set) else ""
            yield f"  {method:18} {told}{missed}"


def _of_effects(truths: Sequence[Case], mine: Sequence[Answer]) -> str:
    named = sum(case.truth in each.says.split() for case, each in zip(truths, mine, strict=True))
    alone = sum(case.truth == each.says for case, each in zip(truths, mine, strict=True))
    silent = sum(not each.says for each in mine)
    return f"named {named} (alone {alone}), nothing named {silent}, wrong {len(mine) - named - silent}"


def _of_loops(truths: Sequence[Case], mine: Sequence[Answer]) -> str:
    scores, sticks = np.array([each.score for each in mine]), np.array([case.truth == "1" for case in truths])
    low, high = area_interval(scores, sticks)
    told = f"AUC {area(scores, sticks):.2f} ({low:.2f} to {high:.2f})"
    called = [(case, each) for case, each in zip(truths, mine, strict=True) if each.says == "sticks"]
    if called:
        told += f"; called {len(called)}, wrong {sum(case.truth != '1' for case, _ in called)}"
    sized = [
        abs(each.stiction_pct / case.stiction_pct - 1.0) <= WITHIN
        for case, each in called
        if case.stiction_pct and each.stiction_pct
    ]
    return told + (f"; S within {100 * WITHIN:.0f} % in {sum(sized)} of {len(sized)}" if sized else "")


def area(scores: Array, sticks: Flags) -> float:
    """Return how often a sticking case has more than another, half for a tie: the area under the ROC curve."""
    return float(_wins(scores, sticks).mean()) if 0 < sticks.sum() < sticks.size else float("nan")


def area_interval(scores: Array, sticks: Flags) -> tuple[float, float]:
    """Return the 95 % interval of the area."""
    rng, wins = np.random.default_rng(0), _wins(scores, sticks)
    if not wins.size:
        return float("nan"), float("nan")
    rows, columns = wins.shape
    again = [
        wins[np.ix_(rng.integers(0, rows, rows), rng.integers(0, columns, columns))].mean() for _ in range(DRAWN_ANEW)
    ]
    return float(np.quantile(again, 0.025)), float(np.quantile(again, 0.975))


def _wins(scores: Array, sticks: Flags) -> Array:
    ours, others = scores[sticks][:, None], scores[~sticks]
    return np.asarray((ours > others) + 0.5 * (ours == others), np.float64)
