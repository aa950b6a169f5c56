"""What comes over a bus: requests and replies on Modbus, frames on CANopen, datagrams of the loopback bus."""

from collections.abc import Callable
from functools import cache, partial
from types import SimpleNamespace
from unittest import mock

from config.canopen_device import SHIPPED_EDS, CanopenDevice
from config.device import ModbusRtuDevice
from config.registers import WRITER_AT
from config.roles import Role
from config.serial_port import SerialPort
from config.slave_file import SlaveFile
from config.valve_file import shipped_valve
from drivers.boundary import DriverError
from drivers.canopen import sdo, watching_driver
from drivers.canopen.driver import CanopenDriver
from drivers.canopen.node_bus import NodeBus
from drivers.modbus_rtu import ModbusRtuDriver
from fieldbus.canopen import loopback
from fieldbus.canopen.eds import read_eds
from fieldbus.modbus.client import ModbusClient
from fieldbus.modbus.client_errors import ClientError
from fieldbus.modbus.client_roles import Identity, NotAuthorized, authorize
from fieldbus.modbus.function_codes import RegisterAnswers
from fieldbus.modbus.rtu import framed, is_whole
from fieldbus.modbus.server_connection import HEADER, ServerConnection
from sim.slave.canopen_node import CanopenNode
from sim.slave.clocks import Lockstep
from sim.slave.device_registers import DeviceRegisters
from sim.slave.rtu_server import RtuServer
from sim.slave.slave import device_of
from tests.daemon.panel import Panel
from tests.fuzz.parser import Broken, Parser, refused_in_one_line
from tests.fuzz.wires import Bytes, HeardLine, SpoiltBus, SpoiltLine, SpoiltSocket

NODE = 5
HELD_PA = 17e3


def _device_answers() -> RegisterAnswers:
    device = device_of(SlaveFile.model_validate({"clock": {"mode": "lockstep"}}), shipped_valve("seed"))
    return RegisterAnswers(DeviceRegisters(device, Lockstep(device)))


def _require_reply(request: bytes, reply: bytes) -> None:
    if not reply or reply[0] & 0x7F != request[0] & 0x7F or len(reply) > 253:
        raise Broken(f"no reply to {request.hex()}: {reply.hex()}")
    if reply[0] & 0x80 and reply[1:] == b"\x04":
        raise Broken(f"a fault of the server itself: {request.hex()}")


def registers_of(answers: RegisterAnswers) -> Callable[[bytes], None]:
    """Return the parser of requests."""

    def parse(data: bytes) -> None:
        if data:
            _require_reply(data, answers.answer(data[:253], "fuzz"))

    return parse


def roles(data: bytes) -> None:
    """Ask what a request needs, as each role."""

    def writer(at: int) -> Role:
        return WRITER_AT.get(at, Role.OBSERVER)

    for role in (Role.OBSERVER, Role.OPERATOR):
        if data:
            refused_in_one_line(partial(authorize, Identity("x", role), data, writer), NotAuthorized)


class _Sender:
    """A client's connection at the server: sends pieces, and takes answers."""

    def __init__(self, data: bytes) -> None:
        size = 1 + (data[0] if data else 0)
        self._pieces = [data[n : n + size] for n in range(1, len(data), size)]

    def settimeout(self, _s: float) -> None:
        pass

    def recv(self, _most: int) -> bytes:
        return self._pieces.pop(0) if self._pieces else b""

    def sendall(self, answer: bytes) -> None:
        _, protocol, length, _ = HEADER.unpack_from(answer)
        if protocol or length != len(answer) - 6:
            raise Broken(f"no frame: {answer.hex()}")


def stream_at_the_server(answers: RegisterAnswers) -> Callable[[bytes], None]:
    """Return the parser of a client's bytes."""
    host = SimpleNamespace(answer=lambda _unit, pdu, peer: answers.answer(pdu, peer), note_use=lambda _peer: 0.0)

    def parse(data: bytes) -> None:
        connection = object.__new__(ServerConnection)
        connection.request, connection.client_address = _Sender(data), ("127.0.0.1", 1)  # type: ignore[assignment]
        connection.server = host
        connection.handle()

    return parse


def replies_at_the_client(answers: RegisterAnswers) -> Callable[[bytes], None]:
    """Return the parser of a server's replies."""

    def parse(data: bytes) -> None:
        client = ModbusClient("fuzz", 502, 1, 0.01)
        client.line = SpoiltSocket(answers, Bytes(data))  # type: ignore[assignment]
        for _ in range(3):
            refused_in_one_line(lambda: client.read_holding_registers(0, 4), ClientError)
            refused_in_one_line(lambda: client.write_registers(0, [1, 2]), ClientError)

    return parse


def frames_at_the_rtu_server(data: bytes) -> None:
    """Serve a frame, and the same with the right check sum."""
    server = RtuServer(_ANSWERS.registers, _RTU.serial, 1)
    server.line = HeardLine()  # type: ignore[assignment]
    is_whole(data)
    server.serve(data)
    if 1 < len(data) < 254:
        server.serve(framed(data[0], data[1:]))


def replies_at_the_rtu_driver(data: bytes) -> None:
    """Open and exchange while a device's replies are spoilt."""
    driver = ModbusRtuDriver(_RTU)
    driver.line = SpoiltLine(_ANSWERS, Bytes(data))  # type: ignore[assignment]
    refused_in_one_line(driver.open, DriverError)
    for _ in range(3):
        refused_in_one_line(lambda: driver.exchange(HELD_PA), DriverError)


def _node(send: Callable[[int, bytes], None]) -> CanopenNode:
    device = device_of(SlaveFile.model_validate({"clock": {"mode": "lockstep"}}), shipped_valve("seed"))
    node = CanopenNode(NODE, _SHEET, device, Lockstep(device), send)
    node.boot()
    return node


def frames_at_the_node(data: bytes) -> None:
    """Give frames to the simulated node, and let its time pass."""
    said, sent = Bytes(data), list[bytes]()
    node = _node(lambda _identity, frame: sent.append(frame))
    for n in range(1 + len(data) // 4):
        known = (0x000, 0x080, 0x600 + NODE, 0x200 + NODE, said.number())
        node.receive(known[said.number() % len(known)], said.some(8))
        node.pass_time(0.1 * n)
    if any(len(frame) > 8 for frame in sent):
        raise Broken("a frame of more than 8 bytes")


def frames_at_the_driver(data: bytes) -> None:
    """Open and exchange while a node's frames are spoilt."""
    bus = SpoiltBus(NODE, Bytes(data))
    node = _node(bus.sent)
    bus.take = node.receive
    node.pass_time(0.0)
    with mock.patch.object(watching_driver, "device_sheet", return_value=_SHEET):
        driver = CanopenDriver(_CANOPEN)

    def join(self: NodeBus, _identities: object) -> None:
        self._bus = bus  # type: ignore[assignment]

    with mock.patch.object(NodeBus, "open", join), mock.patch.object(sdo, "LONGEST_LISTENING_S", 2e-3):
        _drive(driver)


def _drive(driver: CanopenDriver) -> None:
    refused_in_one_line(driver.open, DriverError)
    for _ in range(3):
        refused_in_one_line(lambda: driver.exchange(HELD_PA), DriverError)
    refused_in_one_line(driver.held_pa, DriverError)


@cache
def _ends() -> tuple[loopback.LoopbackBus, loopback.LoopbackBus]:
    channel = loopback.free_channel()
    return loopback.LoopbackBus(channel), loopback.LoopbackBus(channel)


def datagrams_of_the_loopback(data: bytes) -> None:
    """Send what is no datagram, or looks like one, from an end's own socket."""
    taking, sending = _ends()
    for datagram in (data, loopback.MAGIC + data[:1] + bytes((sending.end,)) + data[1:]):
        sending.socket.sendto(datagram[:1400], (loopback.HOST, taking.port))
        while taking.recv(0.0) is not None:
            pass
    while sending.recv(0.0) is not None:
        pass


REQUESTS = (
    b"\x03\0\0\0\x04", b"\x04\0\0\0\x7d", b"\x06\0\x64\0\x01", b"\x10\0\x64\0\x02\x04\0\0\0\0",
    b"\x17\0\0\0\x02\0\x64\0\x01\x02\0\x01", b"\x08\0\0\x12\x34", b"\x2b\x0e\x01\0", b"\x10\0\0\xff\xff\xff",
)  # fmt: skip


def _to_the_node(kind: int, data: bytes) -> bytes:
    return bytes((0, kind, len(data))) + data


FRAMES = (
    _to_the_node(2, bytes.fromhex("4018100100000000")),
    _to_the_node(2, bytes.fromhex("2b171000e8030000")) + _to_the_node(2, bytes.fromhex("4008100000000000")),
    _to_the_node(0, bytes((1, NODE))) + _to_the_node(3, bytes.fromhex("000000000f00")) + _to_the_node(1, b""),
)
_ANSWERS = _device_answers()
_RTU = ModbusRtuDevice(serial=SerialPort(path="/dev/null"), reply_timeout_s=0.5)
_CANOPEN = CanopenDevice(bus="canopen", node=NODE, reply_timeout_s=2e-3)
_SHEET = read_eds(SHIPPED_EDS, NODE)


def bus_parsers() -> dict[str, Parser]:
    """Return every parser of what comes over a bus by its name."""
    daemon = RegisterAnswers(Panel().registers)
    frames = tuple(b"\xff\0\1\0\0" + bytes((0, len(each) + 1, 1)) + each for each in REQUESTS)
    spoilings = (b"", bytes((2, 6, 3, 4, 0, 1, 0, 2)), bytes((6, 1, 255)), bytes((3, 0, 1, 5, 9)), bytes((1, 9)) * 3)
    datagram = loopback.FRAME.pack(loopback.MAGIC, loopback.DATA, 1, 1, 0, 5) + b"12345678"
    return {
        "registers of the daemon": Parser(registers_of(daemon), REQUESTS, 20),
        "registers of a device": Parser(registers_of(_ANSWERS), REQUESTS, 20),
        "roles of requests": Parser(roles, REQUESTS, 20),
        "Modbus TCP at the server": Parser(stream_at_the_server(daemon), frames, 10),
        "Modbus TCP at the client": Parser(replies_at_the_client(_ANSWERS), spoilings, 4),
        "Modbus RTU at the server": Parser(frames_at_the_rtu_server, tuple(b"\1" + each for each in REQUESTS), 10),
        "Modbus RTU at the driver": Parser(replies_at_the_rtu_driver, spoilings, 2),
        "CANopen at the node": Parser(frames_at_the_node, FRAMES, 0.2),
        "CANopen at the driver": Parser(frames_at_the_driver, spoilings, 0.2),
        "loopback CAN": Parser(datagrams_of_the_loopback, (datagram, datagram[4:]), 4),
    }
