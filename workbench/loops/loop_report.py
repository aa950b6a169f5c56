"""One loop or a plant's loops as a page: the verdict, and the pictures an engineer trusts.

The first screen answers: does it stick, how much, how sure, what to do. Behind it OP and PV over time, PV over OP with
the fitted path of stick and slip, the spectra, the causes held against each other, and the literature's votes.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from config.results.block import Table
from workbench.loops.causes import FittedPath, fitted_path
from workbench.loops.loop_diagnosis import REMEDIES, LoopDiagnosis
from workbench.loops.loop_record import Array
from workbench.loops.oscillation import without_trend
from workbench.loops.plant import Plant
from workbench.report import report_html as page
from workbench.report.charts import EXTENDED, MEASURED, MODEL, QUIET, Figure, axis, layout, line
from workbench.report.display_units import Shown
from workbench.report.plot_series import draw_series, significant

KIND = {"sticks": "bad", "something else": "good", "cannot be told": "open"}
DRAWN = 3000
"""Points of a line at most; a plant's page holds the pictures of many loops."""
FEWER = 800
"""Points of a line on a plant's page."""
MOST_DRILLED = 60
"""Loops of a plant's page that have pictures: 20 kB each."""
WORDS = {
    "Apparent stiction S": "How far the output must go, after a turn, before the stem moves: dead band and stick band.",
    "Slip jump J": "How far the stem jumps when it breaks loose.",
    "Evidence": "What friction explains better than the best other cause, as difference of log-likelihoods, in nats.",
    "Sticks, %": "Probability, calibrated on loops simulated by other equations: at 95 % at most one of 20 is wrong.",
}


def report_loop(found: Sequence[LoopDiagnosis], path: Path) -> None:
    """Write the page of one loop or a few.

    Raises:
        InputError: plotly is not installed, or the file cannot be written.
    """
    title = "Loop " + ", ".join(each.record.name for each in found)
    parts: list[page.Html] = []
    for count, each in enumerate(found):
        name, facts = f"loop-{count}", f"{each.record.pv.size} samples, one each {each.record.period_s:g} s"
        parts += [page.heading_alone(f"Loop {each.record.name}", facts), _verdict(each, name), _key_figures(each)]
        parts += _pictures(each, name, DRAWN)
        parts += [page.section(f"{name}-tables", "Causes held against each other", _tables(each, name))]
    page.write(path, title, [*parts, page.section("words", "Words used here", page.glossary(WORDS))])


def report_loops(plant: Plant, path: Path, manifest: str) -> None:
    """Write the page of a plant.

    Raises:
        InputError: plotly is not installed, or the file cannot be written.
    """
    counts = ", ".join(f"{plant.count(each)} {words}" for each, words in COUNTED.items())
    parts = [
        page.heading_alone(
            f"Loops of {manifest}", f"{len(plant.ranked)} loops: {counts}; {len(plant.unreadable)} unreadable"
        ),
        page.section("ranking", "Ranking", _page_table("loops", plant.ranking)),
    ]
    if plant.groups:
        head = ("Loops", "Period, s", "Likeliest source", "Because")
        rows = [page.Row((", ".join(g.loops), f"{g.period_s:.4g}", g.source, g.because)) for g in plant.groups]
        parts.append(
            page.section("together", "Loops that oscillate together", page.table("groups", head, rows, (0, 2, 3)))
        )
    for count, each in enumerate(plant.ranked[:MOST_DRILLED]):
        name = f"loop-{count}"
        inside = [_verdict(each, name), *_pictures(each, name, FEWER), _tables(each, name)]
        parts.append(page.fold_parts(name, f"{count + 1}. {each.record.name}: {each.verdict}", *inside))
    if plant.unreadable:
        rows = [page.Row(each) for each in plant.unreadable]
        parts.append(page.section("unreadable", "Unreadable", page.table("bad", ("Loop", "Why"), rows, (0, 1))))
    page.write(path, f"Loops of {manifest}", [*parts, page.section("words", "Words used here", page.glossary(WORDS))])


COUNTED = {"sticks": "stick", "something else": "of another cause", "cannot be told": "that cannot be told"}


def _verdict(each: LoopDiagnosis, name: str) -> page.Html:
    said = page.text(*filter(None, (each.advice, *each.record.notes)))
    if each.remedies:
        said = page.Html(
            said + _page_table(f"{name}-remedies", each.remedy_table) + page.text(REMEDIES.rstrip(":") + ".")
        )
    return page.verdict(KIND[each.verdict], each.sentence, said)


def _key_figures(each: LoopDiagnosis) -> page.Html:
    return page.figures_of_merit(
        [
            ("Sticks, %", Shown(each.sticks_said), "calibrated by loop"),
            ("Apparent stiction, % of the output", Shown(each.stiction_said), "95 % interval"),
            ("Period, s", Shown(f"{each.oscillation.period_s:.4g}"), f"regularity {each.oscillation.regularity:.1f}"),
            ("Error's std, % of PV", Shown(f"{100 * each.variance_cost:.2g}"), "PV against set point"),
        ]
    )


def _tables(each: LoopDiagnosis, name: str) -> page.Html:
    votes = _page_table(f"{name}-votes", each.vote_table)
    if each.causes is None:
        return page.Html(page.text("No causes were compared: the record is insufficient.") + votes)
    return page.Html(page.text(each.cause_table.title) + _page_table(f"{name}-causes", each.cause_table) + votes)


def _page_table(name: str, each: Table) -> page.Html:
    words = [column for column in range(len(each.headings)) if each.is_words(column)]
    head = [heading.capitalize() for heading in each.headings]
    rows = [page.Row(tuple(row), kind="over" if "sticks" in row[:2] else "") for row in each.rows]
    return page.table(name, head, rows, words)


def _pictures(each: LoopDiagnosis, name: str, most: int) -> list[page.Html]:
    friction = each.causes.friction if each.causes and each.verdict != "something else" else None
    path = fitted_path(each.record, each.oscillation, friction) if friction else None
    return [
        page.plot(f"{name}-time", _over_time(each, path, most), 360, TIME_CAPTION),
        page.pair(
            page.plot(f"{name}-path", _over_output(each, path, most), 340, PATH_CAPTION),
            page.plot(f"{name}-spectrum", _spectra(each, most), 340, SPECTRUM_CAPTION),
        ),
    ]


TIME_CAPTION = "OP, PV and SP over time, and the stem where one is fitted."
PATH_CAPTION = "PV over OP: as recorded, and as a sticking stem gives it."
SPECTRUM_CAPTION = "Amplitude of OP and PV by period, each over its largest."


def _over_time(each: LoopDiagnosis, path: FittedPath | None, most: int) -> Figure:
    record = each.record
    time_s = np.asarray(record.period_s * np.arange(record.pv.size), np.float64)
    traces = [
        _line(time_s, record.op_pct, "OP", MEASURED, "%{y:.4~g} %", most),
        _line(time_s, record.pv, "PV", MODEL, "%{y:.4~g}", most, yaxis="y2"),
    ]
    if record.sp is not None:
        traces.append(_line(time_s, record.sp, "SP", QUIET, "%{y:.4~g}", most, yaxis="y2"))
    if path is not None:
        traces.append(_line(path.time_s, path.stem_pct, "stem, fitted", EXTENDED, "%{y:.4~g} %", most))
    right = axis("PV, SP", side="right", overlaying="y", showgrid=False)
    return {"data": traces, "layout": layout(xaxis=axis("time, s"), yaxis=axis("OP, %"), yaxis2=right, margin=WIDE)}


WIDE = {"l": 62, "r": 70, "t": 34, "b": 46}


def _over_output(each: LoopDiagnosis, path: FittedPath | None, most: int) -> Figure:
    series = [("recorded", each.record.op_pct, each.record.pv, QUIET)]
    if path is not None:
        series.append(("stick and slip", path.output_pct, path.pv_fitted, EXTENDED))
    hover = "%{y:.4~g} at %{x:.4~g} %"
    traces = []
    for name, output, pv, colour in series:
        every = -(-pv.size // most)
        traces.append(line(significant(output[::every]), significant(pv[::every]), name, colour, hover))
    return {"data": traces, "layout": layout(xaxis=axis("OP, %"), yaxis=axis("PV"))}


def _spectra(each: LoopDiagnosis, most: int) -> Figure:
    record = each.record
    hover = "%{y:.2f} at %{x:.4~g} s"
    traces = []
    for name, values, colour in (("OP", record.op_pct, MEASURED), ("PV", record.pv, MODEL)):
        period_s, amplitude = (series[:: -(-series.size // most)] for series in _amplitudes(values, record.period_s))
        traces.append(line(significant(period_s), significant(amplitude), name, colour, hover))
    return {"data": traces, "layout": layout(xaxis=axis("period, s", type="log"), yaxis=axis("amplitude, of largest"))}


def _amplitudes(values: Array, period_s: float) -> tuple[Array, Array]:
    detrended = without_trend(values)
    amplitude = np.abs(np.fft.rfft(detrended * np.hanning(values.size)))[2:]
    frequency = np.fft.rfftfreq(values.size, period_s)[2:]
    return np.asarray(1.0 / frequency, np.float64), amplitude / max(float(amplitude.max()), 1e-300)


def _line(time_s: Array, value: Array, name: str, colour: str, hover: str, most: int, **changes: Any) -> dict[str, Any]:
    shown = draw_series(time_s, value, most)
    return line(significant(shown.time_s, 7), significant(shown.value), name, colour, hover, **changes)
