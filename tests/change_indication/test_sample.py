"""A sample of what the workbench is known to say: the quickest kept case of few slips in which an effect is named.

`make moved` runs all of them anew, and prints what moved.
"""

from benchmarks.blind import KEPT, changes, line
from benchmarks.kept_lines import Line, kept


def quickest(family: str) -> Line:
    named = [each for each in kept(KEPT) if each["family"] == family and each["verdict"] == "missing"]
    return min(named, key=lambda each: float(each["cpu_seconds"]))


def test_a_kept_case_is_said_as_it_was() -> None:
    before = quickest("few_slips")
    assert changes(before, line("few_slips", before["seed"])) == []


def test_what_moved_is_said() -> None:
    before = quickest("clean")
    name, (value, lower, upper) = next(iter(before["parameters"].items()))
    moved = {**before, "verdict": "adequate", "parameters": {**before["parameters"], name: [upper, lower, upper]}}
    said = changes(before, moved)
    assert [each.split()[0] for each in said] == ["verdict", *([name] if upper > value else [])]
