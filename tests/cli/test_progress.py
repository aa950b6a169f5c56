"""Progress: one moving line on a terminal, few lines in a log."""

import io

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


def test_a_log_has_few_lines() -> None:
    assert told(io.StringIO(), 1.0, SELDOM_S, SELDOM_S + 1.0, 2 * SELDOM_S) == "fitting: 20%\nfitting: 40%\n"


def test_what_is_soon_done_leaves_no_line() -> None:
    assert told(io.StringIO(), 1.0, 2.0) == ""
