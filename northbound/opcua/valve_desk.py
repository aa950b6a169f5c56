"""What clients write to a valve and call on it, within the rights of their roles: the commands of the page.

An identification takes minutes: the call returns when it is refused or has begun; `Identification` says what became of
it.
"""

import asyncio
import math
from collections.abc import Callable
from typing import NamedTuple

from config.errors import one_line
from config.roles import Role
from northbound.observer.valve_commands import EXCITATION, Confirmation, refusal_for
from northbound.observer.watched_valves import WatchedValve
from northbound.opcua.valve_nodes import PERCENT

REFUSED_WITHIN_S = 1.0
"""What does not hold is said sooner."""
PADIM_START, PADIM_ABORT = 2, 255
"""Of PA-DIM's ExecutionModeEnum."""


class Answer(NamedTuple):
    """What became of it: a status of OPC UA by its name, and in words."""

    status: str
    text: str

    @property
    def done(self) -> bool:
        """Whether it was obeyed."""
        return self.status == "Good"


class ValveDesk:
    """Of one valve.

    Args:
        valve: as it is watched.
        tell: takes what becomes of an identification, in words.
    """

    def __init__(self, valve: WatchedValve, tell: Callable[[str], None]) -> None:
        self._valve = valve
        self._tell = tell
        self._under_way: asyncio.Task[None] | None = None

    async def write_setpoint(self, role: Role, sent: object) -> Answer:
        """Ask for a position, % of the stroke."""
        if refusal := refusal_for(role, "reference"):
            return Answer("BadUserAccessDenied", refusal)
        percent = _number_in(sent)
        if not 0.0 <= percent <= PERCENT:
            return Answer("BadOutOfRange", f"set point: allowed is 0 to 100 %, got {_show_sent(sent)}")
        set_reference = self._valve.commands.set_reference
        return _answer(await asyncio.to_thread(set_reference, role, percent / PERCENT))

    async def acknowledge(self, role: Role) -> Answer:
        """Acknowledge a fault."""
        if refusal := refusal_for(role, "acknowledge"):
            return Answer("BadUserAccessDenied", refusal)
        return _answer(await asyncio.to_thread(self._valve.commands.acknowledge, role))

    async def identify(self, role: Role) -> Answer:
        """Begin an identification, which moves the valve."""
        if refusal := refusal_for(role, *EXCITATION):
            return Answer("BadUserAccessDenied", refusal)
        if self._under_way is not None and not self._under_way.done():
            return Answer("BadInvalidState", "an identification is under way already")
        asked = asyncio.create_task(asyncio.to_thread(self._valve.commands.identify, role, {}, _no_progress))
        self._under_way = asyncio.create_task(self._tell_when_over(asked))
        await asyncio.wait({asked}, timeout=REFUSED_WITHIN_S)
        return (
            _answer(asked.result())
            if asked.done()
            else Answer("Good", "it has begun; Identification says what became of it")
        )

    async def break_off(self, role: Role) -> Answer:
        """Break off an identification that was begun here."""
        if refusal := refusal_for(role, *EXCITATION):
            return Answer("BadUserAccessDenied", refusal)
        if self._under_way is None or self._under_way.done():
            return Answer("BadInvalidState", "no identification that was begun here is under way")
        self._valve.commands.break_off()
        await self._under_way
        return Answer("Good", "broken off; the law has the command again")

    async def auto_adjust(self, role: Role, sent: object) -> Answer:
        """Do as PA-DIM's AutoAdjustPositioner: start or abort."""
        mode = _number_in(sent)
        if mode == PADIM_START:
            return await self.identify(role)
        if mode == PADIM_ABORT:
            return await self.break_off(role)
        allowed = f"allowed are {PADIM_START} (Start) and {PADIM_ABORT} (Abort)"
        return Answer("BadOutOfRange", f"ExecutionMode: {allowed}, got {_show_sent(sent)}")

    async def end(self) -> None:
        """Break off what is under way, and wait for it."""
        await asyncio.to_thread(self._valve.commands.end)
        if self._under_way is not None:
            await self._under_way

    async def _tell_when_over(self, asked: "asyncio.Task[Confirmation]") -> None:
        self._tell("under way")
        self._tell((await asked).text)


def _number_in(sent: object) -> float:
    """Return a number that a client sent, NaN of what is none."""
    return float(sent) if isinstance(sent, int | float) and not isinstance(sent, bool) else math.nan


def _show_sent(sent: object) -> str:
    """Return what a client sent, as a line of a log has it; nothing is "no value"."""
    if sent is None:
        return "no value"
    return f"{sent:g}" if isinstance(sent, float) else one_line(repr(sent))


def _answer(confirmed: Confirmation) -> Answer:
    return Answer("Good" if confirmed.done else "BadInvalidState", confirmed.text)


def _no_progress(_share: float) -> None:
    """The register says it."""
