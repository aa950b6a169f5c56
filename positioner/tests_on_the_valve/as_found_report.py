"""The report of a valve, as found and as left: one HTML file that fetches nothing, or a PDF, from the records kept.

    device and configuration        of the newest record
    what has changed                since the factory, in the technician's words
    a table a test                  each figure recommended, as found, as left, and factory's, each with its +-
    and what of them has changed    from as found to as left, and since the factory, by how many deviations
    pictures                        as found and as left, drawn into one
    signed                          who tested, who accepted

What is recommended: by who asks for it, else the factory's record, else the daemon's file. A PDF needs matplotlib.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from html import escape
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from config.daemon_file import DaemonFile
from config.results.block import Table, as_text
from positioner.response.figure import Figure
from positioner.tests_on_the_valve.kept_records import (
    AT_ITS_RATE,
    KINDS,
    MEANS,
    Change,
    Record,
    change_table,
    changes,
    span_of,
)
from positioner.tests_on_the_valve.outcome import Curve, Picture, Quantity
from positioner.tests_on_the_valve.valve_test_thresholds import THRESHOLDS

if TYPE_CHECKING:
    from pathlib import Path

TITLES = {"factory": "factory", "as_found": "as found", "as_left": "as left"}
MARK = (
    f"* differs from the recommended figure by more than {THRESHOLDS.off:.0%} (an end: {THRESHOLDS.worth_of_span:.0%} "
    f"of travel or bench set's span), and by more than {THRESHOLDS.changed_sigmas:.0f} standard deviations"
)
UNCHANGED = "no change of a figure points to a cause"
PROSE = 130
"""Letters in a line of a PDF."""
MOST_PT, ACROSS_PT, DOWN_PT = 8.0, 1150.0, 430.0
"""Size of letters in a PDF: at the most, by the widest line's letters, and by the lines, for which a page has room."""
WIDTH, HEIGHT, EDGE = 640, 300, 56
"""Of a picture, in its own units."""
INKS = {"as_found": ("#d9622b", "#e8a27f"), "as_left": ("#1b7f79", "#7db8b4"), "factory": ("#5b6675", "#9aa4b1")}
SIGNED = ("tested by", "date", "signature", "accepted by", "date", "signature")
STYLE = """
:root { --ink: #1f2a37; --quiet: #5b6675; --line: #dfe3e8; }
body { margin: 0 auto; max-width: 980px; padding: 28px; color: var(--ink); font: 15px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.6rem; margin: 0 0 .2em; }
h2 { font-size: 1.15rem; margin: 2em 0 .3em; border-top: 1px solid var(--line); padding-top: .7em; }
.quiet { color: var(--quiet); font-size: .9rem; }
table { border-collapse: collapse; width: 100%; font-size: .9rem; font-variant-numeric: tabular-nums; margin: .6em 0; }
th, td { padding: 5px 10px; border-bottom: 1px solid var(--line); text-align: right; vertical-align: top; }
th:first-child, td:first-child { text-align: left; } th { color: var(--quiet); font-weight: 600; }
svg { max-width: 100%; height: auto; }
dl { display: grid; grid-template-columns: repeat(3, 1fr); gap: 30px 20px; margin-top: 2em; }
dt { border-top: 1px solid var(--ink); color: var(--quiet); font-size: .85rem; padding-top: 4px; margin-top: 40px; }
pre { font-size: .82rem; border: 1px solid var(--line); padding: 8px; overflow-x: auto; }
@media print { body { padding: 0; } section { break-inside: avoid; } }
"""


@dataclass(frozen=True, slots=True)
class ValveReport:
    """What is reported of a valve.

    Attributes:
        valve: its name.
        records: all that are kept, oldest first.
        recommended: what figures should be, by name, SI.
        by_file: what the daemon's file makes of them, where there is no record of the factory's.
    """

    valve: str
    records: Sequence[Record]
    recommended: Mapping[str, float] = field(default_factory=dict)
    by_file: Mapping[str, float] = field(default_factory=dict)

    @property
    def configuration(self) -> Mapping[str, Any]:
        """What was configured when the newest record was kept."""
        return self.records[-1].configuration

    def tests(self) -> list[str]:
        """Return the tests of which a record is kept as something, in the order they were first kept."""
        return list(dict.fromkeys(each.outcome.test for each in self.records if each.kind in KINDS))

    def kept(self, test: str) -> dict[str, Record]:
        """Return the newest record of each kind, of a test."""
        newest = {each.kind: each for each in self.records if each.outcome.test == test}
        return {kind: newest[kind] for kind in ("as_found", "as_left", "factory") if kind in newest}

    def table(self, test: str) -> Table:
        """Return a test's figures: what each should be, and what it was, by kind."""
        kept = self.kept(test)
        by_kind = {kind: {each.name: each for each in record.outcome.quantities} for kind, record in kept.items()}
        names = list(dict.fromkeys(name for told in by_kind.values() for name in told))
        rows = []
        for name in names:
            told = [figures.get(name) for figures in by_kind.values()]
            first = min((each for each in told if each is not None), key=lambda each: not each.figure.plus_minus)
            shown = (self._shown(each, record) for each, record in zip(told, kept.values(), strict=True))
            wanted = self._recommended(first)
            stated = replace(first, expected=wanted.value).shown_expected
            rows.append((first.text, replace(first, figure=wanted).shown if wanted.plus_minus else stated, *shown))
        verdicts = ("verdict", "", *(record.outcome.said for record in kept.values()))
        return Table(("figure", "recommended ", *(f"{TITLES[kind]} " for kind in kept)), [verdicts, *rows], test)

    def compared(self, test: str) -> Iterator[tuple[Record, Record, list[Change]]]:
        """Yield a test's records before and after: since the factory, and from as found to as left."""
        kept = self.kept(test)
        for before, after in (("factory", "as_found"), ("factory", "as_left"), ("as_found", "as_left")):
            if before in kept and after in kept:
                yield kept[before], kept[after], changes(kept[after].outcome, kept[before].outcome)

    def changed(self, test: str) -> list[Table]:
        """Return what has changed from each record to the next."""
        tables = [change_table(each, f"{before.told}, {after.told}") for before, after, each in self.compared(test)]
        return [each for each in tables if each.rows]

    def findings(self) -> list[str]:
        """Return what the figures mean that have changed since the factory or, without one, until as left, in words.

        A line each, with the figures of every test that shows it.
        """
        shown: dict[str, list[str]] = {}
        for test in self.tests():
            for before, after, changed in self.compared(test):
                if before.kind == "factory" or "factory" not in self.kept(test):
                    for each in changed:
                        if each.changed and each.means:
                            told = f"{each.quantity.shown}, {TITLES[before.kind]} {each.before.shown}"
                            line = f"{test}, {each.quantity.text}: {told}"
                            shown.setdefault(f"{TITLES[after.kind]}: {each.means}", []).append(line)
        return [f"{means} ({'; '.join(figures)})" for means, figures in shown.items()]

    def heading(self) -> str:
        """Return how the report is to be read."""
        return (
            f"written {datetime.now(UTC):%Y-%m-%d %H:%M} UTC; every ± is two standard deviations or half an interval; "
            f"a figure that cannot be determined has its reason; {MARK}"
        )

    def when(self, test: str) -> str:
        """Return when the records of a test were made."""
        return "; ".join(each.told for each in self.kept(test).values())

    def notes(self, test: str) -> list[str]:
        """Return the notes of a test's records, with whose each is where it is not that of all."""
        kept = self.kept(test)
        told: dict[str, list[str]] = {}
        for kind, record in kept.items():
            for note in dict.fromkeys(record.outcome.notes):
                told.setdefault(note, []).append(TITLES[kind])
        return [note if len(kinds) == len(kept) else f"{', '.join(kinds)}: {note}" for note, kinds in told.items()]

    def _recommended(self, quantity: Quantity) -> Figure:
        """Return what a figure should be; without a value where nobody says."""
        if quantity.name in self._factory.keys() - self.recommended.keys():
            return self._factory[quantity.name]
        return Figure({**self.by_file, **self.recommended}.get(quantity.name, quantity.expected))

    @property
    def _factory(self) -> dict[str, Figure]:
        """What the factory's newest records say of what a technician looks at, by name."""
        left = [each.outcome for each in self.records if each.kind == "factory"]
        told = {each.name: each.figure for outcome in left for each in outcome.quantities}
        looked_at = (MEANS.keys() | self.by_file.keys()) - AT_ITS_RATE
        return {name: figure for name, figure in told.items() if name in looked_at and figure.value is not None}

    def _shown(self, quantity: Quantity | None, record: Record) -> str:
        """Return a figure as it is shown, marked where it is off what is recommended, other than by the test itself."""
        if quantity is None:
            return "-"
        wanted = replace(quantity, figure=self._recommended(replace(quantity, expected=None)))
        marked = Change(quantity, wanted, span_of(quantity.name, record.outcome)).is_off_by(THRESHOLDS.off)
        return f"{quantity.shown} *" if marked else quantity.shown


def recommended_by(file: DaemonFile) -> dict[str, float]:
    """Return what the daemon's file says that figures should be, by name, SI."""
    stroke_m, law = file.valve.stroke_m, file.law
    told = {"travel_m": stroke_m}
    if law is not None and law.b_over_c_pa_per_m is not None and law.k_over_c_pa is not None:
        told |= {
            "spring_pa_per_m": -law.b_over_c_pa_per_m,
            "friction_pa": -law.k_over_c_pa,
            "bench_low_pa": law.offset_pa,
            "bench_high_pa": law.offset_pa - law.b_over_c_pa_per_m * stroke_m,
        }
    return told


def as_html(report: ValveReport) -> str:
    """Return the report as one page."""
    title = f"Valve {report.valve}: as found and as left"
    parts = [
        f"<h1>{escape(title)}</h1><p class='quiet'>{escape(report.heading())}</p>",
        _findings(report),
        *(_section(report, each) for each in report.tests()),
        f"<section><h2>Configuration</h2><pre>{escape(_lines(report.configuration))}</pre></section>",
        "<section><h2>Signed</h2><dl>" + "".join(f"<div><dt>{each}</dt></div>" for each in SIGNED) + "</dl></section>",
    ]
    csp = "default-src 'none'; style-src 'unsafe-inline'"
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{csp}"><style>{STYLE}</style></head>\n<body>\n'
        + "\n".join(parts)
        + "\n</body></html>\n"
    )


def write_pdf(report: ValveReport, path: "Path") -> None:
    """Write the report as a PDF, a page for each table and picture.

    Raises:
        ModuleNotFoundError: matplotlib is not installed (extra `plot`).
    """
    from config.extras import import_extra

    figures, pages = (
        import_extra("matplotlib.figure", "report"),
        import_extra("matplotlib.backends.backend_pdf", "report"),
    )
    with pages.PdfPages(path) as pdf:
        changed = _prose(report.heading(), "", *(report.findings() or [UNCHANGED]))
        _page(figures, pdf, f"Valve {report.valve}: what has changed", changed)
        for test in report.tests():
            tables = (as_text([each]) for each in (report.table(test), *report.changed(test)))
            texts = [_prose(report.when(test)), *tables, _prose(*report.notes(test))]
            _page(figures, pdf, f"Valve {report.valve}: {test}", "\n\n".join(texts))
            pictures = [
                (kind, each.outcome.picture) for kind, each in report.kept(test).items() if each.outcome.picture
            ]
            if pictures:
                figure = figures.Figure(figsize=(11.7, 8.3), layout="constrained")
                for axes, (kind, picture) in zip(
                    figure.subplots(len(pictures), 1, squeeze=False)[:, 0], pictures, strict=True
                ):
                    picture.draw(axes)
                    axes.set_title(TITLES[kind])
                pdf.savefig(figure)
        _page(
            figures,
            pdf,
            f"Valve {report.valve}",
            _lines(report.configuration) + "\n\n\n" + "\n\n\n".join(f"{each}: {'_' * 40}" for each in SIGNED),
        )


def _prose(*lines: str) -> str:
    return "\n".join(fill(each, PROSE, subsequent_indent="    ") for each in lines)


def _page(figures: Any, pdf: Any, title: str, text: str) -> None:
    figure = figures.Figure(figsize=(11.7, 8.3))
    figure.text(0.04, 0.95, title, fontsize=13, weight="bold", va="top")
    widest = max((len(each) for each in text.splitlines()), default=1)
    size = min(MOST_PT, ACROSS_PT / max(widest, 1), DOWN_PT / (text.count("\n") + 1))
    figure.text(0.04, 0.90, text, fontsize=size, family="monospace", va="top")
    pdf.savefig(figure)


def _findings(report: ValveReport) -> str:
    lines = "".join(f"<li>{escape(each)}</li>" for each in report.findings() or [UNCHANGED])
    return f"<section><h2>What has changed</h2><ul>{lines}</ul></section>"


def _section(report: ValveReport, test: str) -> str:
    return (
        f"<section><h2>{escape(test.capitalize())}</h2><p class='quiet'>{escape(report.when(test))}</p>"
        + _html_table(report.table(test))
        + "".join(f"<p><b>{escape(each.title)}</b></p>{_html_table(each)}" for each in report.changed(test))
        + _svg({kind: each.outcome.picture for kind, each in report.kept(test).items()})
        + "".join(f"<p class='quiet'>{escape(each)}</p>" for each in report.notes(test))
        + "</section>"
    )


def _html_table(table: Table) -> str:
    head = "".join(f"<th>{escape(each.strip())}</th>" for each in table.headings)
    rows = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"


def _lines(configuration: Mapping[str, Any]) -> str:
    told = []
    for name, table in configuration.items():
        if isinstance(table, Mapping):
            told += [
                f"[{name}]",
                *(f"{key} = {value}" for key, value in table.items() if not isinstance(value, Mapping)),
            ]
    return "\n".join(told)


def _svg(pictures: Mapping[str, Picture | None]) -> str:
    """Return the pictures of one test drawn into one, a colour for each kind."""
    drawn = [(kind, curve) for kind, each in pictures.items() if each is not None for curve in each.curves]
    drawn = [(kind, curve) for kind, curve in drawn if len(curve.x)]
    if not drawn:
        return ""
    axes = next(each for each in pictures.values() if each is not None)
    xs, ys = (np.concatenate([getattr(curve, name) for _, curve in drawn]) for name in ("x", "y"))
    left, right, low, high = float(xs.min()), float(xs.max()), float(ys.min()), float(ys.max())
    across = (WIDTH - 2 * EDGE) / ((right - left) or 1.0)
    up = (HEIGHT - 2 * EDGE) / ((high - low) or 1.0)

    def at(curve: Curve) -> Iterator[str]:
        for x, y in zip(curve.x.tolist(), curve.y.tolist(), strict=True):
            yield f"{EDGE + (x - left) * across:.1f},{HEIGHT - EDGE - (y - low) * up:.1f}"

    shapes, seen = [], dict.fromkeys(kind for kind, _ in drawn)
    for kind, curve in drawn:
        ink = INKS[kind][1 if curve.points else 0]
        if curve.points:
            dots = "".join(f'<circle cx="{x}" cy="{y}" r="1.2"/>' for x, y in (each.split(",") for each in at(curve)))
            shapes.append(f'<g fill="{ink}">{dots}</g>')
        else:
            shapes.append(f'<polyline fill="none" stroke="{ink}" points="{" ".join(at(curve))}"/>')
    words = [
        f'<text x="{WIDTH / 2}" y="{HEIGHT - 8}" text-anchor="middle">{escape(axes.x)}</text>',
        f'<text x="14" y="{HEIGHT / 2}" text-anchor="middle" transform="rotate(-90 14 {HEIGHT / 2})">'
        f"{escape(axes.y)}</text>",
        f'<text x="{EDGE}" y="{HEIGHT - EDGE + 16}">{left:.4g}</text>',
        f'<text x="{WIDTH - EDGE}" y="{HEIGHT - EDGE + 16}" text-anchor="end">{right:.4g}</text>',
        f'<text x="{EDGE - 4}" y="{HEIGHT - EDGE}" text-anchor="end">{low:.3g}</text>',
        f'<text x="{EDGE - 4}" y="{EDGE + 4}" text-anchor="end">{high:.3g}</text>',
        *(
            f'<text x="{EDGE + 130 * number}" y="20" fill="{INKS[kind][0]}">{TITLES[kind]}</text>'
            for number, kind in enumerate(seen)
        ),
    ]
    size = f'width="{WIDTH - 2 * EDGE}" height="{HEIGHT - 2 * EDGE}"'
    frame = f'<rect x="{EDGE}" y="{EDGE}" {size} fill="none" stroke="#dfe3e8"/>'
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" font-size="11" font-family="system-ui, sans-serif">'
        f"{frame}{''.join(shapes)}{''.join(words)}</svg>"
    )
