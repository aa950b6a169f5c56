"""An extended valve that is not the daemon's is told from it; `[law]` says one thing."""

from dataclasses import replace

import pytest

from config.daemon_file import DaemonFile
from config.extended_valve import ExtendedValve, Inverse

L, SLOPE, F_C, F_S = 0.1, 8e5, 2e4, 2.5e4
GRID = tuple(L * i / 10 for i in range(11))


def valve(inverse: Inverse = Inverse()) -> ExtendedValve:  # noqa: B008 - a tuple
    return ExtendedValve(
        name="v",
        stroke_m=L,
        up_pa=tuple(SLOPE * x + F_C for x in GRID),
        down_pa=tuple(SLOPE * x - F_C for x in GRID),
        breakaway_up_pa=tuple(SLOPE * x + F_S for x in GRID),
        breakaway_down_pa=tuple(SLOPE * x - F_S for x in GRID),
        indicated_m=GRID,
        inverse=inverse,
    )


@pytest.mark.parametrize("x", [-0.01, 0.0, 0.033, 0.1, 0.12])
def test_it_is_straight_between_its_points_and_beyond(x: float) -> None:
    for s in (1, -1):
        assert valve().landing_pa(x, s) == pytest.approx(SLOPE * x + s * F_C)
        assert valve().margin_m(x, s) == pytest.approx((F_S - F_C) / SLOPE)


def test_play_parts_the_stem_from_what_is_indicated() -> None:
    loose = valve(Inverse(play_m=1e-3))
    assert [loose.stem_m(0.05, s) for s in (1, 0, -1)] == pytest.approx([0.0505, 0.05, 0.0495])


@pytest.mark.parametrize(
    ("stroke_m", "maximum_pa", "breakaway_pa", "said"),
    [
        (0.1, 4e5, None, None),
        (0.1, 4e5, 2.4e4, None),
        (0.05, 4e5, None, "stroke_m is 0.1 m, the daemon's [valve] has 0.05 m"),
        (0.1, 4e5, 9e4, "F_s/A is 25000 Pa, the daemon's [valve] has breakaway_pa = 90000: another area?"),
        (
            0.1,
            3e4,
            None,
            "it takes 40000 Pa to the middle of its travel, [pressure] allows 0 to 30000 Pa: another area?",
        ),
    ],
)
def test_another_valve_is_refused(
    stroke_m: float, maximum_pa: float, breakaway_pa: float | None, said: str | None
) -> None:
    assert valve().unlike(stroke_m, 0.0, maximum_pa, breakaway_pa) == said


@pytest.mark.parametrize(
    ("inverse", "said"),
    [
        (Inverse(), None),
        (Inverse(most_pa=5e4, lowest_m=0.02, play_m=1e-3, quantum_m=1e-3), None),
        (Inverse(most_pa=1e3), "it takes 40000 Pa to the middle of its travel, its supply gives -inf to 1000 Pa"),
        (Inverse(highest_m=0.04), "the middle of its travel is at 0.05 m, its stops at 0 and 0.04 m"),
        (
            Inverse(lowest_m=0.06, highest_m=0.0601),
            "the middle of its travel is at 0.05 m, its stops at 0.06 and 0.0601 m",
        ),
        (Inverse(play_m=0.5), "what is indicated has a play of 0.5 m, more than half of its travel"),
        (Inverse(quantum_m=1.0), "what is indicated has a quantum of 1 m, more than half of its travel"),
    ],
)
def test_a_valve_that_does_not_get_to_its_middle_or_is_not_seen_there_is_refused(
    inverse: Inverse, said: str | None
) -> None:
    assert valve(inverse).unlike(L, 0.0, 4e5) == said


def test_an_indication_beside_the_travel_is_refused() -> None:
    off = replace(valve(), indicated_m=tuple(x + 10.0 for x in GRID))
    assert off.unlike(L, 0.0, 4e5) == "the middle of its travel, 0.05 m, is indicated at 10.05 m"


def test_its_stops_are_those_of_the_effects_within_the_stroke() -> None:
    assert valve().stops_m == (0.0, L)
    bowed = replace(valve(Inverse(lowest_m=-100.0, highest_m=0.08)), indicated_m=tuple(x + 0.001 for x in GRID))
    assert bowed.stops_m == (0.0, 0.08)
    assert bowed.stops_indicated_m == pytest.approx((0.001, 0.081))


@pytest.mark.parametrize(
    ("law", "said"),
    [
        ({"valve": "better.toml", "k_over_c_pa": -2e4}, "valve is given, so k_over_c_pa must not be"),
        ({"k_over_c_pa": -2e4}, "b_over_c_pa_per_m is required and missing, unless valve is given"),
        ({}, "b_over_c_pa_per_m is required and missing, unless valve is given"),
    ],
)
def test_the_law_has_one_source(law: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        DaemonFile.model_validate({"valve": {"stroke_m": 0.1}, "law": law})
