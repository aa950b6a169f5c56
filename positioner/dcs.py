"""A small DCS: reads and writes the daemon's supervisory registers by name, over Modbus TCP.

What `positioner get`, `set` and `identify` use, and what plays the DCS in `positioner demo`.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Self

from pymodbus.constants import ExcCodes

from config.codes import ExperimentState, Fault, InhibitReason, Mode, Refusal, State
from config.errors import CommandFailed, InputError
from config.modbus_map import MOST_REGISTERS, runs_within
from config.registers import Register, register_named
from config.tls_table import Tls
from fieldbus.modbus.client import ModbusClient
from fieldbus.modbus.client_errors import ClientError, NobodyThere, NotConnected, Refused

POLL_S = 0.05
CYCLE_WITHIN_S = 30.0
CYCLES_WRAP = 1 << 32

REFUSALS = (
    InhibitReason.NOT_AUTOMATIC,
    InhibitReason.ALPHA_BELOW_BREAKAWAY,
    InhibitReason.EXCITATION_BEYOND_LIMITS,
    InhibitReason.EXCITATION_TOO_LONG,
    InhibitReason.EXCITATION_OUTSIDE_WINDOW,
    InhibitReason.EXCITATION_NO_CONSENT,
    InhibitReason.EXCITATION_VETOED,
    InhibitReason.AMPLITUDE_ZERO,
    InhibitReason.STAIRCASE_IN_VAIN,
    InhibitReason.STAIRCASE_LIMITED,
    InhibitReason.STAIRCASE_UNANSWERED,
    InhibitReason.STAIRCASE_REVERSED,
    InhibitReason.EXCITATION_FROM_BEFORE,
)
"""Why an excitation does not begin or has ended; the other reasons concern the law."""


SWITCHED_OFF = {"eta_1": 1, "eta_2": 1, "eta_3": 1}
"""Identification, as the DCS leaves it."""


class DcsError(CommandFailed):
    """The daemon did not do what was asked; one line says what and why."""


class Dcs:
    """A connection to a daemon's supervisory server, on TLS where that is given; used as a context.

    Raises:
        InputError: a file of `tls` that is not there or does not fit.
    """

    def __init__(self, host: str, port: int, unit: int = 1, timeout_s: float = 2.0, tls: Tls | None = None) -> None:
        self._where = f"{host}:{port}"
        self.client = ModbusClient(host, port, unit, timeout_s, tls)

    def __enter__(self) -> Self:
        try:
            self.client.open()
        except NobodyThere:
            raise DcsError(f"{self._where}: no daemon answers there (is `positioner run` running?)") from None
        except NotConnected as error:
            raise DcsError(f"{self._where}: {error}") from None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.client.close()

    def get(self, name: str) -> float:
        """Return a register's value.

        Raises:
            InputError: no register of that name.
            DcsError: the daemon does not answer, or refuses.
        """
        register = register_named(name)
        return self._decoded(register, self._read(register.address, register.end), register.address)

    def get_all(self, *names: str) -> dict[str, float]:
        """Return several values, those within one reply's reach from the same snapshot."""
        values: dict[str, float] = {}
        for run in runs_within({name: register_named(name) for name in names}, MOST_REGISTERS):
            start, *_ = (each.address for each in run.values())
            words = self._read(start, max(each.end for each in run.values()))
            values |= {name: self._decoded(each, words, start) for name, each in run.items()}
        return {name: values[name] for name in names}

    def set(self, name: str, value: float) -> None:
        """Write a register.

        Raises:
            InputError: no register of that name, read-only, or a value outside its range.
            DcsError: the daemon does not answer, or refuses.
        """
        self.set_all({name: value})

    def set_all(self, values: Mapping[str, float]) -> None:
        """Write several registers; neighbours in one request, which the daemon takes whole or not at all.

        Raises:
            InputError, DcsError: as `set`.
        """
        registers = {name: register_named(name) for name in values}
        for name, register in registers.items():
            if problem := register.problem_with(values[name]):
                raise InputError(name, problem.removeprefix(f"{name}: "))
        for run in runs_within(registers, 0):
            start, *_ = (each.address for each in run.values())
            words = [word for name, each in run.items() for word in each.format.encode(values[name])]
            try:
                self.client.write_registers(start, words)
            except ClientError as error:
                asked = ", ".join(f"{name} = {values[name]:g}" for name in run)
                why = self._why_refused(values, error) or _in_words(error)
                raise DcsError(f"{self._where}: {asked} was refused: {why}") from None

    def _why_refused(self, values: Mapping[str, float], error: ClientError) -> str:
        """Return why a write was refused, where its values or the daemon's registers tell; else nothing."""
        code = error.code if isinstance(error, Refused) else None
        if code == ExcCodes.ILLEGAL_VALUE and {"alarm_shelve", "alarm_shelve_time"} <= values.keys():
            return "allowed is up to [alarms] shelve_limit_s of the daemon's file"
        if code != ExcCodes.DEVICE_BUSY:
            return ""
        try:
            now = self.get_all("locked_out", "fault")
        except DcsError:
            return ""
        if now["locked_out"]:
            return "the local switch locks out all writes"
        if "mode" in values and now["fault"]:
            fault = Fault(int(now["fault"])).text
            return f"a fault is latched ({fault}): positioner set acknowledge 1, once its cause is gone"
        return ""

    def set_and_read_back(self, name: str, value: float) -> float:
        """Write a register; return what it reads once the daemon has decided on it.

        Raises:
            InputError, DcsError: as `set`.
        """
        self.set(name, value)
        self.wait_for_a_cycle()
        return self.get(name)

    def identify(
        self, excitation: Mapping[str, float], timeout_s: float, show: Callable[[float], None] = lambda _: None
    ) -> str | None:
        """Have the valve identified; return why nothing was applied, or None.

        However it ends, eta is 1 again afterwards: S3 gives back the law.

        Args:
            excitation: alpha, beta, omega as far as they are to differ from what the daemon has.
            timeout_s: give up after this long.
            show: called with the progress, 0 to 1.
        """
        self.set_all(excitation)
        applied_before = self.get("identifications")
        if self.get("eta_1") == 0 and self.get("state") != State.S3_IDENTIFY:
            self.set_all(SWITCHED_OFF)  # somebody left it so, and it would not count as asked for
            self.wait_for_a_cycle()
        try:
            self.set_all({"eta_1": 0, "eta_2": 0, "eta_3": 0})
            problem = self._wait_for_estimates(timeout_s, show)
        finally:
            self.set_all(SWITCHED_OFF)
        self.wait_for_a_cycle()
        if self.get("identifications") != applied_before:
            return None
        return problem or Refusal(int(self.get("refusal"))).text

    def play(
        self,
        points: Sequence[tuple[float, float]],
        timeout_s: float,
        *,
        turn: float = 0.0,
        band: float = 0.0,
    ) -> ExperimentState:
        """Have an experiment played; return what became of it once the law has the command back.

        However this ends before (Ctrl-C, no answer any more), a veto breaks the experiment off; it is taken back when
        the command is. One that somebody else has set stays.

        Args:
            points: times, s, from 0 up, and pressures, Pa.
            timeout_s: broken off after this long.
            turn: travel, of the stroke, at which it retraces its way; 0: never.
            band: travel, of the stroke, that breaks it off; 0: the file's window alone does.

        Raises:
            DcsError: the daemon refuses the sequence, or it took too long, or no veto gets to it any more.
        """
        for number, (time_s, pressure_pa) in enumerate(points):
            self.set_all({"experiment_point": number, "experiment_time": time_s, "experiment_pressure": pressure_pa})
        if turn or band:
            self.set_all({"experiment_turn": turn, "experiment_band": band})
        try:
            self.set("experiment_start", len(points))
            if (state := self._played_within(timeout_s)) is None:
                raise DcsError(f"{self._where}: the experiment took longer than {timeout_s:g} s, broken off")
            return state
        except BaseException as error:
            self._break_off(timeout_s, error)
            raise

    def _break_off(self, timeout_s: float, why: BaseException) -> None:
        """Veto the experiment on a connection of its own: the reply to what was asked last may still be on its way.

        Raises:
            DcsError: the veto did not get there; says why it was wanted.
        """
        try:
            self.client.open()
            if self.get("experiment_veto"):
                return
            self.set("experiment_veto", 1)
        except (ClientError, DcsError):
            said = str(why) or f"{self._where}: broken off"
            unheard = "no veto got there, so that a daemon which still runs plays the experiment to its end"
            raise DcsError(f"{said}; {unheard}") from None
        if self._played_within(timeout_s) is not None:
            self.set("experiment_veto", 0)

    def _played_within(self, timeout_s: float) -> ExperimentState | None:
        """Wait until no experiment commands; return what became of it, None if one still does after so long."""
        due_s = time.monotonic() + timeout_s
        self.wait_for_a_cycle()
        while time.monotonic() < due_s:
            state = ExperimentState(int(self.get("experiment_state")))
            if state not in (ExperimentState.UNDER_WAY, ExperimentState.RETURNING):
                return state
            time.sleep(POLL_S)
        return None

    def wait_for_a_cycle(self) -> None:
        """Wait until the daemon has decided on what it was told, however slow its loop; not for one that stands."""
        asked, due_s = self.get("cycles"), time.monotonic() + CYCLE_WITHIN_S
        while not self.decided_since(asked) and time.monotonic() < due_s:
            time.sleep(POLL_S)

    def decided_since(self, asked: float) -> bool:
        """Return whether what is served was decided after a count of cycles was read, as the one under way was not."""
        return bool((self.get("cycles") - asked) % CYCLES_WRAP >= 2)

    def _wait_for_estimates(self, timeout_s: float, show: Callable[[float], None]) -> str | None:
        """Wait until the estimates the law needs are there; return what went wrong, or None."""
        due_s = time.monotonic() + timeout_s
        begun = False
        asked = self.get("cycles")
        while time.monotonic() < due_s:
            if not self.decided_since(asked):
                time.sleep(POLL_S)
                continue
            now = self.get_all(
                "state", "fault", "why", "progress", "b_over_c_valid", "k_over_c_valid", "static_slope_valid"
            )
            begun = begun or now["state"] == State.S3_IDENTIFY
            show(now["progress"])
            if now["fault"]:
                return f"fault: {_plain(Fault(int(now['fault'])))}"
            if now["why"] in REFUSALS:
                return _plain(InhibitReason(int(now["why"])))
            valid = (now["b_over_c_valid"] and now["k_over_c_valid"]) or now["static_slope_valid"]
            if begun and now["progress"] >= 1 and valid:
                return None
            time.sleep(POLL_S)
        return f"no valid estimates within {timeout_s:g} s"

    def _read(self, start: int, end: int) -> list[int]:
        try:
            return self.client.read_holding_registers(start, end - start)
        except ClientError as error:
            which = f"registers {start} to {end - 1}"
            raise DcsError(f"{self._where}: {which} cannot be read: {_in_words(error)}") from None

    @staticmethod
    def _decoded(register: Register, words: list[int], start: int) -> float:
        return register.format.decode(words[register.address - start : register.end - start])


def value_of(name: str, word: str) -> float:
    """Return the number that a person writes for a register; a mode may be given by its name.

    Raises:
        InputError: it is none.
    """
    if name == "mode" and word.upper() in Mode.__members__:
        return Mode[word.upper()]
    try:
        return float(word)
    except ValueError:
        words = "".join(f", {mode.name.lower()}" for mode in Mode) if name == "mode" else ""
        raise InputError(name, f"allowed is a number{words}, got {word!r}") from None


def _plain(code: Fault | InhibitReason) -> str:
    return code.name.lower().replace("_", " ")


def _in_words(error: ClientError) -> str:
    return f"{error} (see its log)" if isinstance(error, Refused) else str(error)
