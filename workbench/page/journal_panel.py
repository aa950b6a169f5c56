"""What was added, how the error fell, the way back, and what is taken home: valve file, report, command lines."""

from collections.abc import Callable
from pathlib import Path

from nicegui import ui

from webpage.figure_view import Figure, FigureView
from webpage.messages import aside, errors_told, heading
from webpage.theme import Theme
from workbench.blind.sealing import reveal
from workbench.diagnosis.extension_journal import ExtensionStep
from workbench.page.command_lines import command_lines
from workbench.page.desk import Desk
from workbench.page.notebook import notebook
from workbench.page.provenance import refitting
from workbench.report import Subject, report_comparison, report_diagnosis
from workbench.report.display_units import Reading
from workbench.report.effect_ranking import error_reduction
from workbench.report.journal_report import journal_sections

FALL_PX = 320


class JournalPanel:
    """The panel; `changed` is called when another valve is on the desk, with the heading of interest."""

    def __init__(self, desk: Desk, theme: Theme, changed: Callable[[str], None]) -> None:
        self._desk = desk
        self._changed = changed
        if desk.journal:
            heading("How the error fell", "journal")
            FigureView(theme, self._draw, FALL_PX, "how the error fell")
            ui.label("dashed: the floor").classes("quiet")
            for number, step in enumerate(map(refitting, desk.journal), start=1):
                ui.label(desk.plain(f"{number}. {step.extension.summary().splitlines()[0]}")).props(
                    'data-testid="journal-step"'
                )
            back = ui.button("Undo the last step", icon="undo", on_click=self._back)
            back.props('outline no-caps data-testid="back"')
        heading("Save and export")
        with ui.row():
            ui.button("Valve file", icon="save", on_click=self._save).props('no-caps data-testid="save"')
            ui.button("Report", icon="description", on_click=self._report).props("outline no-caps")
            ui.button("Notebook", icon="menu_book", on_click=self._notebook).props(
                'outline no-caps data-testid="notebook"'
            )
            if desk.sealed is not None:
                ui.button("Reveal the hidden effect", icon="visibility", on_click=self._reveal).props("outline no-caps")
        self._answer = ui.column()
        ui.label("the same on a command line:").classes("quiet")
        self._commands = ui.column().classes("w-full").props('data-testid="commands"')
        self.retell()

    def retell(self) -> None:
        """Show the command lines anew: a slider was moved, or something was found."""
        self._commands.clear()
        with self._commands, errors_told():
            ui.code("\n".join(command_lines(self._desk)), language="bash").classes("w-full")

    def _draw(self) -> Figure:
        """Every model on the way, as the report of a journal draws it: fitted, held out, and the floor."""
        stages = []
        extensions = [refitting(each).extension for each in self._desk.journal]
        for number, extension in enumerate(extensions, start=1):
            for i, (name, (train_m, test_m)) in enumerate(extension.stages.items()):
                if number == 1 or i == len(extension.stages) - 1:
                    stages.append((self._desk.plain(name), train_m, test_m))
        return error_reduction(stages, extensions[-1].split.floor_m, self._desk.errors)

    async def _back(self) -> None:
        with errors_told():
            await aside(self._desk.walk_back)
            self._changed("comparison")

    def _save(self) -> None:
        with errors_told():
            ui.download.content(self._desk.toml, self._desk.as_set().path.name)
            for name, path in self._desk.effects.items():
                if f"./{name}.py" in self._desk.toml:
                    ui.download.content(path.read_bytes(), path.name)

    def _notebook(self) -> None:
        with errors_told():
            ui.download.content(notebook(self._desk), "workbench.ipynb", "application/x-ipynb+json")

    async def _report(self) -> None:
        with errors_told():
            path = self._desk.folder / "report.html"
            await aside(write_report, self._desk, path)
            ui.download.content(path.read_bytes(), path.name, "text/html")

    def _reveal(self) -> None:
        with errors_told():
            assert self._desk.sealed is not None
            _, answer = reveal(self._desk.sealed)
            self._answer.clear()
            with self._answer:
                for effect in answer["effects"]:
                    told = ", ".join(f"{key} = {value:.4g}" for key, value in effect.items() if key != "name")
                    ui.label(f"hidden: {effect['name']}, {told}").props('data-testid="hidden"')


def write_report(desk: Desk, path: Path) -> None:
    """Write the report of what is on a desk: of its diagnosis, or, where another valve is there by now, of that.

    Raises:
        InputError: plotly is not installed, or the file cannot be written.
    """
    assert desk.opened is not None
    assert desk.live is not None
    found, journal = desk.found, desk.journal
    files = tuple(each.name for each in (desk.opened, desk.held_out) if each)
    if found is not None and desk.live.valve in (found.begins.file, found.result.best.fit.valve):
        subject = Subject(found.begins.file, files, desk.opened.recording.metadata)
        report_diagnosis(found.result, path, subject, command_lines(desk))
        return
    steps = tuple(ExtensionStep.of(refitting(each).extension) for each in journal)
    subject = Subject(desk.live.valve, files, desk.opened.recording.metadata)
    grown = journal_sections(steps, Reading(desk.live.valve.valve.own)) if steps else ()
    report_comparison(desk.compare(), path, subject, grown)
