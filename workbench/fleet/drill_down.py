"""The diagnosis reports of the gravest valves, made anew from the same recording and model as the fleet's examination.

A report has five megabytes of plots, and a diagnosis takes seconds: they are made for as many valves as asked for, kept
in `reports/` under the fleet's folder by the content of what they are made of, and not made twice.
"""

from collections.abc import Mapping
from pathlib import Path

from config.errors import explain_failure
from config.recording import Recording
from config.valve_file_writer import write_valve
from workbench.diagnosis.diagnosis import diagnose
from workbench.fleet.examination import CHANGED, UNTOLD, request_key
from workbench.fleet.fleet import Fleet
from workbench.fleet.valve_complaints import ValveCourse
from workbench.report.diagnosis_report import report_diagnosis
from workbench.report.report_html import Subject, require_plotly

KEY_LENGTH = 24
"""Characters of a key that name a report."""


def write_diagnosis_reports(fleet: Fleet, out: Path, most: int) -> Mapping[str, Path]:
    """Return the reports by valve, of at most so many valves that were diagnosed, the gravest first.

    Raises:
        InputError: plotly is not installed, the folder cannot be written, or an effect cannot be run.
    """
    chosen = [each for each in fleet.complaining if each.gravest and each.gravest[1].outcome not in (CHANGED, UNTOLD)]
    if not chosen[:most]:
        return {}
    folder = out / "reports"
    require_plotly(folder)
    with explain_failure(folder, "cannot be written"):
        folder.mkdir(exist_ok=True)
    found = {course.name: _report(course, fleet.folder, folder) for course in chosen[:most]}
    return {name: path for name, path in found.items() if path is not None}


def _report(course: ValveCourse, recordings: Path, folder: Path) -> Path | None:
    """Return the report of a valve's gravest recording; None: the recording is gone."""
    assert course.gravest
    assert course.given
    entry, _ = course.gravest
    held = course.model_before(entry.time)
    held = held.model_copy(update={"valve": held.valve.model_copy(update={"name": course.name})})
    try:
        key = request_key(recordings / entry.recording, held, "report")[:KEY_LENGTH]
    except OSError:
        return None
    path = folder / f"{key}.html"
    if path.exists():
        return path
    recording = Recording.read(recordings / entry.recording)
    write_valve(path.with_suffix(".toml"), held)
    subject = Subject(held, (entry.recording,), recording.metadata)
    beside = path.with_suffix(".new")
    report_diagnosis(diagnose(recording, held), beside, subject)
    beside.replace(path)
    return path
