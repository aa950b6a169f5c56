"""Counts what makes pages and code hard to read: `python -m docs.words`. Each count may only fall.

    long sentences      of more than 25 words, in README, CONTRIBUTING and docs/
    words over 40 000   in the same pages: those with a letter or a digit, so a table's bars are none
    bare constants      numbers of a module without a docstring below, a comment beside, or a unit in the name
    doubtful names      names of such numbers that mean another value in another module: a noun is missing
    participles         functions and methods named by a participle (`begun`, `carried`): a verb and its object say more

`docs/words.json` has what is left; it is held against that, and `--store` writes it anew where a count fell. `--list`
prints each find with its place.
"""

import ast
import json
import re
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from docs.long_sentences import PAGES, long_sentences

ROOT = Path(__file__).parents[1]
FLOORS = ("config", "signals", "webpage", "fieldbus", "drivers", "sim", "positioner", "northbound", "workbench")
STORED = Path(__file__).with_name("words.json")
UNITS = re.compile(
    r"_(S|MS|US|NS|M|MM|UM|PA|KPA|BAR|N|HZ|PCT|PERCENT|DEG|MB|BYTES|BITS|WORDS|PX|BAUD|DAYS|PER_\w+|M_PER_S)$"
)
IRREGULAR = frozenset(
    (
        *("begun", "borne", "bound", "broken", "brought", "built", "chosen", "come", "done", "drawn", "driven", "fed"),
        *("felt", "given", "gone", "grown", "held", "kept", "known", "laid", "led", "lost", "made", "meant", "met"),
        *("risen", "said", "seen", "sent", "shown", "stuck", "sunk", "taken", "thought", "told", "torn", "written"),
    )
)
MOST_WORDS = 40_000
"""Of all pages: what an engineer reads in three hours."""
NOUNS = frozenset(("embed", "shed", "need"))
"""End like a participle and are none."""


def number_of(value: ast.expr) -> str | None:
    """Return the text of a number, or of several, and nothing for what is none."""
    items = value.elts if isinstance(value, ast.Tuple) else [value]
    bare = [each.operand if isinstance(each, ast.UnaryOp) else each for each in items]
    if all(isinstance(each, ast.Constant) and type(each.value) in (int, float) for each in bare):
        return ast.unparse(value)
    return None


def constants(path: Path) -> Iterator[tuple[str, str, int, bool]]:
    """Yield name, value and line of each number of a module, and whether it is explained."""
    lines = path.read_text(encoding="utf-8").splitlines()
    body = ast.parse("\n".join(lines)).body
    for at, each in enumerate(body):
        if not isinstance(each, ast.Assign | ast.AnnAssign) or each.value is None:
            continue
        target = each.targets[0] if isinstance(each, ast.Assign) else each.target
        names = [name.id for name in ast.walk(target) if isinstance(name, ast.Name)]
        value = number_of(each.value)
        if value is None or not all(re.fullmatch(r"[A-Z][A-Z0-9_]*", name) for name in names):
            continue
        after = body[at + 1] if at + 1 < len(body) else None
        told = (
            isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) and isinstance(after.value.value, str)
        )
        beside = "#" in lines[(each.end_lineno or each.lineno) - 1]
        parts = value.strip("()").split(", ") if len(names) > 1 else [value]
        for name, part in zip(names, parts, strict=True):
            yield name, part, each.lineno, told or beside or UNITS.search(name) is not None


def participles(path: Path) -> Iterator[tuple[str, int]]:
    """Yield name and line of each function of a module that is named by a participle; properties are nouns."""
    for each in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        if any("property" in ast.unparse(decorator) for decorator in each.decorator_list):
            continue
        first = each.name.strip("_").partition("_")[0]
        if first not in NOUNS and (first in IRREGULAR or re.search(r"[^e]ed$", first)):
            yield each.name, each.lineno


def finds() -> dict[str, list[str]]:
    """Return each find with its place, by what it is."""
    found: dict[str, list[str]] = {"long sentences": [f"{page}: {text}" for page, text in long_sentences()]}
    bare, named = [], []
    values: defaultdict[str, defaultdict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
    for path in sorted(path for room in FLOORS for path in (ROOT / room).rglob("*.py")):
        where = path.relative_to(ROOT).as_posix()
        for name, value, line, explained in constants(path):
            values[name][value].append(where)
            if not explained:
                bare.append(f"{where}:{line}: {name} = {value}")
        named += [f"{where}:{line}: {name}" for name, line in participles(path)]
    doubtful = [f"{name}: {dict(by_value)}" for name, by_value in sorted(values.items()) if len(by_value) > 1]
    return {**found, "bare constants": bare, "doubtful names": doubtful, "participles": named}


def words_too_many() -> int:
    """Return by how much the words of the pages are more than are read."""
    count = sum(bool(re.search(r"\w", each)) for page in PAGES for each in page.read_text(encoding="utf-8").split())
    return max(0, count - MOST_WORDS)


def main() -> int:
    """Print the counts; exit status 1 where one has grown."""
    found = finds()
    if "--list" in sys.argv[1:]:
        print("\n".join(f"{what}: {each}" for what, several in found.items() for each in several))
    counts = {what: len(several) for what, several in found.items()} | {"words over 40 000": words_too_many()}
    stored: dict[str, int] = json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else counts
    for what, count in counts.items():
        said = "" if count == stored[what] else f", {stored[what]} were there"
        print(f"{count} {what}{said}")
    if "--store" in sys.argv[1:]:
        STORED.write_text(json.dumps(counts, indent=2) + "\n", encoding="utf-8")
        return 0
    grown = [what for what, count in counts.items() if count > stored[what]]
    if grown:
        print(f"more {', '.join(grown)}: mend what is new (python -m docs.words --list)")
    return int(bool(grown))


if __name__ == "__main__":
    sys.exit(main())
