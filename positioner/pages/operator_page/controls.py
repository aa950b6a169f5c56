"""Signing in, and what a role may then do to a valve. Rights, permissives and confirmations come from `ValveCommands`.

A role holds for one tab, and for `SIGNED_IN_S` after its last command.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

from nicegui import ui

from config.codes import Mode
from config.errors import InputError
from config.passwords import SignIn
from config.role_passwords import WRITERS
from config.roles import Role
from positioner.observer.permissives import identify_permissives
from positioner.observer.valve_commands import EXCITATION, Confirmation, refusal_for
from positioner.observer.valve_view import ValvePicture
from positioner.observer.watched_valves import WatchedValve
from positioner.pages.parts.number_field import NumberField
from positioner.pages.parts.telling import aside, heading

SIGNED_IN_S = 900.0
NO_PASSWORDS = "Nobody can sign in: the page was started without --roles FILE."
YES, NO = "check_circle", "radio_button_unchecked"


@dataclass(slots=True)
class SignedIn:
    """Which role the person in front of a tab has, and until when, s; an observer's never ends."""

    role: Role = Role.OBSERVER
    until_s: float = 0.0

    def at(self, now_s: float) -> Role:
        """Return the role at a time, on the monotonic clock."""
        if now_s >= self.until_s:
            self.role = Role.OBSERVER
        return self.role

    def begin(self, role: Role, now_s: float) -> None:
        """Take a role, or keep it for longer."""
        self.role, self.until_s = role, now_s + SIGNED_IN_S


class Door:
    """The button that signs in and out, with its dialog."""

    def __init__(self, sign_in: SignIn | None, signed: SignedIn) -> None:
        self._sign_in = sign_in
        self._signed = signed
        self._button = ui.button("Sign in", icon="login", on_click=self._pressed).props(
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

    def _pressed(self) -> None:
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


class Controls:
    """What may be done to one valve."""

    def __init__(self, valve: WatchedValve, signed: SignedIn) -> None:
        self._valve = valve
        self._signed = signed
        self._busy = False
        self._progress = 0.0
        self._parts: list[tuple[ui.element, tuple[str, ...]]] = []
        with ui.card().classes("full-width").props('data-testid="controls"'):
            heading("Controls")
            self._rights = ui.label().classes("quiet").props('data-testid="rights"')
            self._reference_row()
            self._mode_row()
            self._acknowledge_row()
            self._identify_rows()
            self._said = ui.label().props('role="status" aria-live="polite" data-testid="said"')

    def show(self, picture: ValvePicture) -> None:
        """Show what the role may do now, and which permissives hold."""
        role = self._signed.at(time.monotonic())
        live = picture.freshness.live
        for element, registers in self._parts:
            allowed = live and not self._busy and refusal_for(role, *registers) is None
            element.set_enabled(allowed)  # type: ignore[attr-defined]
        denied = sorted({said for _, registers in self._parts if (said := refusal_for(role, *registers))})
        self._rights.set_text(f"{role.name.lower()}: {'; '.join(denied) if denied else 'all may be written'}")
        permissives = identify_permissives(picture.values)
        ready = live and all(each.holds for each in permissives)
        for (icon, label), each in zip(self._permissives, permissives, strict=True):
            icon.set_name(YES if each.holds and live else NO)
            label.set_text(each.text if each.holds else each.remedy)
        if not ready:
            self._identify.set_enabled(False)
        self._break_off.set_visibility(self._busy)
        self._bar.set_visibility(self._busy)
        self._bar.set_value(round(self._progress, 2))

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
                button = ui.button(mode.text, on_click=lambda mode=mode: self._do(self._set_mode, mode))
                button.props(f'no-caps outline dense data-testid="mode-{mode.text}"')
                self._parts.append((button, ("mode",)))

    def _acknowledge_row(self) -> None:
        button = ui.button("Acknowledge the fault", on_click=lambda: self._do(self._acknowledge))
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
                self._identify = ui.button("Identify", on_click=lambda: self._do(self._identified))
                self._identify.props('no-caps data-testid="identify"')
                self._break_off = ui.button("Break off", on_click=self._valve.commands.break_off)
                self._break_off.props('no-caps outline color=negative data-testid="break-off"')
        self._bar = ui.linear_progress(0.0, show_value=False).props('aria-label="progress"')
        self._parts.append((self._identify, EXCITATION))

    async def _set_reference(self) -> None:
        try:
            reference = self._reference.number()
        except InputError as error:
            self._said.set_text(f"✗ {error}")
            return
        if reference is None:
            self._said.set_text("reference: type a number")
            return
        await self._do(self._valve.commands.set_reference, reference / 100)

    def _set_mode(self, role: Role, mode: Mode) -> Confirmation:
        return self._valve.commands.set_mode(role, mode)

    def _acknowledge(self, role: Role) -> Confirmation:
        return self._valve.commands.acknowledge(role)

    def _identified(self, role: Role) -> Confirmation:
        def show(progress: float) -> None:
            self._progress = progress

        return self._valve.commands.identify(role, {}, show)

    async def _do(self, command: Callable[..., Confirmation], *arguments: object) -> None:
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
        self._said.set_text(("✓ " if confirmation.done else "✗ ") + confirmation.text)
