"""The drawings of the documents, made anew: `python -m docs.drawings FOLDER`.

architecture.png    the rooms on their floors, and where they meet: on the wire
stick_slip.png      a small step of a sticking stem in virtual time, with the states of the law of slides
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from config.codes import Mode
from config.daemon_file import DaemonFile
from config.loading import validate
from config.slave_file import SlaveFile
from config.valve_file import load_valve, shipped_valve
from drivers.in_memory import MemoryDriver
from positioner.control.controller import first_memory, step
from positioner.control.laws.slides.slide_law import SlideLaw
from positioner.control.requests import QUIET, Requests
from positioner.control.settings import Settings
from positioner.daemon.link import Link, LinkSettings
from positioner.daemon.pacing import DevicePace
from sim.slave.slave import device_of

PERIOD_S = 0.02
IDENTIFIED_WITHIN_S = 400.0
SETTLED_S, LEAD_S, SHOWN_S = 5.0, 0.1, 0.5
"""Until the first reference stands; before the second, and after it, as is drawn."""
REFERENCES = (0.5, 0.51)
"""Openings, p.u., one after the other."""
NOISE_M = 1e-5
INK, GREY = "#222222", "#888888"
COLOURS = {"Idle": "#e8e8e8", "Out": "#fdae6b", "Sliding": "#a1d99b"}


@dataclass(frozen=True, slots=True)
class Row:
    """A sample of the run: time, s, opening and reference, p.u., pressure, Pa, and the name of the law's state."""

    time_s: float
    opening: float
    reference: float
    command_pa: float
    state: str


def stick_slip(figure_file: Path) -> None:
    """Draw a small step: the stem rests, slides beyond its reference, rests, and slides back onto it."""
    rows = [each for each in run() if each.time_s >= 0.0]
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(9.0, 5.6), sharex=True, height_ratios=(3, 2), layout="constrained"
    )
    time_s = [each.time_s for each in rows]
    above.step(time_s, [100.0 * each.reference for each in rows], color=GREY, where="post", label="reference")
    above.plot(time_s, [100.0 * each.opening for each in rows], color=INK, label="position")
    above.set_ylabel("% of stroke")
    below.step(time_s, [1e-5 * each.command_pa for each in rows], color=INK, where="post")
    below.set_ylabel("command, bar")
    below.set_xlabel("time, s")
    for axes in (above, below):
        shade(axes, rows)
    peak = max(rows, key=lambda each: each.opening)
    span = ((peak.time_s, 100.0 * peak.reference), (peak.time_s, 100.0 * peak.opening))
    above.annotate("", *span, arrowprops={"arrowstyle": "<->", "color": INK})
    above.text(peak.time_s + 0.03, 50.0 * (peak.reference + peak.opening), "excursion", fontsize="small")
    above.legend(loc="upper right", fontsize="small")
    above.set_title("A small step of a sticking stem, and the states of the law of slides", fontsize="medium")
    figure.savefig(figure_file, dpi=120)
    plt.close(figure)


def run() -> Iterator[Row]:
    """Identify the seed's valve, then yield a row a sample; time counts from `LEAD_S` before the second reference."""
    path = shipped_valve("seed")
    valve = load_valve(path).valve
    most_pa = 1.5 * (valve.static_n + valve.spring_n_per_m * valve.stroke_m) / valve.diaphragm_area_m2
    daemon = validate(
        DaemonFile,
        {
            "valve": {"name": valve.name, "stroke_m": valve.stroke_m},
            "cycle": {"pace": "device", "period_s": PERIOD_S},
            "pressure": {"maximum_pa": most_pa},
        },
        "docs",
    )
    clock = {"clock": {"mode": "lockstep", "period_s": PERIOD_S}, "supply": {"maximum_pa": most_pa}}
    slave = validate(SlaveFile, {**clock, "sensor": {"noise_std_m": NOISE_M, "seed": 1}}, "docs")
    settings = Settings.of(daemon)
    link = Link(MemoryDriver(device_of(slave, path)), DevicePace(), LinkSettings(travel=daemon.valve.travel))
    held_pa, _ = link.open()
    memory = first_memory(settings, held_pa)
    requests = Requests(mode=Mode.AUTOMATIC, mode_writes=1, alpha_pa=0.6 * most_pa, beta_pa=0.1 * most_pa)
    begin_s: float | None = None
    while True:
        sample = link.exchange(memory.last.command_pa)
        memory, decision = step(memory, sample, requests, settings)
        now_s = sample.time_s
        if decision.applied.ratios is None:
            requests = replace(requests, eta=QUIET if decision.progress >= 1 else (0, 0, 0))
            if now_s > IDENTIFIED_WITHIN_S:
                raise RuntimeError(f"not identified: {decision.applied.last_refusal.text}")
            continue
        begin_s = now_s + SETTLED_S if begin_s is None else begin_s
        past_s = now_s - begin_s
        reference = REFERENCES[int(past_s >= 0.0)]
        requests = replace(asked(requests, reference * valve.stroke_m), eta=QUIET)
        assert isinstance(memory.law, SlideLaw)
        state = type(memory.law.memory.state).__name__
        stroke_m = valve.stroke_m
        yield Row(past_s + LEAD_S, sample.position_m / stroke_m, reference, decision.command_pa, state)
        if past_s > SHOWN_S:
            return


def asked(requests: Requests, reference_m: float) -> Requests:
    """Return the requests with a reference, m, which is written where it is another."""
    if reference_m == requests.reference_m:
        return requests
    return replace(requests, reference_m=reference_m, reference_writes=requests.reference_writes + 1)


MEANINGS = {
    "Idle": "Idle: the stem rests",
    "Out": "Out: a slide beyond the reference",
    "Sliding": "Sliding: a slide back onto it",
}


def shade(axes: Axes, rows: list[Row]) -> None:
    """Colour the background by the law's state, named once."""
    begin, named = 0, set()
    for at in range(1, len(rows) + 1):
        if at < len(rows) and rows[at].state == rows[begin].state:
            continue
        state, end_s = rows[begin].state, rows[min(at, len(rows) - 1)].time_s
        label = f"_{state}" if state in named else MEANINGS.get(state, state)
        named.add(state)
        axes.axvspan(rows[begin].time_s, end_s, color=COLOURS.get(state, "#f2f2f2"), lw=0, label=label)
        begin = at


BOXES = (
    (0.0, 3.2, 3.1, "workbench/", "compare, fit, diagnose, extend\npage, imports, fleet, loops, report"),
    (0.0, 2.1, 3.1, "sim/", "physics of the valve, its effects\nthe simulated device"),
    (3.4, 3.2, 3.1, "positioner/", "daemon, control, estimation, history\ncli: the roof, one file a command"),
    (3.4, 2.1, 3.1, "drivers/", "one boundary\none file a bus"),
    (6.8, 3.2, 3.1, "northbound/", "clients of a running daemon\nobserver, page, OPC UA, metrics"),
    (3.4, 1.0, 3.1, "fieldbus/", "what the wire carries, both ends\nModbus, TLS, CANopen"),
    (6.8, 1.0, 3.1, "webpage/", "what pages in a browser share\nserver, sign-in, theme"),
    (0.0, -0.1, 6.5, "config/", "what people write: schemas, registers, codes, the recording format"),
    (6.8, -0.1, 3.1, "signals/", "rests and moves: numpy alone"),
)
"""Left and lower edge and width of each room, its name, and what it is for."""
HIGH = 0.85


def architecture(figure_file: Path) -> None:
    """Draw the rooms: each imports from those below it, and the towers meet on the wire."""
    figure, axes = plt.subplots(figsize=(9.9, 4.9), layout="constrained")
    for left, low, wide, name, what in BOXES:
        axes.add_patch(plt.Rectangle((left, low), wide, HIGH, facecolor="#f5f5f5", edgecolor=INK))
        axes.text(left + 0.1, low + HIGH - 0.12, name, va="top", fontweight="bold", color=INK)
        axes.text(left + 0.1, low + HIGH - 0.36, what, va="top", fontsize="small", color=INK)
    arrow = {"arrowstyle": "<->", "color": "#c44e00", "lw": 1.6}
    axes.annotate("", (3.4, 2.3), (3.1, 2.3), arrowprops=arrow)
    axes.annotate("", (6.8, 3.45), (6.5, 3.45), arrowprops=arrow)
    axes.text(3.25, 4.2, "orange: on the wire, never in an import", color="#c44e00", fontsize="small")
    axes.text(0.0, 4.2, "A room imports from rooms below it.", fontsize="small", color=INK)
    axes.set_xlim(-0.05, 9.95)
    axes.set_ylim(-0.2, 4.45)
    axes.axis("off")
    figure.savefig(figure_file, dpi=120)
    plt.close(figure)


def main(folder: Path) -> None:
    """Draw both."""
    architecture(folder / "architecture.png")
    stick_slip(folder / "stick_slip.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
