"""All valves, a line each."""

from collections.abc import Callable

from nicegui import ui

from positioner.observer.valve_view import ValvePicture
from positioner.pages.operator_page.facts import condition, figures
from positioner.pages.operator_page.units import Units
from positioner.pages.operator_page.watched_valves import WatchedValve

HEADINGS = ("valve", "NE 107", "mode", "state", "reference", "position", "pressure", "fault")


class Overview:
    """The table of all valves; a valve's name opens it."""

    def __init__(self, valves: list[WatchedValve], units: Units, choose: Callable[[str], None]) -> None:
        self._units = units
        self._rows: dict[str, tuple[ui.element, list[ui.label], ui.label]] = {}
        with ui.element("div").classes("scrolling full-width"), ui.element("table").classes("facts wide-facts"):
            with ui.element("thead"), ui.element("tr"):
                for heading in HEADINGS:
                    ui.html(heading, tag="th")
            with ui.element("tbody"):
                for valve in valves:
                    name = valve.place.name
                    with ui.element("tr") as row:
                        with ui.element("td"):
                            ui.button(name, on_click=lambda name=name: choose(name)).props("flat dense no-caps")
                            stale = ui.label().classes("quiet")
                        cells = []
                        for _ in HEADINGS[1:]:
                            with ui.element("td"):
                                cells.append(ui.label().classes("number"))
                    self._rows[name] = (row.props(f'data-testid="row-{name}"'), cells, stale)

    def show(self, picture: ValvePicture, stroke_m: float) -> None:
        """Show a valve as it is now, or that it is not known how it is."""
        row, cells, stale = self._rows[picture.name]
        letter, words, causes = condition(picture)
        numbers = figures(picture, stroke_m, self._units)
        said = [
            words + (f": {causes[0]}" if letter and causes else ""),
            *(picture.text(name) for name in ("mode", "state")),
            *(numbers[name] for name in ("reference", "position", "pressure")),
            picture.text("fault"),
        ]
        for cell, text in zip(cells, said, strict=True):
            cell.set_text(text)
        stale.set_text(picture.freshness.daemon)
        row.classes(add="stale") if not picture.freshness.live else row.classes(remove="stale")
