"""What was added, how the error fell, the way back, and what is taken home: valve file, report, command lines."""

from collections.abc import Callable
from pathlib import Path

from nicegui import ui

from positioner.pages.parts.figure_view import Figure, FigureView
from positioner.pages.parts.telling import aside, errors_told, heading
from positioner.pages.parts.theme import Theme
from positioner.pages.workbench_page.command_lines import command_lines
from positioner.pages.workbench_page.desk import Desk
from positioner.pages.workbench_page.notebook import notebook
from workbench.blind.sealing import reveal
from workbench.report import Subject, report_comparison, report_diagnosis
from workbench.report.ranking import error_reduction

FALL_PX = 320


class JournalPanel:
    """The panel; `changed` is called when another valve is on the desk, with the heading of interest."""

    def __init__(self, desk: Desk, theme: Theme, changed: Callable[[str], None]) -> None:
        self._desk = desk
        self._changed = changed
        if desk.journal:
            heading("How the error fell", "journal")
            FigureView(theme, self._drawn, FALL_PX, "how the error fell")
            ui.label("dashed: the floor").classes("quiet")
            for number, step in enumerate(desk.journal, start=1):
                added = ", ".join(step.extension.effects)
                ui.label(desk.plain(f"{number}. {added}: {step.extension.summary().splitlines()[0]}")).props(
                    'data-testid="journal-step"'
                )
            back = ui.button("Take the last step back", icon="undo", on_click=self._back)
            back.props('outline no-caps data-testid="back"')
        heading("Take it home")
        with ui.row():
            ui.button("Valve file", icon="save", on_click=self._save).props('no-caps data-testid="save"')
            ui.button("Report", icon="description", on_click=self._report).props("outline no-caps")
            ui.button("Notebook", icon="menu_book", on_click=self._notebook).props(
                'outline no-caps data-testid="notebook"'
            )
            if desk.sealed is not None:
                ui.button("Reveal what was hidden", icon="visibility", on_click=self._reveal).props("outline no-caps")
        self._answer = ui.column()
        ui.label("the same on a command line:").classes("quiet")
        ui.code("\n".join(command_lines(desk)), language="bash").classes("w-full")

    def _drawn(self) -> Figure:
        """Every model on the way, as the report of a journal draws it: fitted, held out, and the floor."""
        stages = []
        for number, step in enumerate(self._desk.journal, start=1):
            for name, (train_m, test_m) in step.extension.stages.items():
                if number == 1 or name.startswith("with"):
                    stages.append((self._desk.plain(name), train_m, test_m))
        return error_reduction(stages, self._desk.journal[-1].extension.split.floor_m, self._desk.errors)

    async def _back(self) -> None:
        with errors_told():
            await aside(self._desk.walk_back)
            self._changed("comparison")

    def _save(self) -> None:
        with errors_told():
            assert self._desk.valve is not None
            ui.download.content(self._desk.toml, self._desk.valve.path.name)
            for name, path in self._desk.effects.items():
                if f"./{name}.py" in self._desk.toml:
                    ui.download.content(path.read_bytes(), path.name)

    def _notebook(self) -> None:
        with errors_told():
            ui.download.content(notebook(self._desk), "workbench.ipynb", "application/x-ipynb+json")

    async def _report(self) -> None:
        with errors_told():
            path = self._desk.folder / "report.html"
            await aside(self._write_report, path)
            ui.download.content(path.read_bytes(), path.name, "text/html")

    def _write_report(self, path: Path) -> None:
        desk = self._desk
        assert desk.opened is not None
        assert desk.live is not None
        valve = desk.found.valve if desk.found else desk.live.valve
        subject = Subject(valve, (desk.opened.name,), desk.opened.recording.metadata)
        if desk.found is not None:
            report_diagnosis(desk.found.result, path, subject, command_lines(desk))
        else:
            report_comparison(desk.compare(), path, subject)

    def _reveal(self) -> None:
        with errors_told():
            assert self._desk.sealed is not None
            _, answer = reveal(self._desk.sealed)
            self._answer.clear()
            with self._answer:
                for effect in answer["effects"]:
                    told = ", ".join(f"{key} = {value:.4g}" for key, value in effect.items() if key != "name")
                    ui.label(f"hidden: {effect['name']}, {told}").props('data-testid="hidden"')
