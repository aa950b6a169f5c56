"""All valves, a card each."""

from collections.abc import Callable
from dataclasses import dataclass

from nicegui import ui

from northbound.observer.valve_view import ValvePicture
from northbound.observer.watched_valves import WatchedValve
from northbound.operator_page.status_marks import grey, mark_ne107
from northbound.operator_page.valve_facts import condition, figures
from webpage.units import Units

LINES = ("reference", "pressure", "mode", "state", "fault")


@dataclass(frozen=True, slots=True)
class _Card:
    """What changes of a card."""

    body: ui.element
    stale: ui.label
    position: ui.label
    ne107: ui.label
    causes: ui.label
    lines: dict[str, ui.label]


class Overview:
    """The cards of all valves; a valve's name opens it."""

    def __init__(self, valves: list[WatchedValve], units: Units, choose: Callable[[str], None]) -> None:
        self._units = units
        self._cards: dict[str, _Card] = {}
        with ui.element("div").classes("overview"):
            for valve in valves:
                self._cards[valve.place.name] = _card(valve.place.name, choose)

    def show(self, picture: ValvePicture, stroke_m: float) -> None:
        """Show a valve as it is now, or that it is not known how it is."""
        card = self._cards[picture.name]
        letter, words, causes = condition(picture)
        said = figures(picture, stroke_m, self._units)
        said |= {name: picture.text(name) for name in ("mode", "state", "fault")}
        for name, label in card.lines.items():
            label.set_text(said[name])
        card.position.set_text(said["position"])
        card.ne107.set_text(words)
        mark_ne107(card.ne107, letter)
        card.causes.set_text("; ".join(causes))
        card.stale.set_text(picture.freshness.daemon or picture.freshness.measurement)
        card.stale.set_visibility(not picture.freshness.measured_live)
        grey(card.body, not picture.freshness.live)


def _card(name: str, choose: Callable[[str], None]) -> _Card:
    with ui.card().props(f'data-testid="valve-{name}"'):
        with ui.row().classes("items-center full-width justify-between"):
            ui.button(name, on_click=lambda: choose(name)).props("flat dense no-caps").classes("text-subtitle1")
        stale = ui.label().classes("alarm").props('role="alert"')
        with ui.element("div").classes("full-width") as body:
            position = ui.label().classes("figure number")
            ne107 = ui.label()
            causes = ui.label().classes("quiet")
            lines = {}
            with ui.element("dl").classes("facts"):
                for line in LINES:
                    ui.html(line, tag="dt", sanitize=False)
                    with ui.element("dd"):
                        lines[line] = ui.label().classes("number")
    return _Card(body, stale, position, ne107, causes, lines)
