"""Progress: one moving line on a terminal, few lines in a log."""

import io
import math
import os
import threading

import pytest

from positioner.cli.demo import format_step
from positioner.cli.parts.passing_line import passing
from positioner.cli.parts.progress import SELDOM_S, Progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def told(stream: io.StringIO, *times_s: float) -> str:
    """Return what is printed when a tenth more is done at each of these times."""
    clock = iter((0.0, *times_s))
    progress = Progress(stream, lambda: next(clock))
    for i in range(len(times_s)):
        progress("fitting", (i + 1) / 10)
    return stream.getvalue()


def test_a_terminal_has_one_line_written_over() -> None:
    said = told(Terminal(), *map(float, range(10)))
    assert said.count("\r") == 10
    assert said.count("\n") == 1
    assert said.endswith("100%\n")


@pytest.mark.parametrize("columns", [80, 40])
def test_a_line_that_passes_is_no_longer_than_the_terminal_is_wide(
    columns: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The demo's had 88 columns: on a terminal of 80 each left a row behind, some 500 of them."""
    monkeypatch.setattr("os.get_terminal_size", lambda _: os.terminal_size((columns, 24)))
    shown = Terminal()
    shown.fileno = lambda: 1  # type: ignore[method-assign]
    for what in (step_shown(), "x" * 200):
        said = passing(what, shown)
        assert len(said.removeprefix("\r\033[K")) == min(len(what), columns - 1)


def test_what_the_demo_shows_of_a_step_has_room_in_eighty_columns() -> None:
    assert len(step_shown()) < 80
    assert step_shown().endswith("] 0.000 S3 100.0 kPa")


def test_a_stem_that_nobody_measures_is_shown_as_none() -> None:
    now = {"position": math.nan, "reference_in_force": math.nan, "state": 0.0, "command": 0.0}
    assert format_step("S0", now).endswith(f"[{'.' * 20}] nan S0   0.0 kPa")


def step_shown() -> str:
    now = {"position": -1e-9, "reference_in_force": 1.0, "state": 3.0, "command": 1e5}
    return format_step("identified anew: step to 0.65 p.u.", now)


def test_a_log_has_few_lines() -> None:
    assert told(io.StringIO(), 1.0, SELDOM_S, SELDOM_S + 1.0, 2 * SELDOM_S) == "fitting: 20%\nfitting: 40%\n"


def test_what_is_soon_done_leaves_no_line() -> None:
    assert told(io.StringIO(), 1.0, 2.0) == ""


def beaten(stream: io.StringIO, *times_s: float) -> str:
    """Return what is printed when half is done at the first of these times, and nothing more at the others."""
    clock = iter((0.0, *times_s))
    progress = Progress(stream, lambda: next(clock))
    for i in range(len(times_s)):
        if i:
            progress.beat()
        else:
            progress("fitting", 0.5)
    return stream.getvalue()


def test_a_log_is_told_that_long_work_goes_on() -> None:
    said = beaten(io.StringIO(), 1.0, 2.0, SELDOM_S, SELDOM_S + 1.0, 2.0 * SELDOM_S)
    assert said == "fitting: 50%, 20 s so far\nfitting: 50%, 40 s so far\n"


def test_a_terminal_shows_the_seconds_go_by() -> None:
    clock = iter((0.0, 1.0, 2.0))
    stream = Terminal()
    progress = Progress(stream, lambda: next(clock))
    progress("fitting", 0.5)
    progress.beat()
    progress.beat()
    assert stream.getvalue().count("\r") == 3
    assert stream.getvalue().endswith("50%, 2 s so far")


def test_beats_end_with_the_work() -> None:
    with Progress(io.StringIO()) as progress:
        assert any(each.name == "progress" for each in threading.enumerate())
        progress("fitting", 0.5)
    assert not any(each.name == "progress" for each in threading.enumerate())


def test_work_without_fractions_says_what_it_is_and_for_how_long() -> None:
    clock = iter((0.0, 2.0))
    stream = Terminal()
    progress = Progress(stream, lambda: next(clock), "reading rec.csv")
    progress.beat()
    assert stream.getvalue() == "\r\033[Kreading rec.csv, 2 s so far"
    assert progress.known == "so far reading rec.csv; nothing was written"
