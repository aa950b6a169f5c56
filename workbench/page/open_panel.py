"""Where a recording and a valve come onto the desk: dropped, chosen, made from a data sheet, or hidden."""

import secrets
from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path

from nicegui import events, ui

from config.data_sheet import DataSheet, from_data_sheet
from config.errors import InputError
from config.loading import SHIPPED
from config.valve_file_writer import write_valve
from webpage.drop_box import drop_box
from webpage.messages import aside, errors_told, heading, sentences
from webpage.number_field import NumberField
from webpage.theme import Theme
from workbench.page.columns_panel import ColumnsPanel
from workbench.page.desk import Desk, name_valve
from workbench.page.provenance import DataSheetMade, NamedValve
from workbench.page.recording_opening import Export, Opened, open_file, open_file_like, wrong_with

SUFFIXES = (".csv", ".txt", ".parquet", ".xlsx", ".mat")
"""Of files that a folder offers."""
MOST_BUTTONS = 48
"""Files that are offered by a button each."""
MOST_BLIND = 10_000  # seeds that are drawn from


class OpenPanel:
    """The panel; `changed` is called when a recording or a valve is on the desk that was not."""

    def __init__(self, desk: Desk, theme: Theme, files: Sequence[Path], changed: Callable[[], None]) -> None:
        self._desk = desk
        self._theme = theme
        self._changed = changed
        with ui.element("section").classes("together"):
            with ui.column().classes("wide"):
                self._recording(files)
                self._mapping = ui.column().classes("w-full")
                self._remarks = ui.column().classes("w-full")
            with ui.column().classes("side"):
                self._valve()
        self.refresh()

    def refresh(self) -> None:
        """Show what is on the desk."""
        if self._desk.valve is not None:
            self._show_name(self._desk.valve.name)
        self._mapping.clear()
        self._remarks.clear()
        desk = self._desk
        if desk.export is not None:
            with self._mapping:
                ColumnsPanel(desk, desk.export, self._theme, self._take_told)
        if desk.opened is None:
            return
        recording = desk.opened.recording
        with self._remarks:
            ui.label(f"{desk.opened.name}: {recording.summary().splitlines()[0]}").props('data-testid="opened"')
            stroke_m = desk.valve.file.valve.stroke_m if desk.valve else None
            said = wrong_with(desk.opened, stroke_m)
            sentences(said or ("no samples were left out",), "wrong")
            if desk.live is not None:
                self._offer_second()
            if desk.valve is None:
                ui.label("choose a valve").classes("quiet")

    def _recording(self, files: Sequence[Path]) -> None:
        heading("Recording")
        drop_box("drop a recording here, or press +: CSV, Excel, MATLAB, Parquet", "drop", self._handle_drop)
        self._offer_files(files)
        with ui.row().classes("items-center"):
            ui.button("Blind practice", icon="visibility_off", on_click=self._blind).props("outline no-caps")
            ui.label("a recording with a hidden effect; the answer is sealed").classes("quiet")

    def _offer_files(self, files: Sequence[Path]) -> None:
        """Offer the files of a command line, a line a folder: each is a button, of many folders' a list."""
        if len(files) > MOST_BUTTONS:
            names = [str(path) for path in files]
            listed = ui.select(
                names, label="or one of the folder", on_change=lambda event: self._handle_choice(event.value)
            )
            listed.classes("w-full").props('data-testid="files"')
            return
        for folder, group in groupby(files, key=lambda path: path.parent):
            with ui.row().classes("items-center w-full").style("gap: 4px").props('data-testid="files"'):
                ui.label(f"{folder.resolve().name}:").classes("quiet")
                for path in group:
                    button = ui.button(path.name, on_click=lambda path=path: self._handle_choice(str(path)))
                    button.props("outline dense no-caps")

    def _offer_second(self) -> None:
        """Offer to take a second recording for what no fit sees."""
        held = self._desk.held_out
        said = f"held out: {held.name}" if held else "held out: its last third"
        with ui.expansion(said, icon="content_cut").classes("w-full").props('data-testid="held-out"'):
            drop_box("drop another recording of the same valve", "drop-held-out", self._handle_second_drop)
            if held:
                ui.button("Hold out the last third", on_click=lambda: self._hold_out(None)).props("outline no-caps")

    async def _handle_second_drop(self, event: events.UploadEventArguments) -> None:
        assert self._desk.opened is not None
        path = await self._keep_file(event)
        event.sender.run_method("reset")
        with errors_told({str(path): event.file.name, "recording": event.file.name}):
            await self._hold_out(await aside(open_file_like, path, event.file.name, self._desk.opened))

    async def _hold_out(self, held: Opened | None) -> None:
        await aside(self._desk.hold_out, held)
        self._changed()

    def _valve(self) -> None:
        heading("Valve")
        shipped = sorted(path.stem for path in (SHIPPED / "valves").glob("*.toml"))
        self._names = ui.select(shipped, label="valve", on_change=lambda event: self._handle_name(event.value))
        self._names.classes("w-full").props('data-testid="valve"')
        drop_box("or drop a valve file, .toml", "drop-valve", self._valve_dropped, ".toml")
        with ui.expansion("from a data sheet", icon="straighten").classes("w-full"):
            self._data_sheet()

    def _data_sheet(self) -> None:
        area = NumberField("diaphragm area, cm²", 700.0)
        low = NumberField("bench range from, bar", 0.2)
        high = NumberField("bench range to, bar", 1.0)
        stroke = NumberField("stroke, mm", 40.0)
        friction = NumberField("friction, % of range (PTFE 2-6, graphite 5-15)", 5.0)
        ratio = NumberField("break-away over sliding friction", 1.3)
        told = ui.column()

        async def make_valve() -> None:
            with errors_told():
                area_cm2, low_bar, high_bar, stroke_mm = (each.number() for each in (area, low, high, stroke))
                if area_cm2 is None or low_bar is None or high_bar is None or stroke_mm is None:
                    raise InputError("data sheet", "area, bench range and stroke are needed")
                sheet = DataSheet(area_cm2, (low_bar, high_bar), stroke_mm, friction.number(), ratio.number())
                file, given, assumed = from_data_sheet(sheet)
                path = self._desk.folder / "data-sheet.toml"
                write_valve(path, file)
                told.clear()
                with told:
                    sentences([*given, *(f"assumed: {each}" for each in assumed)], "assumed")
                await aside(self._desk.take_valve, NamedValve(path.name, path, file, DataSheetMade(sheet)))
                self._changed()

        for each in (area, low, high, stroke, friction, ratio):
            each.classes("w-full").props("dense")
        ui.button("Make the valve", on_click=make_valve).props("outline no-caps")

    async def _handle_drop(self, event: events.UploadEventArguments) -> None:
        path = await self._keep_file(event)
        event.sender.run_method("reset")
        with errors_told({str(path): event.file.name, "recording": event.file.name}):
            await self._found(await aside(open_file, path, event.file.name))

    async def _handle_choice(self, text: str) -> None:
        path = Path(text)
        with errors_told():
            await self._found(await aside(open_file, path, text))

    async def _found(self, found: Opened | Export) -> None:
        if isinstance(found, Export):
            self._desk.export = found
            self.refresh()
        else:
            await self._take(found)

    async def _take_told(self, found: Opened) -> None:
        with errors_told():
            await self._take(found)

    async def _take(self, found: Opened) -> None:
        await aside(self._desk.take_recording, found)
        self._changed()

    async def _valve_dropped(self, event: events.UploadEventArguments) -> None:
        path = await self._keep_file(event)
        event.sender.run_method("reset")
        with errors_told({str(path): path.name, "valve file": path.name}):
            await self._take_valve(str(path), path.name)

    async def _handle_name(self, name: str | None) -> None:
        if name is None or (self._desk.valve and self._desk.valve.name == name):
            return
        with errors_told():
            await self._take_valve(name)
        self._show_name(self._desk.valve.name if self._desk.valve else None)

    async def _take_valve(self, text: str, name: str = "") -> None:
        await aside(self._desk.take_valve, name_valve(text, name))
        self._changed()

    async def _blind(self) -> None:
        with errors_told():
            await aside(self._desk.blind_practice, secrets.randbelow(MOST_BLIND))
            self._changed()

    def _show_name(self, name: str | None) -> None:
        if name is not None and name not in self._names.options:
            self._names.options = [name, *self._names.options]
        self._names.set_value(name)
        self._names.update()

    async def _keep_file(self, event: events.UploadEventArguments) -> Path:
        """Keep a dropped file under its last name, which says what kind it is; nothing else of its path is taken."""
        path = self._desk.folder / Path(event.file.name).name
        await event.file.save(path)
        return path


def files_of(paths: Sequence[Path]) -> list[Path]:
    """Return the recordings that a command line named, those of its folders and of the folders in these too.

    Raises:
        InputError: there is none of that name.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            for folder in (path, *sorted(each for each in path.iterdir() if each.is_dir())):
                found += sorted(each for each in folder.iterdir() if each.suffix.lower() in SUFFIXES)
        elif path.is_file():
            found.append(path)
        else:
            raise InputError(str(path), "is not there")
    return found
