"""What every driver does: open, read, write, exchange, close. Blocking; owned by one thread.

One cycle is one `exchange`: the command goes out, the measurement of the same transaction comes back. A driver
never retries and never repeats an old measurement: what it cannot get it raises.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, Protocol, Self, runtime_checkable


class Reading(NamedTuple):
    """What the device said in one transaction. None is what this device does not offer."""

    position_m: float
    """Counted in the direction in which pressure drives the stem."""
    pressure_pa: float | None = None
    sample_counter: int | None = None
    device_time_s: float | None = None
    status: int = 0
    emergency: int = 0
    """The device's own code of what is wrong with it, where it has such (CANopen: of the last EMCY); 0: nothing."""

    @classmethod
    def of(cls, values: Mapping[str, float], status: int = 0, emergency: int = 0) -> Self:
        """Return the reading of a sample's quantities, by their names."""
        counter, time_us = values.get("sample_counter"), values.get("device_time_us")
        return cls(
            values["position_m"],
            values.get("pressure_pa"),
            None if counter is None else round(counter),
            None if time_us is None else time_us / 1e6,
            status,
            emergency,
        )


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What the device behind a driver can do."""

    one_transaction: bool
    """Command and measurement travel in one transaction; that they cannot may show at the first exchange."""
    device_time: bool
    """Each reading carries the device's own time stamp."""
    sample_counter: bool
    """Each reading says which sample it is, so that a repeated one is known."""
    counter_range: int = 1 << 32
    """How far that number counts before it begins at 0 again."""


class DriverError(Exception):
    """A transaction did not do what was asked. The text says with whom and why, in one line.

    `kind` names what happened, the same word each time; empty: the name of the class says it.
    """

    kind: str = ""


class NoConnection(DriverError):
    """The device cannot be reached, or the connection is gone."""


class NoReply(DriverError):
    """The device did not answer within the reply time-out; a late answer is never taken for another's."""


class BadReply(DriverError):
    """The answer is not one to the question (wrong function, count, echo): nothing on the connection can be trusted."""


class DoubleReply(BadReply):
    """The answer to the question before came a second time."""

    kind = "duplicated reply"


class NoNumber(DriverError):
    """A measurement holds a number that is none (NaN, infinite). The device obeyed, and the connection stays."""


class Refused(DriverError):
    """The device answered with an exception, or was not asked because it could not be told that value.

    The connection stays.
    """

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class Driver(Protocol):
    """The boundary. Every method may raise `DriverError`; after `NoConnection` or `NoReply` call `open` again.

    A driver that is not open, or whose connection has ended, raises `NoConnection` and does nothing.
    """

    @property
    def capabilities(self) -> Capabilities:
        """What the device can do; known after `open`."""
        ...

    def open(self) -> float:
        """Connect (again) and return the pressure command the device holds, in Pa. Moves nothing."""
        ...

    def read(self) -> Reading:
        """Return a measurement. Moves nothing."""
        ...

    def write(self, command_pa: float) -> None:
        """Command a pressure."""
        ...

    def exchange(self, command_pa: float) -> Reading:
        """Command a pressure and return the device's newest measurement after that.

        In one transaction where possible. A device in lockstep has obeyed for one period by then; one with a
        clock of its own answers with the latest sample of its grid, as counter and time stamp say.
        """
        ...

    def close(self) -> None:
        """Let go of the device; it keeps its last command until its own time-out. Never raises."""
        ...


@runtime_checkable
class ReadsBack(Protocol):
    """What a driver is, too, that can read the command back while it drives."""

    def held_pa(self) -> float:
        """Return the command that the device holds, in Pa, whoever gave it. Moves nothing; raises `DriverError`."""
        ...


@runtime_checkable
class KeepsSettings(Protocol):
    """What a driver is, too, that can read back what `open` told the device beside the command."""

    @property
    def has_settings(self) -> bool:
        """Whether `open` told it something that can be read back."""
        ...

    def settings_kept(self) -> bool:
        """Return whether the device still has it: one that was restarted has not. Raises `DriverError`."""
        ...


@runtime_checkable
class AsksAhead(Protocol):
    """What a driver is, too, whose exchange need not be waited for: one thread asks many, takes answers later."""

    @property
    def reply_timeout_s(self) -> float:
        """How long an answer may take."""
        ...

    def ask(self, command_pa: float) -> int | None:
        """Begin an exchange; return the descriptor that is ready to be read when something comes back.

        None: nothing was sent, and `exchange` is to be called. Raises `DriverError`.
        """
        ...

    def answer(self, *, late: bool) -> Reading | None:
        """Return what `exchange` would; None while it has not come whole. Waits for nothing; raises `DriverError`.

        `late` says that the time for it is over.
        """
        ...


@runtime_checkable
class ForeseesRefusal(Protocol):
    """What a watching driver is, too, that knows what driving would be refused."""

    def refused(self) -> str | None:
        """Say what the device would refuse of what it had to be told; None if nothing. Raises `DriverError`."""
        ...
