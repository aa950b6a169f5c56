"""Signing in, and what a role may then do to a valve: which button is enabled.

Rights and confirmations come from `ValveCommands`, what an identification needs from `identify_permissives`.
"""

import time
from collections.abc import Callable

from nicegui import ui

from config.codes import Mode
from config.errors import InputError
from config.passwords import SignIn
from config.registers import register_named
from config.role_passwords import WRITERS
from config.roles import Role
from northbound.observer.identify_permissives import identify_permissives
from northbound.observer.last_moves import last_moves
from northbound.observer.valve_commands import EXCITATION, Confirmation, refusal_for
from northbound.observer.valve_view import TREND_S, ValvePicture
from northbound.observer.waiting_reference import reference_writer
from northbound.observer.watched_valves import WatchedValve
from northbound.operator_page.moves_ahead import Ahead
from northbound.operator_page.question_dialog import Answer, Question
from northbound.operator_page.signed_in import SignedIn
from webpage.messages import aside, heading
from webpage.number_field import NumberField
from webpage.page_words import in_page_words
from webpage.units import Units

NO_PASSWORDS = "Nobody can sign in: the page was started without --roles FILE."
YES, NO = "check_circle", "radio_button_unchecked"


class Door:
    """The button that signs in and out, with its dialog."""

    def __init__(self, sign_in: SignIn | None, signed: SignedIn) -> None:
        self._sign_in = sign_in
        self._signed = signed
        self._button = ui.button("Sign in", icon="login", on_click=self._handle_press).props(
            "flat dense no-caps color=white"
        )
        self._button.props('data-testid="door"')
        with ui.dialog() as self._dialog, ui.card():
            ui.label("Sign in").classes("text-h6")
            if sign_in is None:
                ui.label(NO_PASSWORDS)
                ui.button("Close", on_click=self._dialog.close).props("flat no-caps")
                return
            names = {role.name.lower(): role.name.lower() for role in WRITERS if role.name.lower() in sign_in.passwords}
            self._role = ui.select(names, label="role", value=next(iter(names), None)).classes("full-width")
            self._role.props('data-testid="role"')
            self._password = ui.input("password", password=True).classes("full-width").on("keydown.enter", self._try)
            self._password.props('autocomplete="current-password" data-testid="password"')
            self._said = ui.label().props('role="alert" data-testid="sign-in-said"')
            ui.button("Sign in", on_click=self._try).props('no-caps data-testid="enter"')

    def show(self) -> None:
        """Say who is signed in."""
        role = self._signed.at(time.monotonic())
        watches = role is Role.OBSERVER
        self._button.set_text("Sign in" if watches else f"{role.name.lower()}: sign out")
        self._button.set_icon("login" if watches else "logout")

    def _handle_press(self) -> None:
        if self._signed.at(time.monotonic()) is Role.OBSERVER:
            self._dialog.open()
        else:
            self._signed.begin(Role.OBSERVER, 0.0)
            self.show()

    async def _try(self) -> None:
        assert self._sign_in is not None
        role = str(self._role.value)
        said = await aside(self._sign_in.refused, role, str(self._password.value or ""))
        self._password.set_value("")
        self._said.set_text(said or "")
        if not said:
            self._signed.begin(Role[role.upper()], time.monotonic())
            self._dialog.close()
            self.show()


WRITTEN = {"reference": "reference", "acknowledge": "acknowledgement", "mode": "mode"} | {
    "manual_pressure": "pressure",
    "eta_1": "identification",
}
"""What a role is for, by one of its registers."""


def rights(role: Role) -> str:
    """Say what a role may not write, and who may.

    >>> rights(Role.ENGINEER), rights(Role.OPERATOR)
    ('engineer: you may write all', 'operator: to write mode, pressure, identification, sign in as engineer')
    """
    needed: dict[Role, list[str]] = {}
    for register, what in WRITTEN.items():
        if refusal_for(role, register) is not None:
            needed.setdefault(register_named(register).writer, []).append(what)
    denied = [f"to write {', '.join(what)}, sign in as {other.name.lower()}" for other, what in needed.items()]
    return f"{role.name.lower()}: {'; '.join(denied) or 'you may write all'}"


class Controls:
    """What may be done to one valve."""

    def __init__(self, valve: WatchedValve, signed: SignedIn, units: Units) -> None:
        self._valve = valve
        self._signed = signed
        self._units = units
        self._busy = False
        self._progress = 0.0
        self._parts: list[tuple[ui.element, tuple[str, ...]]] = []
        with ui.card().classes("full-width").props('data-testid="controls"'):
            heading("Controls")
            self._said = ui.label().props('role="status" aria-live="polite" data-testid="said"')
            self._bar = ui.linear_progress(0.0, show_value=False).props('aria-label="progress"')
            self._rights = ui.label().classes("quiet").props('data-testid="rights"')
            self._reference_row()
            self._mode_row()
            self._manual_row()
            self._acknowledge_row()
            self._identify_rows()
        self._question = Question()

    def show(self, picture: ValvePicture) -> None:
        """Show what the role may do now, and which permissives hold."""
        role = self._signed.at(time.monotonic())
        live = picture.freshness.live
        for element, registers in self._parts:
            allowed = live and not self._busy and refusal_for(role, *registers) is None
            element.set_enabled(allowed)  # type: ignore[attr-defined]
        self._rights.set_text(rights(role))
        permissives = identify_permissives(picture.values)
        ready = live and all(each.holds for each in permissives)
        for (icon, label), each in zip(self._permissives, permissives, strict=True):
            icon.set_name(YES if each.holds and live else NO)
            label.set_text(each.text if each.holds else in_page_words(each.remedy))
        if not ready:
            self._identify.set_enabled(False)
        self._break_off.set_visibility(self._busy)
        self._bar.set_visibility(self._busy)
        self._bar.set_value(round(self._progress, 2))
        if self._busy and self._progress:
            self._said.set_text(f"identification: {self._progress:.0%}")

    def redraw(self) -> None:
        """Say the unit of the pressure anew; what was typed was of another."""
        self._pressure.props["label"] = f"manual: pressure, {self._units.pressure.name}"
        self._pressure.set_value("")

    def _reference_row(self) -> None:
        with ui.row().classes("items-end full-width no-wrap"):
            self._reference = NumberField("reference, %", name="reference")
            self._reference.classes("col").props('data-testid="reference-input"').on(
                "keydown.enter", self._set_reference
            )
            button = ui.button("Set", on_click=self._set_reference).props('no-caps data-testid="set-reference"')
        self._parts += [(self._reference, ("reference",)), (button, ("reference",))]

    def _mode_row(self) -> None:
        with ui.row().classes("items-center"):
            ui.label("mode")
            for mode in Mode:
                button = ui.button(mode.text, on_click=lambda mode=mode: self._handle_choice(mode))
                button.props(f'no-caps outline dense data-testid="mode-{mode.text}"')
                self._parts.append((button, ("mode",)))

    def _manual_row(self) -> None:
        """The pressure of manual: it is commanded as soon as that is the mode."""
        with ui.row().classes("items-end full-width no-wrap"):
            self._pressure = NumberField(f"manual: pressure, {self._units.pressure.name}", name="pressure")
            self._pressure.classes("col").props('data-testid="pressure-input"')
            self._pressure.on("keydown.enter", lambda: self._handle_choice(Mode.MANUAL))
            button = ui.button("Command", on_click=lambda: self._handle_choice(Mode.MANUAL))
            button.props('no-caps data-testid="set-pressure"')
        self._parts += [(self._pressure, ("manual_pressure", "mode")), (button, ("manual_pressure", "mode"))]

    def _acknowledge_row(self) -> None:
        button = ui.button("Acknowledge the fault", on_click=lambda: self.do(self._valve.commands.acknowledge))
        self._parts.append((button.props('no-caps outline dense data-testid="acknowledge"'), ("acknowledge",)))

    def _identify_rows(self) -> None:
        self._permissives: list[tuple[ui.icon, ui.label]] = []
        with (
            ui.expansion("Identify the valve, which moves it")
            .classes("full-width")
            .props('dense data-testid="identify-box"')
        ):
            for each in identify_permissives({}):
                with ui.row().classes("items-center no-wrap"):
                    self._permissives.append((ui.icon(NO), ui.label(each.text)))
            with ui.row():
                self._identify = ui.button("Identify", on_click=self._ask_identification)
                self._identify.props('no-caps data-testid="identify"')
                self._break_off = ui.button("Break off", on_click=self._valve.commands.break_off)
                self._break_off.props('no-caps outline color=negative data-testid="break-off"')
        self._parts.append((self._identify, EXCITATION))

    async def _set_reference(self) -> None:
        try:
            reference = self._reference.number()
        except InputError as error:
            self._tell(f"✗ {error}")
            return
        if reference is None:
            self._tell("✗ reference: type a number")
            return
        await self.do(self._valve.commands.set_reference, reference / 100)

    async def _handle_choice(self, mode: Mode) -> None:
        """Ask before a mode in which the valve may move; hold moves nothing."""
        if mode is Mode.AUTOMATIC:
            await self._ask_automatic()
        elif mode is Mode.MANUAL:
            self._ask_manual()
        else:
            await self.do(self._valve.commands.set_mode, mode)

    async def _ask_automatic(self) -> None:
        ahead = await aside(self._ahead)

        async def automatic(goes: bool) -> None:
            await self.do(lambda role: self._valve.commands.automatic(role, ahead.waits_pu, goes=goes))

        stay = Answer(f"Stay at {ahead.stands}" if ahead.waits else "Automatic", "stay", lambda: automatic(False))
        go = Answer(f"Go to {ahead.waits}", "go", lambda: automatic(True))
        self._question.ask(
            "Automatic: the law moves the valve", ahead.automatic(), [go, stay] if ahead.waits else [stay]
        )

    def _ask_manual(self) -> None:
        """Ask for the pressure that is typed; where none is, for what is commanded now."""
        ahead = Ahead(self._valve.picture(), self._valve.view.stroke_m, self._units)
        unit = self._units.pressure
        try:
            typed = self._pressure.number()
        except InputError as error:
            self._tell(f"✗ {error}")
            return
        pressure_pa = ahead.picture.value("command") if typed is None else typed / unit.per_si

        async def manual() -> None:
            await self.do(lambda role: self._valve.commands.manual(role, pressure_pa))

        answers = [Answer(f"Command {unit.text(pressure_pa)}", "manual", manual)]
        self._question.ask("Manual: the pressure is commanded by hand", ahead.manual(pressure_pa), answers)

    async def _ask_identification(self) -> None:
        ahead = await aside(self._ahead)

        async def identify() -> None:
            await self.do(self._begin_identification)

        answers = [Answer("Identify", "identify", identify)]
        self._question.ask("Identify: the valve moves", ahead.identification(), answers)

    def _ahead(self) -> Ahead:
        """Return what is known of the valve now; reads files."""
        place, view = self._valve.place, self._valve.view
        moves = last_moves(view, time.monotonic(), TREND_S, None, time.time())
        writer = reference_writer(place.history, place.name)
        response = moves.response if moves else None
        return Ahead(self._valve.picture(), view.stroke_m, self._units, place.settings, writer, response)

    def _begin_identification(self, role: Role) -> Confirmation:
        def show(progress: float) -> None:
            self._progress = progress

        return self._valve.commands.identify(role, {}, show)

    async def do(self, command: Callable[..., Confirmation], *arguments: object) -> None:
        """Have a command done by a thread, and say what the daemon reads back."""
        if self._busy:
            return
        role = self._signed.at(time.monotonic())
        self._busy, self._progress = True, 0.0
        self._said.set_text("…")
        try:
            confirmation = await aside(command, role, *arguments)
        finally:
            self._busy = False
        if role is not Role.OBSERVER:
            self._signed.begin(role, time.monotonic())
        self._tell(("✓ " if confirmation.done else "✗ ") + in_page_words(confirmation.text))

    def _tell(self, said: str) -> None:
        """Say what became of a command, and when: it stays until the next."""
        self._said.set_text(f"{time.strftime('%H:%M:%S')} {said}")
