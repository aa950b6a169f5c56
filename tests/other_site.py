"""A daemon process on the device that is not ours, and the DCS that commissions and steps it."""

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from config.codes import Mode
from config.device import ModbusTcpDevice
from positioner.cli.parts.children import port_in, running
from positioner.dcs import Dcs
from tests.other_device import OtherDevice

LAW = ("static_slope", "static_up", "static_down")
"""Registers of the static law, in the order of `Parameters.static_law`."""
ENDED_CYCLES, ENDED_WITHIN_CYCLES = 60, 3000
"""A move has ended when the command has stood for so many cycles of the daemon; it is given up after so many."""
ARRIVED = 1e-3
"""Of the stroke: a stem as near to where it ends has arrived."""
TAKEN = 1e-6
"""Of the stroke: registers round the reference."""
POLL_S = 0.02
DCS_WITHIN_S = 20.0


@dataclass(frozen=True, slots=True)
class Move:
    """One step: error of the true stem, of the stroke; slides; s until it had arrived."""

    error: float
    slides: int
    duration_s: float


def daemon_text(device: ModbusTcpDevice, stroke_m: float, period_s: float) -> str:
    """Return the file of a daemon on a device: what the law needs to know of it, and nothing of the valve."""
    registers = "\n".join(
        f"{name} = {{ address = {place.address}, type = '{place.type}', scale = {place.scale!r} }}"
        for name, place in device.map.places.items()
    )
    return (
        f"[valve]\nname = 'other'\nstroke_m = {stroke_m!r}\n"
        f"[device]\nport = {device.port}\nunit = {device.unit}\nreply_timeout_s = {device.reply_timeout_s!r}\n"
        f"[device.map]\n{registers}\n[cycle]\nperiod_s = {period_s!r}\n[pressure]\nmaximum_pa = 140e3\n"
        "[safety]\nstale_after_s = 5.0\n[control]\nlaw = 'slides'\n[supervisory]\nport = 0\n"
    )


@contextmanager
def identified_at(device: OtherDevice, period_s: float, within_s: float) -> Iterator[Dcs]:
    """Run a daemon on the device, have it identify the valve, and give the DCS."""
    with tempfile.TemporaryDirectory() as folder:
        config = Path(folder) / "daemon.toml"
        stroke_m = device.stem.parameters.stroke_m
        config.write_text(daemon_text(device.described(reply_timeout_s=2.0), stroke_m, period_s))
        with running("run", config) as ready, Dcs("127.0.0.1", port_in(ready), timeout_s=DCS_WITHIN_S) as dcs:
            dcs.set("mode", Mode.AUTOMATIC)
            if problem := dcs.identify({}, within_s):
                raise RuntimeError(f"not identified: {problem}")
            yield dcs


def moved(device: OtherDevice, dcs: Dcs, reference: float) -> Move:
    """Write a reference, p.u., and wait for the end of the move; the daemon's own cycles count, not the clock's time.

    Raises:
        RuntimeError: the daemon has not taken the reference.
    """
    began_s, began = time.monotonic(), _await_taken(dcs, reference)
    command, slides, last, cycles = device.command, 0, began, began
    path = []
    while cycles - began < ENDED_WITHIN_CYCLES and cycles - last < ENDED_CYCLES:
        cycles = int(dcs.get("cycles"))
        if device.command != command:
            command, slides, last = device.command, slides + 1, cycles
        path.append((time.monotonic() - began_s, device.stem.position_m / device.stem.parameters.stroke_m))
        time.sleep(POLL_S)
    _, end = path[-1]
    return Move(end - reference, slides, max((at_s for at_s, at in path if abs(at - end) > ARRIVED), default=0.0))


def _await_taken(dcs: Dcs, reference: float) -> int:
    """Write a reference, p.u., and return the number of cycles run when the law follows it."""
    written = int(dcs.get("cycles"))
    dcs.set("reference", reference)
    while abs(dcs.get("reference_in_force") - reference) > TAKEN:
        if int(dcs.get("cycles")) - written > ENDED_CYCLES:
            raise RuntimeError(f"the reference {reference} was not taken in {ENDED_CYCLES} cycles")
        time.sleep(POLL_S)
    return int(dcs.get("cycles"))
