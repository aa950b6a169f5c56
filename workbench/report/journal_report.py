"""The report of a journal: which effects were added to a valve, one after the other, and how its error fell."""

from collections.abc import Sequence
from pathlib import Path

from workbench.report import ranking
from workbench.report.page import (
    Html,
    Row,
    bullets,
    glossary,
    heading_alone,
    plot,
    section,
    subheading,
    table,
    text,
    verdict,
    write,
)
from workbench.report.units import LENGTH, Shown, length, parameter, times
from workbench.select.extension_journal import ExtensionStep, Journal

WORDS = {
    "As given": "The valve file as it was before the step, nothing fitted.",
    "Refitted": "Its own parameters fitted to the recording, nothing added: what the effect has to beat.",
    "Fitted, held out": "The error, rms, on the data that the parameters were fitted to, and on data held back.",
    "Floor": "The error that no model can undercut: the noise of the position sensor, or how well the valve repeats "
    "itself, whichever is more.",
}


def report_journal(journal: Journal, path: Path, name: str) -> None:
    """Write the report of the steps by which a valve file came to be.

    Args:
        journal: at least one step.
        path: the HTML file.
        name: the valve's.

    Raises:
        InputError: plotly is not installed, or the file cannot be written.
    """
    what = f"Valve “{name}”: how its model grew"
    last = journal.steps[-1]
    fell = (
        f"Error on held-out data {length(last.extended_test_rmse_m).text} mm rms, "
        f"{times(last.extended_test_rmse_m, last.floor_m)} the floor"
    )
    better = last.extended_test_rmse_m < last.refitted_test_rmse_m
    write(
        path,
        f"Valve {name}: how its model grew",
        [
            heading_alone(what, f"{len(journal.steps)} step{'s' if len(journal.steps) > 1 else ''}"),
            verdict(
                "good" if better else "bad",
                f"{fell}.",
                bullets([_remark(*each) for each in enumerate(journal.steps, start=1)]),
            ),
            section(
                "fall",
                "How the error fell",
                plot(
                    "plot-journal",
                    ranking.error_reduction(_stages(journal.steps), last.floor_m, LENGTH),
                    320,
                    f"Error, rms, at each step. Dashed: the floor of the last, {length(last.floor_m).text} mm.",
                ),
                table("table-journal", HEAD, [_row(*each, last.floor_m) for each in _stages(journal.steps)]),
            ),
            *(_step(number, each) for number, each in enumerate(journal.steps, start=1)),
            section("words", "Words used here", glossary(WORDS)),
        ],
    )


HEAD = ["Model", "Error, fitted, mm", "Held out, mm", "In floors"]


def _stages(steps: Sequence[ExtensionStep]) -> list[tuple[str, float, float]]:
    """Return what the errors were: as given and refitted before the first step, and after each."""
    first = steps[0]
    stages = [
        ("as given", first.given_train_rmse_m, first.given_test_rmse_m),
        ("refitted", first.refitted_train_rmse_m, first.refitted_test_rmse_m),
    ]
    for i, each in enumerate(steps, start=1):
        stages.append((f"{i}: + {', '.join(each.effects)}", each.extended_train_rmse_m, each.extended_test_rmse_m))
    return stages


def _remark(number: int, step: ExtensionStep) -> str:
    return (
        f"step {number}, {', '.join(step.effects)} added: held-out error {length(step.refitted_test_rmse_m).text} to "
        f"{length(step.extended_test_rmse_m).text} mm"
    )


def _row(name: str, train_m: float, test_m: float, floor_m: float | None) -> Row:
    return Row([name, length(train_m), length(test_m), times(test_m, floor_m)])


def _step(number: int, step: ExtensionStep) -> Html:
    rows = []
    for name, value in step.parameters.items():
        words, factor, unit = parameter(name)
        rows.append(Row([words, Shown(f"{factor * value:.4g}", f"{name} = {value:.6g}"), unit]))
    return section(
        f"step-{number}",
        f"ExtensionStep {number}: {', '.join(step.effects)}",
        text(f"Why: {step.why}."),
        subheading("What was fitted"),
        table(f"table-step-{number}", ["Parameter", "Value", "Unit"], rows),
    )
