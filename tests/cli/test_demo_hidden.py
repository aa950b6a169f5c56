"""What the act with a hidden effect calls a success; the act itself takes a minute and is run by hand (docs/law.md)."""

import pytest

from positioner.cli.parts.hidden_demo import HiddenOutcome


@pytest.mark.parametrize(
    ("before", "after", "found", "said"),
    [
        ([0.02, -0.01], [1e-4, -1e-4], ("position_friction",), None),
        ([2e-3, -2e-3], [9e-4, -9e-4], ("position_friction",), "fell from 0.200 to 0.090"),
        ([0.02, -0.01], [2e-3, -2e-3], ("position_friction",), "0.200 % of stroke is left"),
        ([0.02, -0.01], [1e-4, -1e-4], ("preload",), "found preload, hidden was position_friction"),
        ([0.02, -0.01], [float("nan")] * 2, (), "found nothing"),
    ],
)
def test_what_does_not_hold_is_a_problem(
    before: list[float], after: list[float], found: tuple[str, ...], said: str | None
) -> None:
    problems = "; ".join(HiddenOutcome(before, after, found).problems)
    assert said in problems if said else not problems
