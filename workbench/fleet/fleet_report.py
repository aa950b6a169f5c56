"""The ranking as one page: a line a valve with a sparkline, and what is behind it folded under the line.

The diagnosis report of a valve has five megabytes, of plots: it is a file of its own (`drill_down`), to which the page
leads; for a valve without one it has the command that makes it.
"""

from collections.abc import Mapping
from html import escape
from math import log
from os.path import relpath
from pathlib import Path

from workbench.fleet.examination import Examination
from workbench.fleet.fleet import Fleet, since_day
from workbench.fleet.valve_complaints import ValveCourse
from workbench.report import report_html as page
from workbench.report.display_units import OF_VALVE, Shown

WIDTH_PX, HEIGHT_PX, RADIUS_PX = 120, 24, 2
LEAST_RATIO, MOST_RATIO = 1.0, 100.0
"""Of error to floor, between which a sparkline goes, by its logarithm."""


def report_fleet(fleet: Fleet, path: Path, manifest: str, reports: Mapping[str, Path] | None = None) -> None:
    """Write the page; the same fleet, the same bytes.

    Args:
        fleet: the ranked valves.
        path: of the page.
        manifest: its name.
        reports: diagnosis reports by valve, to which the page leads.

    Raises:
        InputError: the file cannot be written.
    """
    facts = f"{len(fleet.courses)} valves, {fleet.count} recordings, {len(fleet.bad)} unreadable"
    parts = [page.heading_alone(f"Fleet of {manifest}", facts), _ranking(fleet)]
    seen_from = path.resolve().parent
    links = {name: relpath(each.resolve(), seen_from) for name, each in (reports or {}).items()}
    parts += [
        _drill_down(rank, course, links.get(course.name)) for rank, course in enumerate(fleet.complaining, start=1)
    ]
    if fleet.bad:
        rows = [page.Row((name, entry.recording, reason)) for name, entry, reason in fleet.bad]
        bad = page.table("bad", ("valve", "recording", "why"), rows, words=(0, 1, 2))
        parts.append(page.section("unreadable", "Recordings that could not be examined", bad))
    nothing_known = {course.name for course in fleet.unknown}
    well = [each.name for each in fleet.courses if not each.gravest and each.name not in nothing_known]
    parts.append(page.section("well", "Valves without a finding", page.text(", ".join(well) or "none")))
    if nothing_known:
        parts.append(
            page.section("unknown", "Valves that could not be judged", page.text(", ".join(sorted(nothing_known))))
        )
    page.write_without_plots(path, f"Fleet of {manifest}", parts)


def _ranking(fleet: Fleet) -> page.Html:
    rows = [
        page.Row(
            (str(rank), course.name, course.kind, since_day(course), _share(course), course.sure, ""),
            kind="over",
            picture=page.link_to(f"#history-{rank}", sparkline(course)),
        )
        for rank, course in enumerate(fleet.complaining, start=1)
    ]
    if not rows:
        return page.section("ranking", "Valves that need attention", page.text("None: all follow their last models."))
    head = ("rank", "valve", "what", "since", "off by, % of stroke", "sure", "error over time")
    legend = (
        "Error over time: of the last valid model, in floors, on a logarithmic scale. Press it for the valve's history."
    )
    ranked = page.table("ranked", head, rows, words=(1, 2, 3, 5, 6))
    return page.section("ranking", "Valves that need attention", ranked, page.text(legend))


def _drill_down(rank: int, course: ValveCourse, report: str | None) -> page.Html:
    assert course.gravest
    entry, found = course.gravest
    history = [
        page.Row((each.time.date().isoformat(), each.recording, _outcome(came), OF_VALVE.length(came.error_before_m)))
        for each, came in course.examined
    ]
    tried = [
        page.Row((each.name, OF_VALVE.length(each.held_out_m), each.remark or "accepted")) for each in found.candidates
    ]
    models = [page.Row((f"{each.when:%Y-%m-%d}", each.recording, each.found.sentence)) for each in course.models]
    command = f"positioner diagnose {entry.recording} --valve {entry.file} --report {course.name}.html"
    return page.fold_parts(
        f"valve-{rank}",
        f"{rank}. {course.name}: {course.kind}",
        page.text(found.sentence),
        page.link_to(report, page.Html("The diagnosis report")) if report else page.Html(""),
        page.table(f"history-{rank}", ("when", "recording", "result", "error before, mm"), history, words=(0, 1, 2)),
        page.table(f"models-{rank}", ("model from", "by", "why"), models, words=(0, 1, 2)) if models else page.Html(""),
        page.table(f"tried-{rank}", ("effect", "held out, mm", ""), tried, words=(0, 2)) if tried else page.Html(""),
        page.keep_lines(command),
    )


def sparkline(course: ValveCourse) -> page.Html:
    """Return the error of the valve's last model, in floors, over its recordings: low is well."""
    points = [_height(found) for _, found in course.readable]
    step = (WIDTH_PX - 2 * RADIUS_PX) / max(len(points) - 1, 1)
    places = [(RADIUS_PX + i * step, y) for i, y in enumerate(points)]
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
    dots = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{RADIUS_PX}" fill="currentColor"/>' for x, y in places)
    label = escape(f"error over the floor of {course.name}, {len(points)} recordings")
    return page.Html(
        f'<svg role="img" aria-label="{label}" width="{WIDTH_PX}" height="{HEIGHT_PX}">'
        f'<polyline points="{line}" fill="none" stroke="currentColor"/>{dots}</svg>'
    )


def _height(found: Examination) -> float:

    ratio = (found.error_before_m or 0.0) / found.floor_m if found.floor_m else MOST_RATIO
    share = log(min(max(ratio, LEAST_RATIO), MOST_RATIO)) / log(MOST_RATIO)
    return HEIGHT_PX - RADIUS_PX - share * (HEIGHT_PX - 2 * RADIUS_PX)


def _outcome(found: Examination) -> str:
    return found.outcome.replace("_", " ") + (f": {', '.join(found.effects)}" if found.effects else "")


def _share(course: ValveCourse) -> Shown:
    return Shown(f"{100.0 * course.cost_share:.2f}", f"{course.cost_share:.6g}")
