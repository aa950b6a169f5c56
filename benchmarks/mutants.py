"""What the tests do not hold: constants and branches are changed one at a time; what no test sees is printed.

    python -m benchmarks.mutants [FOLDER ...] [--number 20] [--seed 0]

Changes: a number becomes 1.5 times itself, a whole one is one more; `<` and `<=`, `>` and `>=`, `==` and `!=`, `and`
and `or` change places; a condition is turned round. Each is tried in a copy of the tree, by the tests of its room,
those that name its module first, until one is red. A survivor is a test that is missing, or code that nobody needs; a
few change nothing that can be seen (a bound where no value lies). Minutes a survivor: by default a sample is drawn.
"""

import argparse
import ast
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
ROOMS = {
    "positioner/control": "tests/control",
    "workbench/fit": "tests/workbench",
    "workbench/select": "tests/workbench",
}
"""What is changed unless somebody says, and where the tests of each are."""
OTHERS: dict[type[ast.AST], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
}
LONGEST_S = 1200.0
"""Of the tests of one change: longer is a change that was seen, a loop without an end."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """A change of one place: its file, line, the line before, and the whole text after."""

    path: Path
    line: int
    before: str
    after: str
    text: str


def mutants(path: Path) -> Iterator[Mutant]:
    """Yield the changes of a file."""
    source = (ROOT / path).read_text(encoding="utf-8")
    count = sum(1 for _ in _places(ast.parse(source)))
    for number in range(count):
        tree = ast.parse(source)
        shown, node = list(_places(tree))[number]
        before, line = ast.unparse(shown), getattr(shown, "lineno", 0)
        _change(shown, node)
        after = f"not ({before})" if isinstance(node, ast.If | ast.IfExp | ast.While) else ast.unparse(shown)
        yield Mutant(path, line, before, after, ast.unparse(ast.fix_missing_locations(tree)))


def _places(tree: ast.AST) -> Iterator[tuple[ast.AST, ast.AST]]:
    """Yield what is changed, and the node that holds it, which is shown."""
    for parent in ast.walk(tree):
        for node in ast.iter_child_nodes(parent):
            is_number = isinstance(node, ast.Constant) and type(node.value) in (int, float)
            if is_number and not isinstance(parent, ast.Subscript | ast.Slice):
                yield parent if hasattr(parent, "lineno") else node, node
        if isinstance(parent, ast.Compare) and type(parent.ops[0]) in OTHERS:
            yield parent, parent.ops[0]
        if isinstance(parent, ast.BoolOp):
            yield parent, parent.op
        if isinstance(parent, ast.If | ast.IfExp | ast.While):
            yield parent.test, parent


def _change(shown: ast.AST, node: ast.AST) -> None:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        node.value = node.value + 1 if isinstance(node.value, int) else 1.5 * node.value or 1.0
    elif isinstance(node, ast.If | ast.IfExp | ast.While):
        node.test = ast.UnaryOp(ast.Not(), node.test)
    elif isinstance(shown, ast.BoolOp):
        shown.op = ast.And() if isinstance(node, ast.Or) else ast.Or()
    elif isinstance(shown, ast.Compare):
        shown.ops[0] = OTHERS[type(node)]()


def tests_of(path: Path, folder: str) -> list[str]:
    """Return the files that test a module: those that name it first, then all of its room's."""
    files = sorted((ROOT / folder).rglob("test_*.py"))
    files.sort(key=lambda each: not names(each, path))
    return [str(each.relative_to(ROOT)) for each in files]


def names(test: Path, path: Path) -> bool:
    """Return whether a test imports a module."""
    return ".".join(path.with_suffix("").parts) in test.read_text(encoding="utf-8")


def survives(mutant: Mutant, tree: Path, tests: Sequence[str]) -> bool:
    """Return whether no test sees a change in a copy of the tree."""
    changed = tree / mutant.path
    kept = changed.read_text(encoding="utf-8")
    changed.write_text(mutant.text, encoding="utf-8")
    words = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-m", "not long", "-p", "no:cacheprovider", *tests]
    try:
        done = subprocess.run(
            words,
            cwd=tree,
            env={**os.environ, "PYTHONPATH": str(tree)},
            capture_output=True,
            timeout=LONGEST_S,
            check=False,
        )
        return done.returncode == 0
    except subprocess.TimeoutExpired:
        return False
    finally:
        changed.write_text(kept, encoding="utf-8")


def main() -> int:
    """Print each change with what became of it; exit status 1 where one survives."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", default=list(ROOMS), help="folders or files of these rooms")
    parser.add_argument("--number", type=int, default=20, help="how many are drawn; 0: all (20)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--named",
        action="store_true",
        help="by the tests alone that name the module, of one that none names by all: a minute each",
    )
    arguments = parser.parse_args()
    paths = [path.relative_to(ROOT) for each in arguments.folders for path in _files(ROOT / each)]
    every = [mutant for path in paths for mutant in mutants(path)]
    drawn = every if not arguments.number else random.Random(arguments.seed).sample(every, arguments.number)
    left = 0
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(".*", "__pycache__", "build", "dist", "docs"))
        for each in drawn:
            room = next(tests for room, tests in ROOMS.items() if each.path.is_relative_to(room))
            tests = tests_of(each.path, room)
            if arguments.named:
                tests = [test for test in tests if names(ROOT / test, each.path)] or tests
            alive = survives(each, tree, tests)
            left += alive
            print(
                f"{'SURVIVES' if alive else 'seen    '} {each.path}:{each.line}: {each.before}  ->  {each.after}",
                flush=True,
            )
    print(f"{len(every)} changes, {len(drawn)} tried, {left} survive")
    return int(left > 0)


def _files(path: Path) -> list[Path]:
    return sorted(path.rglob("*.py")) if path.is_dir() else [path]


if __name__ == "__main__":
    sys.exit(main())
