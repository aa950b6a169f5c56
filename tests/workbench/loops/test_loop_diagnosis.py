"""Drawn loops with truth, by equations that are not the product's (`workbench.bench.drawn_loops`)."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from workbench.bench import drawn_loops
from workbench.bench.drawn_loops import DrawnLoop
from workbench.loops import LoopDiagnosis, LoopRecord, diagnose_loop
from workbench.loops.causes import Size, of_output_backwards
from workbench.loops.loop_diagnosis import output_alone

draw_loop = cache(drawn_loops.draw_loop)


def record_of(loop: DrawnLoop) -> LoopRecord:
    return LoopRecord.of_samples("FIC1", loop.time_s, loop.op_pct, loop.pv, loop.sp)


@cache
def diagnosed(seed: int, cause: str) -> tuple[DrawnLoop, LoopDiagnosis]:
    loop = draw_loop(seed, cause)
    return loop, diagnose_loop(record_of(loop))


@pytest.mark.parametrize("seed", [10, 7245], ids=["one lag", "an integrator and a second lag"])
def test_a_sticking_valve_is_called_so_and_how_much(seed: int) -> None:
    loop, found = diagnosed(seed, "sticks")
    assert found.verdict == "sticks"
    assert found.causes is not None
    assert found.causes.friction is not None
    friction = found.causes.friction
    assert friction.size.low_pct < loop.truth.stiction_pct < friction.size.high_pct
    assert friction.size.stiction_pct == pytest.approx(loop.truth.stiction_pct, rel=0.2)


def test_where_the_likelihood_leaves_more_than_a_fifth_open_the_interval_alone_is_said() -> None:
    found = diagnosed(10, "sticks")[1]
    assert found.causes is not None
    for high, told in ((5.9, True), (6.1, False)):
        size = Size.of(5.0, 4.6, high)
        open_one = replace(found, causes=replace(found.causes, friction=replace(found.causes.friction, size=size)))
        assert size.told == told
        assert ("apparent stiction 5 (" in open_one.sentence) == told
        assert ("slip jump" in open_one.sentence) == told
        assert (open_one.as_json()["stiction_pct"] == 5.0) == told


def test_what_to_do_is_said_with_settings_and_what_they_bring() -> None:
    found = diagnosed(10, "sticks")[1]
    best = min(found.remedies[1:], key=lambda each: each.error_ratio or 9.0)
    assert f"until then {best.name}, {best.settings}: error {best.error_ratio:.2f}" in found.advice
    assert "no settings" in replace(found, remedies=()).advice
    assert replace(found, verdict="something else").advice == ""


@pytest.mark.parametrize("cause", ["tight tuning", "external sine", "external noise", "nonlinear process"])
def test_another_cause_is_not_called_sticking(cause: str) -> None:
    assert diagnosed(7, cause)[1].verdict != "sticks"


def test_the_output_alone_tells_a_stem_that_rests_from_a_disturbance() -> None:
    told = {cause: diagnosed(seed, cause)[1].evidence for seed, cause in ((10, "sticks"), (7, "external noise"))}
    assert told["sticks"].output.nats > 10.0
    assert told["external noise"].output.nats < 1.0


def test_a_law_read_backwards_tells_friction_from_a_swing_that_the_output_alone_leaves_open() -> None:
    for seed, cause, low, high in ((10, "sticks", 10.0, np.inf), (7, "tight tuning", -np.inf, -3.0)):
        loop, found = diagnosed(seed, cause)
        for sign in (1.0, -1.0):
            record = replace(record_of(loop), op_pct=50.0 + sign * loop.op_pct)
            assert low < output_alone(record, found.oscillation, of_output_backwards).nats < high


def test_what_the_loops_own_output_says_does_not_hang_on_the_process_value() -> None:
    loop, found = diagnosed(10, "sticks")
    still = replace(record_of(loop), pv=np.full(loop.pv.size, 3.0))
    assert diagnose_loop(still).evidence.output == found.evidence.output


@pytest.mark.parametrize(
    ("code", "broken"),
    [
        ("manual", lambda r: replace(r, op_pct=np.full(r.op_pct.size, 40.0))),
        ("manual", lambda r: replace(r, automatic=np.arange(r.pv.size) > r.pv.size // 2)),
        ("saturated", lambda r: replace(r, op_pct=np.clip(50.0 + 40.0 * (r.op_pct - r.op_pct.mean()), 0.0, 100.0))),
        ("rounded", lambda r: replace(r, pv=np.round((r.pv - r.pv.min()) / np.ptp(r.pv) * 5.0))),
        ("short", lambda r: replace(r, op_pct=r.op_pct[:80], pv=r.pv[:80], sp=None)),
        ("one way", lambda r: replace(r, op_pct=np.linspace(20.0, 60.0, r.pv.size) + 0.1 * r.op_pct)),
        ("missing", lambda r: replace(r, missing=0.2)),
        ("slow", lambda r: replace(r, op_pct=40.0 + 5.0 * np.sin(np.arange(r.pv.size)))),
    ],
)
def test_what_a_record_cannot_tell_is_said_and_what_to_record_instead(code, broken) -> None:  # type: ignore[no-untyped-def]
    found = diagnose_loop(broken(record_of(draw_loop(10, "sticks"))))
    assert found.verdict == "cannot be told"
    assert code in [each.code for each in found.gates]
    assert all(each.instead for each in found.gates)
    assert "insufficient" in found.sentence


@pytest.mark.parametrize("deviations", [1.0, 1.5, 3.0])
def test_noise_of_the_output_is_not_said_to_be_a_cycle(deviations: float) -> None:
    record = record_of(draw_loop(10, "sticks"))
    noise = deviations * record.op_pct.std() * np.random.default_rng(0).standard_normal(record.pv.size)
    (gate,) = diagnose_loop(replace(record, op_pct=record.op_pct + noise)).gates
    assert gate.code == "slow"
    assert "as noise does" in gate.says
    assert "filter" in gate.instead


def test_lines_that_a_historian_drew_are_seen() -> None:
    record = record_of(draw_loop(10, "sticks"))
    rows = np.arange(record.pv.size)
    drawn = replace(record, pv=np.interp(rows, rows[::12], record.pv[::12]))
    assert "compressed" in [each.code for each in diagnose_loop(drawn).gates]


def turned_pv(record: LoopRecord) -> LoopRecord:
    assert record.sp is not None
    return replace(record, pv=500.0 - 7.0 * record.pv, sp=500.0 - 7.0 * record.sp)


def turned_op(record: LoopRecord) -> LoopRecord:
    return replace(record, op_pct=100.0 - record.op_pct)


@pytest.mark.parametrize("turned", [turned_pv, turned_op], ids=["process falls with OP", "OP in % of closing"])
def test_reversed_action_is_said_and_changes_nothing_else(turned: Callable[[LoopRecord], LoopRecord]) -> None:
    loop, found = diagnosed(10, "sticks")
    again = diagnose_loop(turned(record_of(loop)))
    assert (found.law.action, again.law.action) == (1, -1)
    assert "reverse acting" in found.summary()
    assert "direct acting" in again.summary()
    assert found.probability == pytest.approx(again.probability, rel=1e-3)
    assert found.causes is not None
    assert again.causes is not None
    assert again.causes.friction.size.stiction_pct == pytest.approx(found.causes.friction.size.stiction_pct, rel=1e-3)
    assert np.sign(again.causes.gain) == -np.sign(found.causes.gain)


@pytest.mark.parametrize("seed", [10, 16])
def test_the_sign_of_feedback_is_known_where_the_law_shows_and_never_guessed(seed: int) -> None:
    """An output that does not hang on the control error has no action; both signs are tried, and that is said."""
    record = record_of(draw_loop(seed, "sticks"))
    elsewhere = replace(record, op_pct=record_of(draw_loop(seed + 1, "external noise")).op_pct[: record.pv.size])
    short = replace(elsewhere, pv=record.pv[: elsewhere.op_pct.size], sp=None)
    found = diagnose_loop(short)
    assert found.law.action == 0
    assert "its action does not show" in found.summary()


def test_of_two_tags_of_different_rates_only_that_is_said() -> None:
    loop = draw_loop(10, "sticks")
    seldom = np.where(np.arange(loop.pv.size) % 4 == 0, loop.op_pct, np.nan)
    found = diagnose_loop(LoopRecord.of_samples("FIC1", loop.time_s, seldom, loop.pv, loop.sp))
    assert [each.code for each in found.gates] == ["missing"]


def test_of_a_record_with_a_gap_the_longest_stretch_is_taken_and_said() -> None:
    loop = draw_loop(10, "sticks")
    kept = np.abs(np.arange(loop.pv.size) - 800) > 25
    record = LoopRecord.of_samples("FIC1", loop.time_s[kept], loop.op_pct[kept], loop.pv[kept], loop.sp[kept])
    assert record.pv.size == loop.pv.size - 826
    assert record.time_s == pytest.approx(826 * loop.truth.period_s)
    assert "a gap" in record.notes[0]
