"""The report of a journal: which effects were added to a valve, one after the other, and how its error fell."""

from collections.abc import Sequence
from pathlib import Path

from config.drive import Kind
from workbench.diagnosis.extension_journal import ExtensionStep, Journal
from workbench.report import effect_ranking
from workbench.report import report_html as page
from workbench.report.display_units import Reading, Shown, times

WORDS = {
    "As given": "The valve file as it was before the step, nothing fitted.",
    "Refitted": "Its own parameters fitted to the recording, nothing added: an effect must do better than this.",
    "Fitted, held out": "The error, rms, on the data that the parameters were fitted to, and on data held back.",
    "Floor": "The least error that any model can have: the noise of the position sensor or the repeatability of the "
    "valve, whichever is more.",
}


def report_journal(journal: Journal, path: Path, name: str, kind: Kind) -> None:
    """Write the report of the steps by which a valve file came to be.

    Args:
        journal: at least one step.
        path: the HTML file.
        name: the valve's.
        kind: its names and units.

    Raises:
        InputError: plotly is not installed, or the file cannot be written.
    """
    what = f"{kind.noun} “{name}”: how its model grew"
    last, read = journal.steps[-1], Reading(kind)
    fell = (
        f"Error on held-out data {read.said(last.extended_test_rmse_m)} rms, "
        f"{times(last.extended_test_rmse_m, last.floor_m)} the floor"
    )
    better = last.extended_test_rmse_m < last.before_test_rmse_m
    page.write(
        path,
        f"{kind.noun} {name}: how its model grew",
        [
            page.heading_alone(what, f"{len(journal.steps)} step{'s' if len(journal.steps) > 1 else ''}"),
            page.verdict(
                "good" if better else "bad",
                f"{fell}.",
                page.bullets([_remark(*each, read) for each in enumerate(journal.steps, start=1)]),
            ),
            *journal_sections(journal.steps, read),
            page.section("words", "Words used here", page.glossary(WORDS)),
        ],
    )


def journal_sections(steps: Sequence[ExtensionStep], read: Reading) -> tuple[page.Html, ...]:
    """Return the sections of how the error fell, and of what was done in each step."""
    floor_m, stages = steps[-1].floor_m, _stages(steps)
    return (
        page.section(
            "fall",
            "How the error fell",
            page.plot(
                "plot-journal",
                effect_ranking.error_reduction(stages, floor_m, read.errors),
                320,
                f"Error, rms, at each step. Dashed: the floor of the last, {read.said(floor_m)}.",
            ),
            page.table(
                "table-journal",
                [read.title(each) for each in HEAD],
                [_row(*each, floor_m, read) for each in stages],
            ),
        ),
        *(_step(number, each, read) for number, each in enumerate(steps, start=1)),
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
        if i > 1 or each.effects:
            named = f"+ {', '.join(each.effects)}" if each.effects else "refitted"
            stages.append((f"{i}: {named}", each.extended_train_rmse_m, each.extended_test_rmse_m))
    return stages


def _remark(number: int, step: ExtensionStep, read: Reading) -> str:
    return (
        f"step {number}, {step.words}: held-out error {read.length(step.before_test_rmse_m).text} "
        f"to {read.said(step.extended_test_rmse_m)}"
    )


def _row(name: str, train_m: float, test_m: float, floor_m: float | None, read: Reading) -> page.Row:
    return page.Row([name, read.length(train_m), read.length(test_m), times(test_m, floor_m)])


def _step(number: int, step: ExtensionStep, read: Reading) -> page.Html:
    rows = []
    for name, value in step.parameters.items():
        words, factor, unit = read.parameter(name)
        rows.append(page.Row([words, Shown(f"{factor * value:.4g}", f"{read.kind.text(name)} = {value:.6g}"), unit]))
    return page.section(
        f"step-{number}",
        f"Step {number}: {step.words}",
        page.text(f"Why: {step.why}."),
        page.subheading("What was fitted"),
        page.table(f"table-step-{number}", ["Parameter", "Value", "Unit"], rows),
    )
