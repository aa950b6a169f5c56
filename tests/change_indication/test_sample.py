"""A sample of what the workbench is known to say: the quickest kept case of few slips in which an effect is named.

`make moved` runs all of them anew, and prints what moved.
"""

import pytest

from benchmarks.blind import KEPT, changes, is_richer, line
from benchmarks.kept_lines import Line, kept


def quickest(family: str) -> Line:
    named = [each for each in kept(KEPT) if each["family"] == family and each["verdict"] == "missing"]
    return min(named, key=lambda each: float(each["cpu_seconds"]))


def test_a_kept_case_is_said_as_it_was() -> None:
    before = quickest("few_slips")
    assert changes(before, line("few_slips", before["seed"])) == []


@pytest.mark.parametrize(
    ("hidden", "missing", "verdict", "richer"),
    [
        pytest.param("pressure_friction", ["pressure_power_friction"], "missing", True, id="comes after it"),
        pytest.param("pressure_power_friction", ["pressure_friction"], "missing", False, id="comes before it"),
        pytest.param("pressure_friction", ["pressure_power_friction", "preload"], "missing", False, id="and another"),
        pytest.param("pressure_friction", ["pressure_power_friction"], "unexplained", False, id="not as all there is"),
        pytest.param("pressure_friction", [], "adequate", False, id="nothing"),
    ],
)
def test_a_richer_form_of_what_is_hidden_is_no_other_cause(
    hidden: str, missing: list[str], verdict: str, richer: bool
) -> None:
    assert is_richer({"hidden": [hidden], "missing": missing, "verdict": verdict}) == richer


def test_what_moved_is_said() -> None:
    before = quickest("clean")
    name, (value, lower, upper) = next(iter(before["parameters"].items()))
    moved = {**before, "verdict": "adequate", "parameters": {**before["parameters"], name: [upper, lower, upper]}}
    said = changes(before, moved)
    assert [each.split()[0] for each in said] == ["verdict", *([name] if upper > value else [])]
