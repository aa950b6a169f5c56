"""What a test holds of a simulated valve, a daemon and a wire; each is a process, asked over the bus or by an agent."""

import json
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from positioner.testing.child_process import Agent, ChildProcess, NotDone, launch, port_in

AGENT, PROXY = "positioner.testing.agent", "positioner.testing.fault_proxy"
COMMANDS = ("positioner.testing.tied", "positioner.cli")
HOST = "127.0.0.1"
HANDLE_POLL_S = 0.02
QUALITY_LOST = 2.0
"""As `config.codes.Quality.LOST`, which is not loaded in somebody else's process."""


@dataclass(frozen=True, slots=True)
class Measurement:
    """What a device said: the position, m, the pressure command it holds, Pa, its clock, s, and its status bits."""

    position_m: float
    pressure_pa: float | None
    device_time_s: float | None
    sample_counter: int | None
    status: int

    @classmethod
    def of(cls, said: Mapping[str, Any]) -> Self:
        """Take the agent's answer."""
        return cls(**{name: said[name] for name in cls.__slots__})


@dataclass(frozen=True, slots=True)
class ValveSlave:
    """A simulated valve on Modbus TCP, host:port; asked directly, as a master of its own."""

    host: str
    port: int
    stroke_m: float
    lockstep: bool
    process: ChildProcess
    _agent: Agent

    def read(self) -> Measurement:
        """Measure; moves nothing.

        Raises:
            NotDone: it does not answer.
        """
        return Measurement.of(self._agent.ask("read"))

    def exchange(self, command_pa: float) -> Measurement:
        """Command a pressure, Pa, and measure; in lockstep one period passes.

        Raises:
            NotDone: it does not answer, or refuses.
        """
        return Measurement.of(self._agent.ask("exchange", command_pa=command_pa))


@dataclass(frozen=True, slots=True)
class FaultProxy:
    """A wire to the valve, host:port, that is in order until it is spoilt."""

    host: str
    port: int
    process: ChildProcess

    def spoil(self, kind: str, count: int = 1, late_s: float = 0.5) -> None:
        """Spoil the next replies, or requests; `positioner.testing.wire_faults` lists the kinds.

        Raises:
            NotDone: no such kind.
        """
        self.process.ask("spoil", kind=kind, count=count, late_s=late_s)

    @property
    def left(self) -> int:
        """How many are still to be spoilt."""
        return int(self.process.ask("left"))


@dataclass(frozen=True, slots=True)
class PositionerDaemon:
    """A daemon; its supervisory registers are served on host:port, its files lie in the folder."""

    host: str
    port: int
    folder: Path
    process: ChildProcess
    _agent: Agent

    def get(self, name: str) -> float:
        """Return a register of `positioner map`.

        Raises:
            NotDone: no such register, or no answer.
        """
        return self.get_all(name)[name]

    def get_all(self, *names: str) -> dict[str, float]:
        """Return several registers, near ones of the same cycle.

        Raises:
            NotDone: as `get`.
        """
        found: dict[str, float] = self._agent.ask("get", names=names)
        return found

    def set(self, **values: float | str) -> None:
        """Write registers, neighbours in one request; `mode` also as "hold", "manual" or "automatic".

        Raises:
            NotDone: no such register, a value out of its range, or no answer.
        """
        self._agent.ask("set", values=values)

    def identify(self, within_s: float = 120.0, **excitation: float) -> str | None:
        """Have the valve identified, `alpha`, `beta` and `omega` as given; return why nothing was applied, or None.

        Raises:
            NotDone: a value out of its range, or no answer.
        """
        refused: str | None = self._agent.ask("identify", excitation=excitation, within_s=within_s)
        return refused

    def until(self, name: str, holds: Callable[[float], bool], within_s: float = 60.0) -> float:
        """Wait until a register's value is as wanted; return it.

        Raises:
            AssertionError: it is not within that time, s, of this machine's clock.
        """
        end_s = time.monotonic() + within_s
        while not holds(value := self.get(name)):
            assert time.monotonic() < end_s, f"{name} was still {value:g} after {within_s:g} s"
            time.sleep(HANDLE_POLL_S)
        return value

    def log(self) -> list[dict[str, Any]]:
        """Return its log so far, a mapping a line."""
        lines = (self.folder / "daemon.log").read_text(encoding="utf-8").splitlines()
        return [json.loads(line) for line in lines if line.startswith("{")]

    def recordings(self) -> list[Path]:
        """Return the files that it records into, oldest first."""
        return sorted((self.folder / "recordings").glob("*"))


@contextmanager
def slave_running(folder: Path, stroke_m: float, lockstep: bool) -> Iterator[ValveSlave]:
    """Run the slave of `slave.toml` in a folder.

    Raises:
        NotStarted: it ended instead.
    """
    with ExitStack() as stack:
        file, log = str(folder / "slave.toml"), folder / "slave.log"
        slave = stack.enter_context(launch(*COMMANDS, "sim", file, "--listen-port", "0", log=log))
        port = port_in(slave.ready)
        agent = Agent(AGENT, "device", str(port), log=folder / "slave_agent.log")
        stack.callback(agent.end)
        yield ValveSlave(HOST, port, stroke_m, lockstep, slave, agent)


@contextmanager
def daemon_running(folder: Path) -> Iterator[PositionerDaemon]:
    """Run the daemon of `daemon.toml` in a folder; give it when it has measured, for silence before that is no fault.

    Raises:
        NotStarted: it ended instead.
        AssertionError: it has not measured within a minute.
    """
    with ExitStack() as stack:
        daemon = stack.enter_context(launch(*COMMANDS, "run", str(folder / "daemon.toml"), log=folder / "daemon.log"))
        port = port_in(daemon.ready)
        agent = Agent(AGENT, "daemon", str(port), log=folder / "daemon_agent.log")
        stack.callback(agent.end)
        handle = PositionerDaemon(HOST, port, folder, daemon, agent)
        handle.until("quality", lambda quality: quality != QUALITY_LOST)
        yield handle


@contextmanager
def proxy_running(folder: Path, port: int) -> Iterator[FaultProxy]:
    """Run a wire to a port of this machine."""
    with launch(PROXY, str(port), log=folder / "proxy.log") as proxy:
        yield FaultProxy(HOST, port_in(proxy.ready), proxy)


__all__ = ["FaultProxy", "Measurement", "NotDone", "PositionerDaemon", "ValveSlave"]
