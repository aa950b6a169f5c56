"""The report: a comparison, a diagnosis, a balance of forces or a journal as one HTML file that fetches nothing.

    report_comparison(compare(recording, valve), path, Subject(valve, ("rec.csv",), recording.metadata))
    report_diagnosis(diagnose(recording, valve), path, Subject(valve, ("rec.csv",), recording.metadata))
    report_forces(diagnose_forces(recordings, valve), path, Subject(valve, ("bench.csv",)))
    report_journal(Journal.beside(Path("better.toml")), path, valve.valve.name, valve.valve.own)

The same input, the same bytes. Its files:

    comparison_report, diagnosis_report    the sections of each report
    forces_report, journal_report          of the others
    effects_table, effect_ranking          sections that two of them share; which effect lowers the error how far
    overlay, signature_loop                measured and simulated, over time and over the command
    charts, plot_series                    the small plots; what is too long thinned out
    report_html, display_units             pieces of HTML set into one page; units that people at a plant use
"""

from workbench.report.comparison_report import report_comparison
from workbench.report.diagnosis_report import report_diagnosis
from workbench.report.forces_report import report_forces
from workbench.report.journal_report import report_journal
from workbench.report.report_html import Subject, require_plotly

__all__ = ["Subject", "report_comparison", "report_diagnosis", "report_forces", "report_journal", "require_plotly"]
