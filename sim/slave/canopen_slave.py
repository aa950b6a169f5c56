"""The simulated node on its CAN bus."""

import time
from contextlib import suppress
from threading import Event, Lock, Thread

from config.canopen_device import SHIPPED_EDS, CanBus
from config.errors import InputError
from fieldbus.canopen.eds import read_eds
from fieldbus.canopen.python_can import can
from sim.slave.canopen_node import CanopenNode
from sim.slave.clocks import Clock
from sim.slave.simulated_device import Device

LISTEN_S = 0.2
"""How long a newcomer waits for another node of its id."""
IDLE_S = 5e-3
"""Longest wait for a frame, so that heartbeats leave on time."""


class NodeServer:
    """Puts a device on a CAN bus, from a thread of its own.

    Args:
        bus: which bus, and the node id.
        device: what it is.
        clock: lets its time pass.
        source: what a complaint about the bus names.

    Raises:
        InputError: the bus cannot be opened, or another node has the id.
    """

    def __init__(self, bus: CanBus, device: Device, clock: Clock, source: str) -> None:
        self.lock = Lock()
        self.address = f"{bus.interface} node {bus.node} on channel:{bus.channel}"
        self._source = source
        try:
            self._bus = can.Bus(**bus.bus_arguments)  # type: ignore[arg-type]
        except Exception as error:  # somebody else's interface: it may raise anything
            said = " ".join(str(error).split())
            raise InputError(source, f"bus: {bus.interface} {bus.channel} cannot be opened: {said}") from None
        sheet = read_eds(SHIPPED_EDS, bus.node)
        self.node = CanopenNode(bus.node, sheet, device, clock, self.send)
        self._stop = Event()
        self._thread = Thread(target=self._work, daemon=True, name="canopen node")

    def start(self) -> None:
        """Look whether the node id is free, boot, and answer from now on.

        Raises:
            InputError: another node has the id.
        """
        node = self.node.number
        self.send(0x600 + node, bytes((0x40, 0x00, 0x10, 0, 0, 0, 0, 0)))
        end_s = time.monotonic() + LISTEN_S
        while (rest_s := end_s - time.monotonic()) > 0:
            message = self._bus.recv(rest_s)
            if message is not None and message.arbitration_id in (0x580 + node, 0x700 + node):
                self._bus.shutdown()
                raise InputError(self._source, f"bus.node: {node} is taken by another node on {self._bus.channel_info}")
        self.begin()

    def begin(self) -> None:
        """Boot, and answer from now on, whoever else has the id."""
        self.node.boot()
        self._thread.start()

    def stop(self) -> None:
        """Leave the bus."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self._bus.shutdown()

    def _work(self) -> None:
        wanted: frozenset[int] = frozenset()
        while not self._stop.is_set():
            try:
                if self.node.wanted_ids != wanted:  # what is for others need not come
                    wanted = self.node.wanted_ids
                    self._bus.set_filters([{"can_id": each, "can_mask": 0x7FF, "extended": False} for each in wanted])
                message = self._bus.recv(IDLE_S)
            except (can.CanError, OSError):
                self._stop.wait(IDLE_S)  # the bus is off; it may come back
                continue
            with self.lock:
                if message is not None and not message.is_error_frame and not message.is_remote_frame:
                    self.node.receive(message.arbitration_id, bytes(message.data))
                self.node.pass_time(time.monotonic())

    def send(self, identity: int, data: bytes) -> None:
        """Put a frame on the bus."""
        with suppress(can.CanError):  # a master notices what is missing
            self._bus.send(can.Message(arbitration_id=identity, data=data, is_extended_id=False))
