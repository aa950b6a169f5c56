"""A simulated slave and a daemon as processes on a bus, with the files that both are given: what `demo` runs on.

The packing of a valve with `ageing` ages by `AGEING` at `AGES_AT_S` after power-up.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from positioner.cli.parts.children import port_in, running
from positioner.cli.parts.pseudo_line import pseudo_line

if TYPE_CHECKING:
    from config.valve_file import ValveParameters

AGEING = 1.3
"""Factor on F_c and F_s."""
AGES_AT_S = 12.0
PERIOD_S = 1e-3
WINDOW_S = 0.8
"""Length of the identification."""
RTU_PERIOD_S = 5e-3
"""On a pseudo-terminal, an exchange takes two silences of 1.75 ms; at 115200 baud a real line adds 4.2 ms."""
RTU_WINDOW_S = 1.2
"""A fifth of the samples in a second: a longer window, within the rise of the sine, brings k/c back within 1 %."""
STROKE_M = 0.1016
"""Of the seed's valve."""
RECORDER = '[recorder]\nfolder = "recordings"\n'
THE_PAPERS_LAW = '[control]\nlaw = "seed"\n'
SLAVE_HEAD = "# The simulated valve of the demo.\n"
"""Begins the slave's file: by it a demo knows what another has left."""
NOISE_PU = 1e-4
"""Standard deviation of the position, share of the stroke."""


@dataclass(frozen=True, slots=True)
class BusSetup:
    """What a bus puts into the two files, and how its slave is started."""

    slave: str
    device: Callable[[str], str]
    """Table `[device]` of the daemon, given the slave's ready line."""
    options: tuple[str, ...] = ("--listen-port", "0")
    period_s: float = PERIOD_S
    """Of the daemon's cycle."""
    window_s: float = WINDOW_S
    """Of its identification."""
    reply_timeout_s: float | None = None
    """Within which the device answers; None: the daemon's own."""


@contextmanager
def _modbus() -> Iterator[BusSetup]:
    yield BusSetup("", lambda ready: f"port = {port_in(ready)}\n")


@contextmanager
def _canopen() -> Iterator[BusSetup]:
    yield BusSetup('[bus]\nkind = "canopen"\n', lambda ready: f'bus = "canopen"\nchannel = "{port_in(ready)}"\n')


@contextmanager
def _rtu() -> Iterator[BusSetup]:

    def serial(path: str) -> str:
        return f'serial = {{path = "{path}", baud = 115200}}\n'

    with pseudo_line() as (end, other_end):
        slave = f'[bus]\nkind = "rtu"\n{serial(other_end)}'
        device = f'bus = "rtu"\n{serial(end)}'
        yield BusSetup(slave, lambda _: device, options=(), period_s=RTU_PERIOD_S, window_s=RTU_WINDOW_S)


BUSES: dict[str, Callable[[], AbstractContextManager[BusSetup]]] = {"modbus": _modbus, "canopen": _canopen, "rtu": _rtu}
"""The buses, by the name that `--bus` gives them."""


@contextmanager
def slave_running(bus: str, folder: Path, valve: str, tables: str = "") -> Iterator[tuple[BusSetup, str]]:
    """Run a slave on a bus as a process; give what the bus puts into the daemon's file, and the slave's ready line.

    Args:
        bus: its name.
        folder: of its file and log.
        valve: its valve file, as a slave's file names it.
        tables: more of its file.
    """
    with BUSES[bus]() as setup:
        path = _write(folder / "slave.toml", _slave_toml(valve, setup.slave, tables))
        with running("sim", path, *setup.options) as slave:
            yield setup, slave


@contextmanager
def daemon_running(path: Path, setup: BusSetup, slave: str, tables: str = RECORDER) -> Iterator[str]:
    """Run a daemon on a slave's bus as a process; give its ready line.

    Args:
        path: of its file, beside which its log lies.
        setup: what the bus puts into it.
        slave: the slave's ready line.
        tables: more of its file.
    """
    with running("run", _write(path, _daemon_toml(setup, slave, tables))) as daemon:
        yield daemon


def _slave_toml(valve: str, bus: str, tables: str) -> str:
    return f"""{SLAVE_HEAD}valve = "{valve}"
{bus}[clock]
period_s = {PERIOD_S}
[sensor]
noise_std_m = {NOISE_PU * STROKE_M}
seed = 1
{tables}"""


def ageing(valve: "ValveParameters") -> str:
    """Return the table of a slave's file by which the packing ages."""
    return f"""# Its packing ages.
[[change]]
at_s = {AGES_AT_S}
coulomb_n = {AGEING * valve.coulomb_n}
static_n = {AGEING * valve.static_n}
"""


def _daemon_toml(setup: BusSetup, ready: str, tables: str) -> str:
    reply = "" if setup.reply_timeout_s is None else f"reply_timeout_s = {setup.reply_timeout_s}\n"
    return f"""# The daemon of the demo. It knows the stroke; all else it identifies.
[valve]
name = "demo"
stroke_m = {STROKE_M}
[device]
{setup.device(ready)}{reply}[cycle]
period_s = {setup.period_s}
[identification]
window_s = {setup.window_s}
[supervisory]
port = 0
{tables}"""


def _write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path
