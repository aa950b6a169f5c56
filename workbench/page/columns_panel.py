"""Which column is which: the proposal filled in, and what the recording would look like before it is taken."""

import math
from collections.abc import Awaitable, Callable

from nicegui import ui

from config.errors import InputError
from config.loading import validate
from webpage.figure_view import Figure, FigureView
from webpage.messages import aside, heading, sentences
from webpage.number_field import NumberField
from webpage.theme import Theme
from workbench.imports.column_mapping import RANGE_PA, list_units
from workbench.imports.export_mapping import ExportMapping
from workbench.page.desk import Desk
from workbench.page.export_figure import export_figure
from workbench.page.recording_opening import OURS, Export, Opened, map_export, split_column, wrong_with

NONE, AS_SAID = "", ""
WORDS = {
    "time_s": "time",
    "position_m": "stem position",
    "command_pa": "command",
    "reference_m": "set point",
    "pressure_pa": "actuator pressure",
    "load_n": "load",
}
ASKED = {
    "--stroke-m": "stroke",
    "--column": "column",
    "--time-format": "how dates are written",
    "--period-s": "time between rows",
}
"""What options of a command line are called here."""
PREVIEW_PX = 320


class ColumnsPanel:
    """The choice for one export; `take` is given what was read as chosen."""

    def __init__(self, desk: Desk, export: Export, theme: Theme, take: Callable[[Opened], Awaitable[None]]) -> None:
        self._desk = desk
        self._export = export
        self._theme = theme
        self._take = take
        self._proposed = export.preview.proposal.mapping
        self._asked = 0
        self._read: Opened | None = None
        heading(f"{export.name}: which column is which?")
        ui.label(f"{export.preview.what}; {export.preview.header}").classes("quiet")
        sentences(export.preview.proposal.open, "open")
        with ui.element("div").classes("together"):
            with ui.column().classes("side"):
                self._columns = {ours: self._column(ours) for ours in OURS}
                unit = desk.units.length_unit()
                stroke_m = desk.valve.file.valve.stroke_m if desk.valve else None
                value = None if stroke_m is None else round(unit.per_si * stroke_m, 6)
                self._stroke = NumberField(f"stroke, {unit.name}, if position is in %", value, name="--stroke-m")
                self._time_format = ui.input("how dates are written", value=self._proposed.time_format or "")
                self._ends = [self._end(end, usual) for end, usual in zip(("0", "100"), RANGE_PA, strict=True)]
                self._period = NumberField("time between rows, s, if no column is a time", name="--period-s")
                self._period.props('data-testid="period"')
                for each in (self._stroke, self._time_format, *self._ends, self._period):
                    each.props("dense").classes("w-full").on("blur", self._show)
            with ui.column().classes("wide"):
                self._preview = ui.column().classes("w-full").props('data-testid="preview" aria-live="polite"')
                self._confirm = ui.button("Read it", on_click=self._take_columns).props('no-caps data-testid="confirm"')
                with ui.expansion("first values of every column", icon="table_rows").classes("w-full"):
                    self._table()
        ui.timer(0.0, self._show, once=True)

    def _column(self, ours: str) -> tuple[ui.select, ui.select]:
        name, unit = split_column(ours, self._proposed.theirs.get(ours, ""))
        names = [each.name for each in self._export.preview.columns]
        columns = dict.fromkeys([*names, name]) | {NONE: "not there"}
        columns = {key: text or key for key, text in columns.items()}
        units = {AS_SAID: "as it says, or SI"} | {each: each for each in list_units(ours)}
        with ui.row().classes("w-full no-wrap items-end").style("gap: 8px"):
            column = ui.select(columns, value=name, label=WORDS[ours], on_change=self._show, with_input=False)
            column.props(f'dense data-testid="column-{ours}"').style("flex: 3 1 0; min-width: 0")
            shown = ui.select(units, value=unit, label="unit", on_change=self._show)
            shown.props(f'dense data-testid="unit-{ours}"').style("flex: 2 1 0; min-width: 0")
        return column, shown

    def _end(self, end: str, usual_pa: float) -> NumberField:
        unit = self._desk.units.pressure
        value = round(unit.per_si * usual_pa, 6)
        field = NumberField(f"pressure at {end} %, {unit.name}, if a command is in % or mA", value)
        field.props(f'data-testid="pressure-{end}"')
        return field

    def _range_pa(self) -> tuple[float, float] | None:
        """Return the ends of a pressure's range; None where they are as they stood there: assumed, and told."""
        per_si = self._desk.units.pressure.per_si
        ends = [each.number() for each in self._ends]
        if None in ends or ends == [round(per_si * each, 6) for each in RANGE_PA]:
            return None
        low, high = (end / per_si for end in ends if end is not None)
        return low, high

    def _choice(self) -> ExportMapping:
        said = [
            f"{ours}={column.value}{f':{unit.value}' if unit.value else ''}"
            for ours, (column, unit) in self._columns.items()
            if column.value
        ]
        stroke = self._stroke.number()
        stroke_m = stroke / self._desk.units.length_unit().per_si if stroke else None
        typed = {
            "column": said,
            "stroke_m": stroke_m,
            "time_format": self._time_format.value or None,
            "range_pa": self._range_pa(),
            "period_s": self._period.number(),
        }
        return validate(ExportMapping, self._proposed.model_dump() | typed, self._export.name)

    async def _show(self) -> None:
        """Read it as chosen and show what it would be, or why it cannot be read so."""
        self._asked += 1
        mine = self._asked
        self._confirm.set_enabled(False)
        try:
            choice = self._choice()
            read = await aside(map_export, self._export, choice)
            said = await aside(wrong_with, read, choice.stroke_m)
        except InputError as error:
            asked = ASKED.get(error.source, self._export.name)
            self._put(mine, None, [f"{asked}: {error.problem}"])
            return
        self._put(mine, read, list(said), choice.stroke_m)

    def _put(self, asked: int, read: Opened | None, said: list[str], stroke_m: float | None = None) -> None:
        if asked != self._asked or self._preview.is_deleted:
            return
        self._read = read
        self._confirm.set_enabled(read is not None)
        self._preview.clear()
        with self._preview:
            if read is None:
                ui.label("This cannot be read:").classes("text-weight-medium")
            else:
                ui.label(f"Read so: {read.recording.summary().splitlines()[0]}").classes("text-weight-medium")
                FigureView(
                    self._theme, lambda: self._draw(read, stroke_m), PREVIEW_PX, "the recording as it would be read"
                )
            sentences(said, "preview-said")

    def _draw(self, read: Opened, stroke_m: float | None) -> Figure:
        return export_figure(read.recording, math.nan if stroke_m is None else stroke_m, self._desk.units)

    def _table(self) -> None:
        rows = [
            {"name": each.name, "unit": each.unit or "", "first": ", ".join(map(str, each.cells[:3]))}
            for each in self._export.preview.columns
        ]
        heads = {"name": "column", "unit": "unit", "first": "first values"}
        columns = [{"name": key, "label": head, "field": key, "align": "left"} for key, head in heads.items()]
        ui.table(rows=rows, columns=columns, row_key="name").props("dense flat bordered").classes("w-full")

    async def _take_columns(self) -> None:
        if self._read is not None:
            await self._take(self._read)
