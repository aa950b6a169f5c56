"""What hangs on each threshold of the diagnosis: every one is changed by 30 % either way, and a sample is judged anew.

    python -m benchmarks.thresholds [--number 10] [--seed 0] [--list]

A threshold is a field of a room's frozen dataclasses (`FILES`); a whole one moves by at least one. Each change is made
in a copy of the tree, where kept cases of the blind campaign (`SAMPLE`) are diagnosed. A line says what they say
otherwise than without the change: a verdict that hangs on a threshold's third is one that nobody should trust. A minute
or two a change; by default some are drawn.
"""

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.blind import KEPT
from benchmarks.kept_lines import keep, kept
from benchmarks.mutants import ROOT

FILES = (
    Path("workbench/fit/fit_thresholds.py"),
    Path("workbench/select/selection_thresholds.py"),
    Path("workbench/diagnosis/diagnosis_thresholds.py"),
)
SAMPLE = (("few_slips", 1001), ("few_slips", 1005), ("clean", 81001), ("nothing", 83002), ("two", 84000))
"""A lag, a set of two, a place, nothing, and two of which one is not seen: some ten seconds each."""
FACTORS = (1.3, 1.0 / 1.3)


@dataclass(frozen=True, slots=True)
class Threshold:
    """A number: its file, where it stands in it, its name and value."""

    path: Path
    line: int
    columns: tuple[int, int]
    name: str
    value: float

    def times(self, factor: float) -> str:
        """Return the number changed, as it is written."""
        if isinstance(self.value, int):
            moved = round(self.value * factor)
            return repr(moved if moved != self.value else self.value + (1 if factor > 1.0 else -1))
        return repr(self.value * factor)


def thresholds() -> Iterator[Threshold]:
    """Yield all, file by file."""
    for path in FILES:
        tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
        classes = [each for each in tree.body if isinstance(each, ast.ClassDef)]
        for field in (each for of in classes for each in of.body if isinstance(each, ast.AnnAssign) and each.value):
            for each in ast.walk(field.value or field):
                if isinstance(each, ast.Constant) and type(each.value) in (int, float) and each.value:
                    name, columns = ast.unparse(field.target), (each.col_offset, each.end_col_offset or 0)
                    yield Threshold(path, each.lineno, columns, name, ast.literal_eval(each))


def differences(tree: Path, sample: Path, out: Path) -> list[str]:
    """Return what the sample says otherwise in a tree, a line a case; errors of the run as they are."""
    words = [sys.executable, "-m", "benchmarks.blind", "--out", str(sample), "--moved", str(out)]
    env = {**os.environ, "PYTHONPATH": str(tree)}
    done = subprocess.run(words, cwd=tree, env=env, capture_output=True, text=True, check=False)
    if done.returncode:
        return [done.stderr.strip().splitlines()[-1]]
    said = [line.split("; ") for line in done.stdout.splitlines()]
    decided = [(each[0], [what for what in each[1:] if what.startswith(("verdict", "sets"))]) for each in said]
    return [f"{case.rsplit(' ', 4)[0]}: {', '.join(what)}" for case, what in decided if what]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--number", type=int, default=10, help="thresholds drawn; 0: all (10)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--list", action="store_true", help="change nothing, print them")
    arguments = parser.parse_args()
    every = list(thresholds())
    drawn = every if not arguments.number else random.Random(arguments.seed).sample(every, arguments.number)
    if arguments.list:
        print(*(f"{each.path}:{each.line}: {each.name} {each.value}" for each in every), sep="\n")
        print(f"{len(every)} numbers, {len({(each.path, each.name) for each in every})} names")
        return
    with tempfile.TemporaryDirectory() as folder:
        tree, sample = Path(folder) / "tree", Path(folder) / "sample.jsonl"
        shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(".*", "__pycache__", "build", "dist", "docs"))
        for case in kept(ROOT / KEPT):
            if (case["family"], case["seed"]) in SAMPLE:
                keep(sample, case)
        print(
            "unchanged:", *differences(tree, sample, Path(folder) / "unchanged.jsonl") or ["nothing moved"], flush=True
        )
        for number, each in enumerate(drawn):
            text = (ROOT / each.path).read_text(encoding="utf-8")
            lines = text.splitlines(keepends=True)
            begin, end = each.columns
            for factor in FACTORS:
                line = lines[each.line - 1]
                changed = [*lines[: each.line - 1], line[:begin] + each.times(factor) + line[end:], *lines[each.line :]]
                (tree / each.path).write_text("".join(changed), encoding="utf-8")
                said = differences(tree, sample, Path(folder) / f"{number}_{factor:.2f}.jsonl")
                what = f"{each.path}:{each.line}: {each.name} {each.value} to {each.times(factor)}"
                print(what, *said or ["nothing moved"], sep="; ", flush=True)
            (tree / each.path).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
