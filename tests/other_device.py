"""A positioned valve that is not ours: another library's Modbus server, another friction model, a clock of its own.

    m x'' = A p - k x - F_0 - F_v x' - F_f - F_stop        F_0 preload, towards closing
    F_f   = s_0 z + s_1 z'                                  LuGre: z is how far the bristles of the contact are bent
    z'    = x' - s_0 abs(x') z / g(x'),   g(v) = (1 + a sign(v)) (F_c + (F_s - F_c) exp(-(v/v_s)^2))
    T p'  = u - p                                           the I/P

Nothing of it is from `sim/`, where friction is Karnopp's: no state is ever "stuck" here. Steps of 0.1 ms, the velocity
before the position, the bristles exactly over a step of constant velocity.

The device samples on its own clock. Its registers are whole numbers of 16 bits: the position of 12 bits, pressure and
command in mbar, or finer (`Registers`). It has no time stamp, no counter, no status, and refuses function 23.
"""

import socket
import struct
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from math import exp
from threading import Event, Thread

from modbus_tk import defines
from modbus_tk.modbus import Slave
from modbus_tk.modbus_tcp import TcpServer

from config.device import ModbusTcpDevice
from config.modbus_map import ModbusMap, Place

BITS = 4096
MBAR_PA = 100.0
SUPPLY_PA = 1400 * MBAR_PA
POSITION, PRESSURE, COMMAND = 40, 41, 60
UNIT = 3
SAMPLED_EVERY_S = 0.007
"""Of no whole ratio to the periods of the loop."""
STEP_S = 1e-4
LONGEST_S = 0.5
"""The plant stands still when its process did, rather than slide on under an old command."""


@dataclass(frozen=True, slots=True)
class Parameters:
    """Of the valve, SI units: 320 cm2, 0.19 to 0.98 bar over 30 mm, 2 F_c / A = 7 % of that range."""

    stroke_m: float = 0.03
    area_m2: float = 0.032
    spring_n_per_m: float = 85e3
    preload_n: float = 600.0
    mass_kg: float = 4.0
    viscous_ns_per_m: float = 1300.0
    coulomb_n: float = 90.0
    static_n: float = 120.0
    asymmetry: float = 0.0
    """a: of the friction, more of it upward."""
    stribeck_m_per_s: float = 1e-3
    bristle_n_per_m: float = 2e7
    bristle_damping_ns_per_m: float = 6e3
    stop_n_per_m: float = 5e7
    lag_s: float = 0.04

    @property
    def static_law(self) -> tuple[float, float, float]:
        """Slope, Pa/m, and what is to be added to it after a slide up and taken from it after one down, Pa."""
        up_n, down_n = ((1.0 + s * self.asymmetry) * self.coulomb_n + s * self.preload_n for s in (1, -1))
        slope, up, down = (each / self.area_m2 for each in (self.spring_n_per_m, up_n, down_n))
        return slope, up, down

    def balance_pa(self, position_m: float) -> float:
        """Return the pressure that balances spring and preload, Pa."""
        return (self.spring_n_per_m * position_m + self.preload_n) / self.area_m2


@dataclass(frozen=True, slots=True)
class Registers:
    """How fine its whole numbers are: of the position, counts of the stroke; of pressure and command, Pa."""

    counts: int = BITS
    pressure_pa: float = MBAR_PA


class Stem:
    """The valve by its equations, at rest at first where the pressure balances it."""

    def __init__(self, parameters: Parameters, position_m: float) -> None:
        self.parameters = parameters
        self.position_m = position_m
        self.pressure_pa = parameters.balance_pa(position_m)
        self._velocity = self._bent_m = 0.0

    def advance(self, command_pa: float, duration_s: float) -> None:
        """Let it obey a command for a while, in whole steps."""
        q, x, v, z, pressure_pa = self.parameters, self.position_m, self._velocity, self._bent_m, self.pressure_pa
        coulomb_n, excess_n, stribeck = q.coulomb_n, q.static_n - q.coulomb_n, q.stribeck_m_per_s
        bristle, damping, asymmetry, stroke_m = q.bristle_n_per_m, q.bristle_damping_ns_per_m, q.asymmetry, q.stroke_m
        area_m2, spring, preload_n, viscous, stop = (
            q.area_m2,
            q.spring_n_per_m,
            q.preload_n,
            q.viscous_ns_per_m,
            q.stop_n_per_m,
        )
        speeding, follows = STEP_S / q.mass_kg, STEP_S / q.lag_s
        for _ in range(round(duration_s / STEP_S)):
            level_n = coulomb_n + excess_n * exp(-((v / stribeck) ** 2))
            level_n *= 1.0 + asymmetry * ((v > 0.0) - (v < 0.0))
            bending = v - bristle * abs(v) * z / level_n
            force_n = area_m2 * pressure_pa - spring * x - preload_n - viscous * v - bristle * z - damping * bending
            if x < 0.0:
                force_n -= stop * x
            elif x > stroke_m:
                force_n -= stop * (x - stroke_m)
            v += speeding * force_n
            x += STEP_S * v
            if v != 0.0:
                bent_at_last_m = level_n / bristle * (1.0 if v > 0 else -1.0)
                z = bent_at_last_m + (z - bent_at_last_m) * exp(-bristle * abs(v) * STEP_S / level_n)
            pressure_pa += (command_pa - pressure_pa) * follows
        self.position_m, self._velocity, self._bent_m, self.pressure_pa = x, v, z, pressure_pa


class OtherDevice:
    """The device: a thread that lets the valve live by the clock, and the registers of a server.

    Attributes:
        stem: the valve; its true position.
        port: of the server, on this machine.
    """

    def __init__(self, position_m: float, parameters: Parameters, registers: Registers) -> None:
        self.stem = Stem(parameters, position_m)
        self.registers = registers
        self.port = free_port()
        self._server = TcpServer(self.port, "127.0.0.1")
        self._slave = self._server.add_slave(UNIT)
        self._slave.add_block("registers", defines.HOLDING_REGISTERS, 0, 64)
        _know_no_function_23(self._slave)
        self._show(COMMAND, round(self.stem.pressure_pa / registers.pressure_pa))
        self._ended = Event()
        self._thread = Thread(target=self._live, name="other device")

    def start(self) -> None:
        """Live and answer."""
        self._sample()
        self._server.start()
        await_listening(self.port)
        self._thread.start()

    def stop(self) -> None:
        """Answer nobody any more."""
        self._ended.set()
        self._thread.join()
        stop_server(self._server, self.port)

    @property
    def command(self) -> int:
        """What is in the register of its command."""
        (word,) = self._slave.get_values("registers", COMMAND, 1)
        return int(word)

    def described(self, reply_timeout_s: float) -> ModbusTcpDevice:
        """Return what the daemon is told of it."""
        registers = ModbusMap(
            position_m=Place(address=POSITION, type="uint16", scale=self._quantum_m),
            pressure_pa=Place(address=PRESSURE, type="uint16", scale=self.registers.pressure_pa),
            command_pa=Place(address=COMMAND, type="uint16", scale=self.registers.pressure_pa),
        )
        return ModbusTcpDevice(port=self.port, unit=UNIT, reply_timeout_s=reply_timeout_s, map=registers)

    def _live(self) -> None:
        lived_s = time.monotonic()
        while not self._ended.wait(SAMPLED_EVERY_S):
            now_s = time.monotonic()
            command_pa = min(self.registers.pressure_pa * self.command, SUPPLY_PA)
            self.stem.advance(command_pa, min(now_s - lived_s, LONGEST_S))
            lived_s = now_s
            self._sample()

    def _sample(self) -> None:
        counts = round(self.stem.position_m / self._quantum_m)
        self._show(POSITION, min(max(counts, 0), self.registers.counts - 1))
        self._show(PRESSURE, round(self.stem.pressure_pa / self.registers.pressure_pa))

    @property
    def _quantum_m(self) -> float:
        return self.stem.parameters.stroke_m / self.registers.counts

    def _show(self, address: int, word: int) -> None:
        self._slave.set_values("registers", address, [word])


@contextmanager
def other_device(
    position_m: float, parameters: Parameters | None = None, registers: Registers | None = None
) -> Iterator[OtherDevice]:
    """Give a device that lives and answers, its stem at rest at a position."""
    device = OtherDevice(position_m, parameters or Parameters(), registers or Registers())
    device.start()
    try:
        yield device
    finally:
        device.stop()


def _know_no_function_23(slave: Slave) -> None:
    """Have it answer as a device that was built before function 23 was."""
    answers = slave.handle_request

    def handle_request(request: bytes, broadcast: bool = False) -> bytes:
        if request[:1] == bytes((defines.READ_WRITE_MULTIPLE_REGISTERS,)):
            return struct.pack(">BB", defines.READ_WRITE_MULTIPLE_REGISTERS + 0x80, defines.ILLEGAL_FUNCTION)
        reply: bytes = answers(request, broadcast)
        return reply

    slave.handle_request = handle_request


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port: int = free.getsockname()[1]
    return port


def stop_server(server: TcpServer, port: int) -> None:
    """End a server of modbus-tk at once: it looks whether it is to end once a second, or when somebody comes."""
    server._go.clear()
    with suppress(OSError):  # it has looked by now
        socket.create_connection(("127.0.0.1", port), 1.0).close()
    server.stop()


def await_listening(port: int) -> None:
    """Wait for a server on this machine: the library begins to listen in a thread of its own."""
    end_s = time.monotonic() + 30.0
    while True:
        try:
            socket.create_connection(("127.0.0.1", port), 1.0).close()
        except ConnectionRefusedError:
            assert time.monotonic() < end_s
            time.sleep(1e-3)
        else:
            return
