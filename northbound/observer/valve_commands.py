"""What an operator does to a valve, within the rights of a role, and confirmed by what the daemon reads back.

The rights are those of the register table (`Register.writer`), which a daemon with certificates asks for itself. Each
command has a connection of its own. Nothing is written on values that are not of now.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Event, Lock

from config.codes import Fault, Mode, Ne107Cause
from config.errors import CommandFailed, InputError
from config.registers import register_named
from config.roles import Role
from northbound.observer.identify_permissives import identify_permissives
from northbound.observer.register_words import CODES, code_text
from northbound.observer.valve_view import ValvePicture
from northbound.observer.waiting_reference import SAME_PU, WAITS, waiting_reference
from positioner.dcs import Dcs

FLOAT32_ERROR = 1e-6
"""Of a value that was written and the one that is read back: a float32 has 24 bits."""
IDENTIFY_WITHIN_S = 600.0
END_WITHIN_S = 5.0
MINUTE_S = 60.0
EXCITATION = ("eta_1", "eta_2", "eta_3")
CALLED = {**dict.fromkeys(EXCITATION, "identification"), "experiment_consent": "a test on the valve"}
"""What people call a register by what it is written for."""


@dataclass(frozen=True, slots=True)
class Confirmation:
    """What became of a command, in one line."""

    done: bool
    text: str


class BrokenOff(CommandFailed):
    """An identification was broken off by whoever asked for it."""


def refusal_for(role: Role, *registers: str) -> str | None:
    """Return why a role may not write these registers, None where it may.

    >>> refusal_for(Role.OPERATOR, "reference"), refusal_for(Role.OPERATOR, "mode")
    (None, 'mode needs the role engineer')
    >>> refusal_for(Role.OBSERVER, *EXCITATION)
    'identification needs the role engineer'
    """
    for name in registers:
        needed = register_named(name).writer
        if role < needed:
            return f"{CALLED.get(name, name)} needs the role {needed.name.lower()}"
    return None


def _is_same(one_pu: float | None, other_pu: float | None) -> bool:
    """Whether two references that wait, or none, are one; no number is like another."""
    if one_pu is None or other_pu is None:
        return one_pu is other_pu
    return abs(one_pu - other_pu) <= SAME_PU


def _as_read(name: str, value: float) -> str:
    """Return a register's value as a person reads it; the reference in %, as it is typed."""
    if name in CODES:
        return code_text(name, value)
    return f"{100 * value:.6g} %" if name == "reference" else f"{value:.6g}"


def _confirm(name: str, value: float, read: float) -> Confirmation:
    """Return what became of a write, by what reads back."""
    said = _as_read(name, read)
    if abs(read - value) <= FLOAT32_ERROR * max(1.0, abs(value)):
        return Confirmation(True, f"{name} is {said}, as read back")
    return Confirmation(False, f"{name} was written, but reads back {said}")


class ValveCommands:
    """Commands to one valve.

    Args:
        connect: returns a closed connection for a role.
        picture: returns what is known of the valve now.
    """

    def __init__(self, connect: Callable[[Role], Dcs], picture: Callable[[], ValvePicture]) -> None:
        self._connect = connect
        self._picture = picture
        self._break_off = Event()
        self._identifying = Lock()

    def set(self, role: Role, name: str, value: float) -> Confirmation:
        """Write a register; confirmed when it reads back so."""

        def write(dcs: Dcs) -> Confirmation:
            return _confirm(name, value, dcs.set_and_read_back(name, value))

        return self._within_rights(role, (name,), write)

    def set_mode(self, role: Role, mode: Mode) -> Confirmation:
        """Change who commands the pressure."""
        return self.set(role, "mode", mode)

    def automatic(self, role: Role, seen_pu: float | None, *, goes: bool) -> Confirmation:
        """Let the law follow the reference that waited, or, where it is not to go there, the stem's own place.

        Nothing is written where another waits by now: the stem would go where nobody has agreed to.

        Args:
            role: of who asks.
            seen_pu: the opening that waited when it was agreed to; None: none did.
            goes: whether the stem goes there; else its own place is written first.
        """

        def write(dcs: Dcs) -> Confirmation:
            waits_pu = waiting_reference(dcs.get_all(*WAITS))
            if not _is_same(waits_pu, seen_pu):
                now, then = ("none" if each is None else _as_read("reference", each) for each in (waits_pu, seen_pu))
                return Confirmation(False, f"nothing was written: the reference that waits is {now} now, it was {then}")
            to_pu = dcs.get("reference" if goes else "position_signal")
            dcs.set_and_read_back("reference", min(max(to_pu, 0.0), 1.0))
            return _confirm("mode", Mode.AUTOMATIC, dcs.set_and_read_back("mode", Mode.AUTOMATIC))

        return self._within_rights(role, ("reference", "mode"), write)

    def manual(self, role: Role, pressure_pa: float) -> Confirmation:
        """Command a pressure by hand."""

        def write(dcs: Dcs) -> Confirmation:
            dcs.set_and_read_back("manual_pressure", pressure_pa)
            return _confirm("mode", Mode.MANUAL, dcs.set_and_read_back("mode", Mode.MANUAL))

        if problem := register_named("manual_pressure").problem_with(pressure_pa):
            return Confirmation(False, problem)
        return self._within_rights(role, ("manual_pressure", "mode"), write)

    def set_reference(self, role: Role, reference_pu: float) -> Confirmation:
        """Ask for a position; what is allowed is said in %, as it is typed."""
        if refusal_for(role, "reference") is None and register_named("reference").problem_with(reference_pu):
            return Confirmation(False, f"reference: allowed is 0 to 100 %, got {_as_read('reference', reference_pu)}")
        return self.set(role, "reference", reference_pu)

    def acknowledge(self, role: Role) -> Confirmation:
        """Acknowledge a fault; confirmed when none is latched any more."""

        def write(dcs: Dcs) -> Confirmation:
            dcs.set_and_read_back("acknowledge", 1)
            fault = dcs.get("fault")
            gone = fault == Fault.NONE
            said = "no fault is latched any more" if gone else f"the fault stays: {code_text('fault', fault)}"
            return Confirmation(gone, f"acknowledged, {said}")

        return self._within_rights(role, ("acknowledge",), write)

    def acknowledge_alarm(self, role: Role, cause: Ne107Cause) -> Confirmation:
        """Say that an alarm was seen."""

        def write(dcs: Dcs) -> Confirmation:
            dcs.set("alarm_acknowledge", cause)
            return Confirmation(True, f"acknowledged: {cause.text}")

        return self._within_rights(role, ("alarm_acknowledge",), write)

    def shelve_alarm(self, role: Role, cause: Ne107Cause, for_s: float) -> Confirmation:
        """Put an alarm aside for a while, s; 0: show it again."""

        def write(dcs: Dcs) -> Confirmation:
            dcs.set_all({"alarm_shelve": cause, "alarm_shelve_time": for_s})
            what = f"shelved for {for_s / MINUTE_S:.3g} min" if for_s else "shown again"
            return Confirmation(True, f"{what}: {cause.text}")

        return self._within_rights(role, ("alarm_shelve",), write)

    def identify(self, role: Role, excitation: Mapping[str, float], show: Callable[[float], None]) -> Confirmation:
        """Identify the valve, which moves it; returns when it is over. Refused where a permissive does not hold.

        Args:
            role: of who asks.
            excitation: alpha, beta, omega as far as they are to differ from what the daemon has.
            show: called with the progress, 0 to 1.
        """

        def show_progress(progress: float) -> None:
            if self._break_off.is_set():
                raise BrokenOff("broken off; the law has the command again")
            show(progress)

        def identify(dcs: Dcs) -> Confirmation:
            for permissive in identify_permissives(self._picture().values):
                if not permissive.holds:
                    return Confirmation(False, permissive.remedy)
            if not self._identifying.acquire(blocking=False):
                return Confirmation(False, "an identification is under way already")
            try:
                self._break_off.clear()
                problem = dcs.identify(excitation, IDENTIFY_WITHIN_S, show_progress)
            finally:
                self._identifying.release()
            return Confirmation(problem is None, f"not applied: {problem}" if problem else "identified and applied")

        return self._within_rights(role, (*EXCITATION, *excitation), identify)

    def break_off(self) -> None:
        """Break off the identification that is under way, if one is."""
        self._break_off.set()

    def end(self) -> None:
        """Break it off, and wait until the law has its command back."""
        self.break_off()
        if self._identifying.acquire(timeout=END_WITHIN_S):
            self._identifying.release()

    def _within_rights(
        self, role: Role, registers: tuple[str, ...], written: Callable[[Dcs], Confirmation]
    ) -> Confirmation:
        if refusal := refusal_for(role, *registers):
            return Confirmation(False, refusal)
        if stale := self._picture().freshness.daemon:
            return Confirmation(False, f"nothing was written: {stale}")
        try:
            with self._connect(role) as dcs:
                return written(dcs)
        except (CommandFailed, InputError) as failed:
            return Confirmation(False, str(failed))
