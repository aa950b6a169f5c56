"""The list of a valve's alarms: state, cause and advice; acknowledged, and shelved for a while, by who may."""

import time
from collections.abc import Callable, Coroutine, Mapping
from functools import partial
from typing import Any

from nicegui import ui

from config.codes import AlarmState
from northbound.observer.seen_alarms import SeenAlarm, alarms
from northbound.observer.valve_commands import Confirmation, ValveCommands, refusal_for
from northbound.observer.valve_view import ValvePicture
from northbound.operator_page.signed_in import SignedIn
from webpage.messages import heading

SHELVED_FOR_S: Mapping[str, float] = {"30 min": 1800.0, "2 h": 7200.0, "8 h": 28800.0}
"""A talk, an errand, a shift."""
Do = Callable[..., Coroutine[Any, Any, None]]


class AlarmCard:
    """The alarms of one valve.

    Args:
        commands: to it.
        signed: who is in front of the page.
        do: has a command done, and says what became of it.
    """

    def __init__(self, commands: ValveCommands, signed: SignedIn, do: Do) -> None:
        self._commands, self._signed, self._do = commands, signed, do
        self._shown: tuple[list[SeenAlarm], bool, float] | None = None
        with ui.card().classes("full-width").props('data-testid="alarms"'):
            heading("Alarms")
            self._rows = ui.element("div").classes("full-width column")

    def show(self, picture: ValvePicture) -> None:
        """Show the alarms, where they are other than before; a button for each thing that this role may do."""
        role = self._signed.at(time.monotonic())
        may = picture.freshness.live and refusal_for(role, "alarm_acknowledge") is None
        until_s = picture.value("alarms_shelved_until")
        shown = (list(alarms(picture.values)), may, until_s)
        if shown == self._shown:
            return
        self._shown = shown
        self._rows.clear()
        with self._rows:
            for each in shown[0]:
                self._row(each, may, until_s)
            if not shown[0]:
                ui.label("none")

    def _row(self, alarm: SeenAlarm, may: bool, until_s: float) -> None:
        shelved = alarm.state is AlarmState.SHELVED
        state = alarm.state.text
        if shelved and until_s > 0.0:
            state += f", the first till {time.strftime('%H:%M', time.localtime(until_s))}"
        with ui.element("div").classes("alarm-row full-width").props(f'data-testid="alarm-{alarm.name}"'):
            ui.label(alarm.text).classes("unseen" if alarm.unseen else "")
            ui.label(state).classes("quiet")
            ui.label(alarm.advice).classes("quiet")
            with ui.row().classes("items-center"):
                if alarm.unseen:
                    self._button("Acknowledge", may, self._commands.acknowledge_alarm, alarm.cause)
                if shelved:
                    self._button("Show again", may, self._commands.shelve_alarm, alarm.cause, 0.0)
                else:
                    for name, for_s in SHELVED_FOR_S.items():
                        self._button(f"Shelve {name}", may, self._commands.shelve_alarm, alarm.cause, for_s)

    def _button(self, label: str, may: bool, command: Callable[..., Confirmation], *arguments: object) -> None:
        button = ui.button(label, on_click=partial(self._do, command, *arguments)).props("no-caps outline dense")
        button.set_enabled(may)
