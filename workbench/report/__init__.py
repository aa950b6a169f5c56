"""The report: a comparison, a diagnosis, a balance of forces or a journal as one HTML file that fetches nothing.

    report_comparison(compare(recording, valve), path, Subject(valve, ("rec.csv",), recording.metadata))
    report_diagnosis(diagnose(recording, valve), path, Subject(valve, ("rec.csv",), recording.metadata))
    report_forces(diagnose_forces(recordings, valve), path, Subject(valve, ("bench.csv",)))
    report_journal(Journal.beside(Path("better.toml")), path, valve.valve.name)

`comparison`, `diagnosis`, `forces` and `journal` write the sections, `effects` those that two of them share, `overlay`
and `charts` draw, `series` thins out what is too long to be drawn, `page` sets all of it into `page.html`. The plots
are plotly.js's. The same input, the same bytes.
"""

from workbench.report.comparison_report import report_comparison
from workbench.report.diagnosis_report import report_diagnosis
from workbench.report.forces_report import report_forces
from workbench.report.journal_report import report_journal
from workbench.report.page import Subject, require_plotly

__all__ = ["Subject", "report_comparison", "report_diagnosis", "report_forces", "report_journal", "require_plotly"]
