"""The workbench page measured in Debian's Chromium: start-up, memory, a slider's curve, and half a million samples.

python -m benchmarks.workbench_page [--minutes 10]

Of a slider's curve also the processor time that server and browser take for it, which tells of the page where other
programs are busy besides. With `--minutes` the page is used for so long in place of the rest: drags, and loaded anew.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from playwright.sync_api import Page, sync_playwright

from benchmarks.operator_page import cpu
from config.recording import Recording
from workbench.blind.hiding import hide
from workbench.blind.sealing import seal
from workbench.blind.trial import NOISE_M

SEED = 7
PERIOD_S = 0.01
SLIDER_S, LONG_SAMPLES = 60.0, 500_000
MOVES = 30
LOOKS = 10
"""At the server's memory, while it is used for long."""
THINKS_S = 30.0
"""Who uses it for long looks at what came before going on."""
LONGEST_MS = 600_000
TIME_PLOT = "position, error and pressure over time"
WATCHED = """name => {
    const plot = document.querySelector(`[data-testid="${name}"]`);
    window.tookMs = undefined;
    let begin = performance.now();
    addEventListener("mousemove", () => { begin = performance.now(); }, {capture: true, once: true});
    const drawn = () => { window.tookMs ??= performance.now() - begin; };
    for (const event of ["plotly_afterplot", "plotly_animated"]) plot.once(event, drawn);
}"""
"""Milliseconds from a move of the mouse, or from now, until the lines that come from the server are drawn."""
TOOK = "() => window.tookMs"
PANNED = """([name, begin, end]) => document.querySelector(`[data-testid="${name}"]`).emit(
    "plotly_relayout", {"xaxis.range[0]": begin, "xaxis.range[1]": end})"""


def main(minutes: float | None) -> None:
    """Print the figures."""
    with tempfile.TemporaryDirectory() as folder:
        seal(Path(folder, "case"), hide(SEED, duration_s=SLIDER_S, period_s=PERIOD_S))
        if minutes is not None:
            files = [str(Path(folder, "case", name)) for name in ("fit.csv", "valve.toml")]
            with served(files[0], "--valve", files[1]) as (address, process, _), page_at(address) as page:
                _used_for_long(page, process, minutes)
            return
        case = Path(folder, "case", "fit.csv")
        valve = str(Path(folder, "case", "valve.toml"))
        with served(str(case), "--valve", valve) as (address, process, started_s):
            print(f"start-up: {started_s:.1f} s until the address is printed")
            print(f"server alone: {_resident_mb(process):.0f} MB")
            with page_at(address) as page:
                print(f"first visit: {_first_visit_s(page):.1f} s until the curves stand")
                _drag_is_told(page, process)
                print(f"server with one tab: {_resident_mb(process):.0f} MB")
        long = Path(folder, "long.csv")
        _repeated(Recording.read(case), LONG_SAMPLES).write(long)
        with served(str(long), "--valve", valve) as (address, process, _), page_at(address) as page:
            print(f"{LONG_SAMPLES} samples, first visit: {_first_visit_s(page):.1f} s")
            whole_s = LONG_SAMPLES * PERIOD_S
            windows = [[0.1 * whole_s + 5.0 * i, 0.1 * whole_s + 5.0 * i + 60.0] for i in range(MOVES)]
            panned = [_panned_ms(page, *each) for each in windows]
            print(f"{LONG_SAMPLES} samples, panned: {_told(panned)}")
            print(f"server: {_resident_mb(process):.0f} MB")


def _moved_ms(page: Page, off_px: int = 0) -> Iterator[float]:
    """Drag a slider, step by step."""
    slider = page.get_by_role("slider", name="spring stiffness")
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    assert box is not None
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(*middle)
    page.mouse.down()
    for i in range(MOVES):
        page.evaluate(WATCHED, TIME_PLOT)
        page.mouse.move(middle[0] + 2 * i + 2 + off_px, middle[1])
        yield float(page.wait_for_function(TOOK).json_value())
    page.mouse.up()


def _drag_is_told(page: Page, process: "subprocess.Popen[str]") -> None:
    """Print how soon a curve follows, and the processor time that it takes."""
    list(_moved_ms(page))  # the first takes what is done once
    client = page.context.new_cdp_session(page)
    client.send("Performance.enable", {"timeDomain": "threadTicks"})

    def spent_s() -> tuple[float, float]:
        measured = {each["name"]: each["value"] for each in client.send("Performance.getMetrics")["metrics"]}
        return cpu(process.pid), float(measured["TaskDuration"])

    before_s = spent_s()
    moves = list(_moved_ms(page, 1))
    server_ms, page_ms = (1e3 * (late - early) / MOVES for early, late in zip(before_s, spent_s(), strict=True))
    print(f"slider to curve, {SLIDER_S:g} s at {1 / PERIOD_S:g} Hz: {_told(moves)}, load {os.getloadavg()[0]:.0f}")
    print(f"processor time of a move: server {server_ms:.0f} ms, the page's thread {page_ms:.0f} ms", flush=True)


def _used_for_long(page: Page, process: "subprocess.Popen[str]", minutes: float) -> None:
    """Print what the server takes as one works on: a slider dragged, the page loaded again, over and over."""
    _first_visit_s(page)
    drags = reloads = 0
    seen_mb = []
    begin_s = time.monotonic()
    for look in range(1, LOOKS + 1):
        while time.monotonic() - begin_s < 60.0 * minutes * look / LOOKS:
            for _ in _moved_ms(page, reloads % 2):
                drags += 1
            page.reload()
            _first_visit_s(page)
            reloads += 1
            time.sleep(THINKS_S)
        seen_mb.append(_resident_mb(process))
        print(
            f"{drags} moves, {reloads} visits: server {seen_mb[-1]:.0f} MB, load {os.getloadavg()[0]:.0f}", flush=True
        )
    grown = seen_mb[-1] - seen_mb[LOOKS // 2 - 1]
    print(f"grown in the second half of {minutes:g} min: {grown:+.1f} MB")


def _panned_ms(page: Page, begin_s: float, end_s: float) -> float:
    page.evaluate(WATCHED, TIME_PLOT)
    page.evaluate(PANNED, [TIME_PLOT, begin_s, end_s])
    return float(page.wait_for_function(TOOK).json_value())


def _repeated(recording: Recording, count: int) -> Recording:
    times = -(-count // len(recording))
    columns = {name: np.tile(column, times)[:count] for name, column in recording.columns.items()}
    # Of noise that repeats itself to the digit nobody would say that it is any.
    columns["position_m"] += np.random.default_rng(SEED).normal(0.0, NOISE_M, count)
    return Recording(columns | {"time_s": PERIOD_S * np.arange(count, dtype=np.float64)}, recording.metadata)


@contextmanager
def served(*words: str) -> Iterator[tuple[str, "subprocess.Popen[str]", float]]:
    """Run the command, and give its address, its process, and how long the address took, s."""
    begin_s = time.monotonic()
    command = [sys.executable, "-m", "positioner.cli", "workbench", *words, "--no-open", "--listen-port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        try:
            yield line.partition(": ")[2].strip(), process, time.monotonic() - begin_s
        finally:
            process.terminate()


@contextmanager
def page_at(address: str) -> Iterator[Page]:
    """Open an address in a browser of its own."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.set_default_timeout(LONGEST_MS)
        page.goto(address)
        yield page
        browser.close()


def _first_visit_s(page: Page) -> float:
    begin_s = time.monotonic()
    page.locator(".scatterlayer .trace").first.wait_for()
    return time.monotonic() - begin_s


def _resident_mb(process: "subprocess.Popen[Any]") -> float:
    for line in Path(f"/proc/{process.pid}/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return float(line.split()[1]) / 1024.0
    raise LookupError(process.pid)


def _told(milliseconds: list[float]) -> str:
    return f"median {median(milliseconds):.0f} ms, most {max(milliseconds):.0f} ms"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, help="use one page for so long, and print the server's memory")
    main(parser.parse_args().minutes)
